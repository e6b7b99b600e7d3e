//! Energy of the photon pass: the emission of every kind of light arrives.

use std::f64::consts::PI;

use glam::{Vec2, Vec3};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::trace;
use photoncard_driver::scene::{
    Encoding, Environment, Image, Material, PunctualKind, PunctualLight, Scene, Texture, Triangle,
    VertexAttributes,
};
use photoncard_firmware::scene::light::{environment_direction, environment_radiance};
use photoncard_tests::{camera, lambertian, quad, room, scene};

const PHOTONS: usize = 200_000;
/// Albedo of nearly black surfaces, on which photons are still stored.
const BLACK: f32 = 0.001;

/// Stored power per channel, watts.
fn stored(scene: &Scene) -> [f64; 3] {
    let packed = PackedScene::new(scene).unwrap();
    let photons = trace(&packed, 11, PHOTONS, &|_| true).unwrap().photons;
    let unit = f64::from(photons.power_unit());
    std::array::from_fn(|channel| {
        photons.iter().map(|photon| f64::from(photon.power.decode()[channel]) * unit).sum()
    })
}

fn check(scene: &Scene, expected: [f64; 3], what: &str) {
    for (found, expected) in stored(scene).into_iter().zip(expected) {
        let error = found * (1.0 - f64::from(BLACK)) / expected - 1.0;
        assert!(error.abs() < 0.006, "{what}: {found} W instead of {expected} W, off by {error}");
    }
}

/// A closed black room.
fn inside() -> Scene {
    scene(room([0; 6]), vec![lambertian("wall", BLACK)], camera(Vec3::ZERO, Vec3::NEG_Z))
}

/// Black cube of side 2, seen from outside.
fn outside() -> Scene {
    let mut cube = inside();
    for Triangle { vertices: [_, b, c], .. } in &mut cube.triangles {
        std::mem::swap(b, c);
    }
    cube
}

fn light(kind: PunctualKind, intensity: [f32; 3]) -> PunctualLight {
    PunctualLight { name: "light".into(), kind, intensity: intensity.into() }
}

const COLOUR: [f32; 3] = [3.0, 2.0, 0.5];

fn times(colour: [f32; 3], factor: f64) -> [f64; 3] {
    colour.map(|channel| f64::from(channel) * factor)
}

#[test]
fn points_and_spots_emit_their_intensity_over_their_directions() {
    let position = Vec3::new(0.2, 0.1, -0.3);
    let mut room = inside();
    room.lights = vec![light(PunctualKind::Point { position }, COLOUR)];
    check(&room, times(COLOUR, 4.0 * PI), "point");
    for (inner, outer) in [(0.9_f64, 0.6_f64), (1.0, 0.999_9), (0.5, -0.5)] {
        let direction = Vec3::new(1.0, 2.0, -0.5).normalize();
        let kind = PunctualKind::Spot {
            position,
            direction,
            inner_cosine: inner as f32,
            outer_cosine: outer as f32,
        };
        room.lights = vec![light(kind, COLOUR)];
        // Numerical integral of the falloff of `KHR_lights_punctual`.
        let width = (f64::from(inner as f32) - f64::from(outer as f32)).max(0.001);
        let steps = 10_000;
        let share = |i: i32| {
            let above = (f64::from(i) + 0.5) / f64::from(steps) * (1.0 - f64::from(outer as f32));
            (above / width).min(1.0).powi(2)
        };
        let mean = (0..steps).map(share).sum::<f64>() / f64::from(steps);
        let solid_angle = 2.0 * PI * (1.0 - f64::from(outer as f32)) * mean;
        check(&room, times(COLOUR, solid_angle), "spot");
    }
}

#[test]
fn a_directional_light_brings_its_irradiance_to_all_that_faces_it() {
    for direction in [Vec3::NEG_Y, Vec3::new(1.0, -2.0, 0.5)] {
        let direction = direction.normalize();
        let mut cube = outside();
        cube.lights = vec![light(PunctualKind::Directional { direction }, COLOUR)];
        let shown = 4.0 * f64::from(direction.abs().element_sum());
        check(&cube, times(COLOUR, shown), "directional");
    }
}

#[test]
fn an_environment_brings_its_radiance_to_all_sides() {
    let mut cube = outside();
    cube.environment = Some(Environment::constant(COLOUR.into()));
    check(&cube, times(COLOUR, PI * 24.0), "constant");
    let mut texels = vec![[0.2, 0.3, 0.4]; 96 * 48];
    for row in 5..9 {
        texels[row * 96 + 20..][..6].fill([300.0, 200.0, 100.0]);
    }
    cube.environment = Some(Environment { width: 96, height: 48, texels });
    check(&cube, received(&cube), "map");
}

/// Power that the cube receives from its environment: the integral over directions of radiance times projected area.
fn received(cube: &Scene) -> [f64; 3] {
    let packed = PackedScene::new(cube).unwrap();
    let (image, mut memory) = packed.view();
    let [columns, rows] = [768, 768];
    let mut sum = [0.0; 3];
    for row in 0..rows {
        let cosine = 1.0 - (row as f32 + 0.5) / rows as f32 * 2.0;
        for column in 0..columns {
            let direction = environment_direction((column as f32 + 0.5) / columns as f32, cosine);
            let radiance = environment_radiance(&image, &mut memory, direction).unwrap();
            let shown = 4.0 * f64::from(direction.abs().element_sum()) * 4.0 * PI / f64::from(columns * rows);
            sum.iter_mut().zip(radiance.to_array()).for_each(|(sum, r)| *sum += f64::from(r) * shown);
        }
    }
    sum
}

#[test]
fn a_panel_with_a_texture_emits_its_mean_and_all_lights_together_their_sum() {
    // A panel with one glowing corner, beside a point light.
    let mut texels = vec![[0, 0, 0, 255]; 16 * 16];
    for row in 2..6 {
        texels[row * 16 + 3..][..5].fill([255; 4]);
    }
    let image = Image { name: "corner".into(), width: 16, height: 16, texels, encoding: Encoding::Srgb };
    let corner = |x: f32, z: f32| Vec3::new(0.5 * x, -0.2, 0.5 * z);
    let mut all = inside();
    all.images.push(image);
    all.textures.push(Texture::new(0));
    all.triangles.extend(quad([corner(-1., 1.), corner(1., 1.), corner(1., -1.), corner(-1., -1.)], 1));
    let [a, b, c, d] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    for (corners, index) in [([a, b, c], 0), ([a, c, d], 1)] {
        all.attributes.push(VertexAttributes { coordinates: [corners; 2], ..VertexAttributes::NONE });
        all.triangles[12 + index as usize].attributes = index;
    }
    all.materials.push(Material {
        emission: COLOUR.into(),
        double_sided: true,
        emissive_texture: Some(0),
        ..lambertian("panel", BLACK)
    });
    // The interpolated texture has the mean of its texels, as it is dark at the borders.
    let panel = 2.0 * PI * 20.0 / 256.0;
    check(&all, times(COLOUR, panel), "panel");
    all.lights = vec![light(PunctualKind::Point { position: Vec3::new(0.0, 0.5, 0.0) }, COLOUR)];
    check(&all, times(COLOUR, panel + 4.0 * PI), "panel and point");
}
