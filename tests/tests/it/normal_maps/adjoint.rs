//! Photons and paths at a wall with a normal map are adjoint: both transport the same power.

use std::f64::consts::PI;

use glam::{DVec3, Vec3, Vec4};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::trace;
use photoncard_driver::photon_map::GatherParameters;
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::{Camera, Material, Projection, Reflection, Scene, Transmission};
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::render::Context;
use photoncard_firmware::render::specular_path::{Carried, Passes, PathEnd, SpecularPath};
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{Ray, RayKind, Surface, closest_hit, read_surface};
use photoncard_shared::counters::Counters;
use photoncard_shared::layout::{Photon, decode_direction};
use photoncard_tests::shapes::{add_tangents, add_textured_quad};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, scene};
use rayon::prelude::*;

use super::{bumps, directional, film, mapped, metal, normal_texture, plastic, plate, settings, tilted};

/// Pseudo-random number in [0, 1).
fn random(index: u32, dimension: u32) -> f32 {
    (hash(hash(index).wrapping_add(dimension)) >> 8) as f32 / 16_777_216.0
}

/// Point `index` of the four-dimensional sequence R4 (Roberts 2018): multiples of the powers of 1 / g, with
/// `g^5 = g + 1`.
fn place(index: u32) -> [f32; 4] {
    const G: f64 = 1.167_303_978_261_418_7;
    [1, 2, 3, 4].map(|power| (0.5 + f64::from(index) / G.powi(power)).fract() as f32)
}

/// Floor beside a glossy wall with a normal map, opposite to a lamp.
fn wall_and_floor(normals: &[DVec3], roughness: f32) -> Scene {
    let lamp = Material { emission: Vec3::splat(10.0), ..lambertian("lamp", 0.0) };
    // A black floor would store no photons.
    let materials = vec![mapped(metal(roughness), 1.0), lambertian("floor", 0.001), lamp];
    let mut scene = scene(Vec::new(), materials, camera(Vec3::new(0.0, 1.0, 3.0), Vec3::NEG_Z));
    let wall = [[0., 1.], [0., -1.], [1.5, -1.], [1.5, 1.]].map(|[y, z]| Vec3::new(-1.0, y, z));
    add_textured_quad(&mut scene, wall, [[0., 9.], [8., 9.], [8., 0.], [0., 0.]], 0);
    // The texture's u axis on the wall is -z.
    add_tangents(&mut scene, 0, Vec4::new(0.0, 0.0, -1.0, 1.0));
    let floor = [[-1., 1.], [1., 1.], [1., -1.], [-1., -1.]].map(|[x, z]| Vec3::new(x, 0.0, z));
    scene.triangles.extend(quad(floor, 1));
    let lamp = [[2.5, 2.], [0.2, 2.], [0.2, -2.], [2.5, -2.]].map(|[y, z]| Vec3::new(1.0, y, z));
    scene.triangles.extend(quad([lamp[0], lamp[3], lamp[2], lamp[1]], 2));
    assert!(scene.triangles[scene.triangles.len() - 1].scaled_normal().x < 0.0, "the lamp faces the wall");
    assert!(scene.triangles[0].scaled_normal().x > 0.0, "the wall faces the lamp");
    normal_texture(&mut scene, normals);
    scene
}

/// Power of photons on the floor that come from the wall, W.
fn brought(packed: &PackedScene) -> f64 {
    let pass = trace(packed, 1, 600_000, &|_| true).unwrap();
    let unit = f64::from(pass.photons.power_unit());
    // From each point of the floor, the lamp is towards +x and the wall towards -x.
    let is_by_the_wall = |photon: &Photon| decode_direction(photon.direction)[0] < 0.0;
    let on_the_floor = pass.photons.iter().filter(|photon| photon.position[1].abs() < 1e-3);
    on_the_floor.filter(is_by_the_wall).map(|photon| f64::from(photon.power.decode()[0]) * unit).sum()
}

/// Power that reaches the floor by way of the wall, by paths that start on the floor, W.
fn found(packed: &PackedScene, view: &Camera) -> f64 {
    const PATHS: u32 = 700_000;
    const OF_A_TASK: u32 = 10_000;
    let frame = RenderSettings::default().frame(view, &GatherParameters::within(1.0));
    let of_task = |task: u32| {
        let (image, mut memory) = packed.view();
        let mut counters = Counters::ZERO;
        let counters = &mut counters;
        let mut context = Context { scene: &image, memory: &mut memory, frame: &frame, counters };
        (task * OF_A_TASK..(task + 1) * OF_A_TASK).map(|index| path_to_the_lamp(&mut context, index)).sum()
    };
    let sums: Vec<f64> = (0..PATHS / OF_A_TASK).into_par_iter().map(of_task).collect();
    // Area of the floor, 4 m^2, times pi / 2, the integral of the cosine over the half of directions towards
    // the wall.
    sums.iter().sum::<f64>() / f64::from(PATHS) * 4.0 * PI / 2.0
}

