//! Mirrors and glass of known radiance, seen by eye rays, by gather rays, and as caustics.

use glam::Vec3;
use photoncard_driver::render::{CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{
    Encoding, Environment, Image, Material, Projection, Reflection, Scene, Texture, Transmission,
};
use photoncard_tests::shapes::{add_ball, add_textured_quad, cuboid};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, room, scene};

const EMISSION: f32 = 1.0;
const ALBEDO: f32 = 0.5;
/// Radiance of a closed room whose walls emit [`EMISSION`] and reflect [`ALBEDO`].
const FURNACE: f64 = (EMISSION / (1.0 - ALBEDO)) as f64;

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 48, height: 48, ..Picture::default() },
        photons: PhotonMaps { count: 200_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 16, samples: 8, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:2".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

pub(super) fn mirror(reflectance: f32) -> Material {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(reflectance),
        metallic: 1.0,
        roughness: 0.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    Material::new("mirror", reflection)
}

fn glass(is_volume: bool, absorption: f32) -> Material {
    let absorption = Vec3::splat(absorption);
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::ONE,
        metallic: 0.0,
        roughness: 0.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: Some(Transmission { factor: 1.0, ior: 1.5, is_volume, absorption }),
    };
    Material::new("glass", reflection)
}

/// Fresnel reflectance of a face of glass at normal incidence.
const FACE: f64 = 0.04;

fn wall() -> Material {
    Material { emission: Vec3::splat(EMISSION), ..lambertian("wall", ALBEDO) }
}

/// Closed room of uniform radiance with an object in it.
fn furnace_with(thing: Material, add: impl Fn(&mut Scene)) -> Scene {
    let view = camera(Vec3::new(0.1, 0.05, 0.9), Vec3::new(-0.1, -0.05, -1.0));
    let mut scene = scene(room([0; 6]), vec![wall(), thing], view);
    add(&mut scene);
    scene
}

/// Checks the mean of the picture, and that of each block of 8x8 pixels.
fn shows(scene: &Scene, settings: &RenderSettings, expected: f64, tolerance: f64) {
    let all = radiances(&render_or_panic(scene, settings).film);
    let error = mean(&all) / expected - 1.0;
    assert!(error.abs() < 0.4 * tolerance, "the mean is off by {error}");
    for block in 0..36 {
        let corner = block / 6 * 8 * 48 + block % 6 * 8;
        let pixels: Vec<[f32; 3]> = (0..64).map(|i| all[(corner + i / 8 * 48 + i % 8) as usize]).collect();
        let error = mean(&pixels) / expected - 1.0;
        assert!(error.abs() < tolerance, "block {block} is off by {error}");
    }
}

/// In uniform radiance, an object without loss is invisible, and walls that receive light through it are
/// neither darker nor brighter.
#[test]
fn lossless_objects_are_invisible_in_a_furnace() {
    let ball = |scene: &mut Scene| add_ball(scene, Vec3::new(-0.2, -0.1, 0.0), 0.4, 24, 1);
    let block = |scene: &mut Scene| scene.triangles.extend(cuboid(Vec3::ZERO, Vec3::splat(0.35), 1));
    let settings = settings().with(|s| (s.photons.count, s.integrator.samples) = (80_000, 3));
    shows(&furnace_with(mirror(1.0), block), &settings, FURNACE, 0.03);
    shows(&furnace_with(glass(true, 0.0), block), &settings, FURNACE, 0.03);
    shows(&furnace_with(mirror(1.0), ball), &settings, FURNACE, 0.04);
    shows(&furnace_with(glass(true, 0.0), ball), &settings, FURNACE, 0.04);
    // Without a caustic map, gather rays carry the light of caustics.
    let without_map = settings.with(|s| s.photons.caustic_photons = Some(0));
    shows(&furnace_with(glass(true, 0.0), ball), &without_map, FURNACE, 0.04);
}

/// Mean of a picture of a small area at the origin, seen from `from`.
fn glance(triangles: Vec<photoncard_driver::scene::Triangle>, materials: Vec<Material>, from: Vec3) -> f64 {
    let mut view = camera(from, -from);
    view.projection = Projection::perspective(0.02);
    let scene = scene(triangles, materials, view);
    let settings = settings().with(|s| {
        s.picture.width = 16;
        s.picture.height = 16;
        s.integrator.samples = 256;
        s.integrator.gather_rays = 0;
    });
    mean(&radiances(&render_or_panic(&scene, &settings).film))
}

/// Emissive wall in the plane z = `z` that faces +z, or -z if `sign` is -1.
fn lamp(z: f32, sign: f32) -> [photoncard_driver::scene::Triangle; 2] {
    let corner = |x: f32, y: f32| Vec3::new(x * sign, y, z);
    quad([corner(-9., -9.), corner(9., -9.), corner(9., 9.), corner(-9., 9.)], 0)
}

fn black_lamp() -> Material {
    Material { emission: Vec3::splat(EMISSION), ..lambertian("lamp", 0.0) }
}

#[test]
fn a_slab_of_glass_transmits_by_its_faces_and_its_absorption() {
    for (absorption, thickness) in [(0.0_f32, 0.1_f32), (3.0, 0.1), (3.0, 0.3)] {
        let mut triangles = cuboid(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.5 * thickness), 1);
        triangles.extend(lamp(-2.0, 1.0));
        let seen = glance(triangles, vec![black_lamp(), glass(true, absorption)], Vec3::Z);
        let once = (-absorption as f64 * thickness as f64).exp();
        let expected = (1.0 - FACE).powi(2) * once / (1.0 - (FACE * once).powi(2));
        assert!((seen / expected - 1.0).abs() < 0.01, "{seen} instead of {expected}");
    }
}