/// Radiance that path `index` brings to the floor, by way of the wall.
fn path_to_the_lamp<M: MemoryPort>(context: &mut Context<M>, index: u32) -> f64 {
    let [x, z, u, v] = place(index);
    let origin = Vec3::new(2.0 * x - 1.0, 1e-5, 2.0 * z - 1.0);
    let (sine, cosine) = (std::f32::consts::PI * u).sin_cos();
    let radius = v.sqrt();
    let direction = Vec3::new(-radius * sine, (1.0 - v).sqrt(), radius * cosine);
    let mut path = SpecularPath::new(
        Ray::new(RayKind::Radiance, origin, direction),
        Carried::Radiance,
        Passes::NarrowLobes,
    );
    let Some(mut hit) = closest_hit(context.scene, context.memory, &path.ray).unwrap() else { return 0.0 };
    let mut surface = Surface::NOWHERE;
    read_surface(context.scene, context.memory, &path.ray, &hit, &|_| 0.0, &mut surface).unwrap();
    assert!(path.may_pass(&surface), "nothing but the wall is there");
    let choose = |choice: u32| random(index, choice);
    match path.follow(context, &mut surface, &mut hit, &choose).unwrap() {
        PathEnd::Surface => f64::from((path.throughput * surface.emission).x),
        PathEnd::Escaped | PathEnd::Lost => 0.0,
    }
}

#[test]
fn photons_and_paths_transport_equal_power_over_a_bumpy_wall() {
    let gentle: Vec<_> = (0..16).map(|k| tilted(f64::from(k % 4) * 6.0, 97.0 * f64::from(k))).collect();
    for (name, normals, roughness, tolerance) in [
        ("tilted", vec![tilted(15.0, 180.0)], 0.3, 0.01),
        ("gentle", gentle, 0.3, 0.01),
        ("bumpy", bumps(), 0.3, 0.02),
        ("bumpy mirror", bumps(), 0.0, 0.02),
    ] {
        let scene = wall_and_floor(&normals, roughness);
        let packed = PackedScene::new(&scene).unwrap();
        let (brought, found) = (brought(&packed), found(&packed, &scene.cameras[0]));
        println!("{name}: {brought:.4} W by photons, {found:.4} W by paths: {:.4}", brought / found);
        assert!((brought / found - 1.0).abs() < tolerance, "{name}: {brought} {found}");
    }
}

/// Clear glass of a pane without thickness.
fn pane() -> Material {
    let transmission = Transmission { factor: 1.0, ior: 1.5, is_volume: false, absorption: Vec3::ZERO };
    let Material { reflection, .. } = plastic(0.0);
    let Reflection::MetallicRoughness { dielectric, grazing, metallic, roughness, .. } = reflection else {
        unreachable!("plastic is metallic-roughness");
    };
    let transmission = Some(transmission);
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::ONE,
        metallic,
        roughness,
        dielectric,
        grazing,
        transmission,
    };
    Material::new("pane", reflection)
}

/// Sunlight through a pane reaches a floor as a caustic, dimmed by the pane's transmittance. Lobe and base of
/// the floor have normals of their own; each photon is stored once for both.
#[test]
fn photons_light_a_floor_of_two_parts_once() {
    let normals = [tilted(50.0, 180.0), tilted(50.0, 0.0), tilted(20.0, 90.0)];
    let look = |has_pane: bool| {
        let view = Camera {
            projection: Projection::perspective(0.2),
            ..camera(Vec3::new(-0.9, 0.0, 0.4), Vec3::new(0.9, 0.0, -0.4))
        };
        let mut lit = plate(mapped(plastic(0.3), 1.0), &normals, Vec4::new(1.0, 0.0, 0.0, 1.0), view);
        lit.materials.push(pane());
        lit.lights = vec![directional(DVec3::Z, 1.0)];
        if has_pane {
            let corners =
                [[-1.2, -1.2], [1.2, -1.2], [1.2, 1.2], [-1.2, 1.2]].map(|[x, y]| Vec3::new(x, y, 0.6));
            lit.triangles.extend(quad(corners, 1));
        }
        let settings = settings(0, 64).with(|s| {
            s.photons.caustic_photons = Some(200_000);
            s.photons.caustic_neighbors = 50;
        });
        mean(&radiances(&film(&lit, &settings)))
    };
    let reflected = 0.04;
    let transmitted = 1.0 - 2.0 * reflected / (1.0 + reflected);
    let share = look(true) / look(false) / transmitted;
    assert!((share - 1.0).abs() < 0.05, "{share}");
}