#[test]
fn a_thin_wall_of_glass_is_a_slab_without_thickness() {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let pane = quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 1);
    for sign in [1.0, -1.0] {
        let triangles = [pane, lamp(-2.0 * sign, sign)].concat();
        let seen = glance(triangles, vec![black_lamp(), glass(false, 0.0)], Vec3::Z * sign);
        let expected = (1.0 - FACE) / (1.0 + FACE);
        assert!((seen / expected - 1.0).abs() < 0.01, "{seen} instead of {expected}");
    }
}

#[test]
fn a_mirror_shows_its_reflectance_at_the_viewing_angle() {
    for (reflectance, angle) in [(0.5_f32, 0.0_f32), (0.5, 1.2), (1.0, 0.7)] {
        let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let pane = quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 1);
        let triangles = [pane, lamp(2.0, -1.0)].concat();
        let from = Vec3::new(angle.sin(), 0.0, angle.cos());
        let seen = glance(triangles, vec![black_lamp(), mirror(reflectance)], from);
        let schlick = reflectance + (1.0 - reflectance) * (1.0 - angle.cos()).powi(5);
        assert!((seen / schlick as f64 - 1.0).abs() < 0.01, "{seen} instead of {schlick}");
    }
}

/// Inside glass, radiance is that outside times the square of the index of refraction. From outside, an
/// emitter inside shows its radiance divided by this square.
#[test]
fn surfaces_inside_glass_show_their_radiance_over_the_square_of_the_index() {
    let mut triangles = cuboid(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.2), 1);
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    triangles.extend(quad([corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)], 0));
    let seen = glance(triangles, vec![black_lamp(), glass(true, 0.0)], Vec3::Z);
    let expected = (1.0 - FACE) / (1.5 * 1.5);
    assert!((seen / expected - 1.0).abs() < 0.01, "{seen} instead of {expected}");
}

/// A coat or a mirror without any other surface shows the sky, and a coat's base reflects the sky; no caustic
/// is stored.
#[test]
fn specular_surfaces_alone_show_the_sky() {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let pane = quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 0);
    let coat = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(0.8),
        metallic: 0.0,
        roughness: 0.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    for (material, expected) in [(mirror(1.0), 1.0), (Material::new("coat", coat), 0.04 + 0.96 * 0.8)] {
        let mut view = camera(Vec3::Z, Vec3::NEG_Z);
        view.projection = Projection::perspective(0.02);
        let mut scene = scene(pane.to_vec(), vec![material], view);
        scene.environment = Some(Environment::constant(Vec3::ONE));
        let settings = settings().with(|s| {
            s.picture.width = 16;
            s.picture.height = 16;
            s.photons.count = 1000;
            s.integrator.samples = 64;
        });
        let seen = mean(&radiances(&render_or_panic(&scene, &settings).film));
        assert!((seen / expected - 1.0).abs() < 0.02, "{seen} instead of {expected}");
    }
}

/// A texture with metalness 0 makes glass of a material whose metallic factor is 1.
#[test]
fn a_texture_without_metal_makes_glass_of_a_metallic_factor() {
    let texel = |blue: u8| {
        let Reflection::MetallicRoughness {
            base_colour, roughness, dielectric, grazing, transmission, ..
        } = glass(false, 0.0).reflection
        else {
            unreachable!("glass is metallic-roughness")
        };
        let reflection = Reflection::MetallicRoughness {
            base_colour,
            metallic: 1.0,
            roughness,
            dielectric,
            grazing,
            transmission,
        };
        let material = Material { metallic_roughness_texture: Some(0), ..Material::new("pane", reflection) };
        let mut view = camera(Vec3::Z, Vec3::NEG_Z);
        view.projection = Projection::perspective(0.02);
        let mut scene = scene(lamp(-2.0, 1.0).to_vec(), vec![black_lamp(), material], view);
        let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let corners = [corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
        add_textured_quad(&mut scene, corners, [[0.; 2], [1., 0.], [1.; 2], [0., 1.]], 1);
        let texels = vec![[0, 255, blue, 255]];
        let encoding = Encoding::Linear;
        scene.images.push(Image { name: "metal".into(), width: 1, height: 1, texels, encoding });
        scene.textures.push(Texture::new(0));
        let settings = settings().with(|s| {
            s.picture.width = 16;
            s.picture.height = 16;
            s.photons.count = 1000;
            s.integrator.samples = 256;
        });
        mean(&radiances(&render_or_panic(&scene, &settings).film))
    };
    let through = (1.0 - FACE) / (1.0 + FACE);
    assert!((texel(0) / through - 1.0).abs() < 0.01, "{} instead of {through}", texel(0));
    assert!(texel(255) < 0.01, "metal lets {} through", texel(255));
}

#[test]
fn the_back_of_one_sided_glass_emits_nothing() {
    let glowing = Material { emission: Vec3::ONE, ..glass(false, 0.0) };
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let pane = quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 0);
    let from = |sign: f32| glance(pane.to_vec(), vec![glowing.clone()], Vec3::Z * sign);
    assert!((from(1.0) - 1.0).abs() < 0.01, "{}", from(1.0));
    assert_eq!(from(-1.0), 0.0);
}
