//! Material layers of known radiance: coat, sheen, diffuse transmission, rough glass, and textures of the
//! specular reflectance.

use glam::Vec3;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{
    Camera, Coat, DiffuseTransmission, Encoding, Environment, Image, Layers, LightAxes, Material, Projection,
    PunctualKind, PunctualLight, Reflection, Scene, Sheen, Texture, Transmission,
};
use photoncard_tests::shapes::{add_ball, add_textured_quad};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, room, scene};

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 16, height: 16, ..Picture::default() },
        photons: PhotonMaps { count: 30_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 32, samples: 16, ..Integrator::default() },
        ..RenderSettings::default()
    }
}

/// Dielectric of roughness 0.9 with this base colour, F0 and layers.
fn dielectric(base: f32, f0: f32, layers: Layers) -> Material {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(base),
        metallic: 0.0,
        roughness: 0.9,
        dielectric: Vec3::splat(f0),
        grazing: if f0 > 0.0 { 1.0 } else { 0.0 },
        transmission: None,
    };
    Material { double_sided: true, layers: Some(Box::new(layers)), ..Material::new("surface", reflection) }
}

fn none() -> Layers {
    Layers::none(Vec3::ZERO)
}

fn coat(factor: f32, roughness: f32) -> Layers {
    let coat = Coat { factor, roughness, factor_texture: None, roughness_texture: None, normal: None };
    Layers { coat: Some(coat), ..none() }
}

fn sheen(colour: f32, roughness: f32) -> Layers {
    let colour = Vec3::splat(colour);
    Layers {
        sheen: Some(Sheen { colour, roughness, colour_texture: None, roughness_texture: None }),
        ..none()
    }
}

fn leaf(factor: f32, colour: f32) -> Layers {
    let colour = Vec3::splat(colour);
    let part = DiffuseTransmission { factor, colour, factor_texture: None, colour_texture: None };
    Layers { diffuse_transmission: Some(part), ..none() }
}

/// Radiance of a horizontal plate under a white sky, seen at this cosine to its normal.
fn plate(material: Material, cosine: f32) -> f64 {
    shown(&plate_of(material, cosine))
}

fn shown(scene: &Scene) -> f64 {
    mean(&radiances(&render_or_panic(scene, &settings()).film))
}

fn plate_of(material: Material, cosine: f32) -> Scene {
    let corner = |x: f32, z: f32| Vec3::new(40.0 * x, 0.0, 40.0 * z);
    let mut scene = scene(Vec::new(), vec![material], from_afar(cosine));
    let corners = [corner(-1., 1.), corner(1., 1.), corner(1., -1.), corner(-1., -1.)];
    add_textured_quad(&mut scene, corners, [[0., 0.], [1., 0.], [1., 1.], [0., 1.]], 0);
    scene.environment = Some(Environment::constant(Vec3::ONE));
    scene
}

fn from_afar(cosine: f32) -> Camera {
    let direction = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.01).normalize();
    Camera {
        projection: Projection::perspective(2.0_f32.to_radians()),
        ..camera(direction * 20.0, -direction)
    }
}

/// Directional albedos of a GGX lobe with F0 0.04 and F90 1 by quadrature: roughness, cosine, albedo.
const COATS: [(f32, f32, f64); 4] =
    [(0.1, 0.15, 0.4608), (0.1, 0.98, 0.04), (0.5, 0.15, 0.1477), (0.7, 0.15, 0.0825)];

#[test]
fn a_coat_reflects_its_albedo_and_leaves_the_rest_to_the_base() {
    for (roughness, cosine, albedo) in COATS {
        for (factor, base) in [(1.0_f32, 0.0_f32), (0.5, 0.0), (1.0, 0.5)] {
            let of_coat = albedo * f64::from(factor);
            let fresnel = f64::from(factor * (0.04 + 0.96 * (1.0 - cosine).powi(5)));
            let expected = of_coat + (1.0 - fresnel.max(of_coat)) * f64::from(base);
            let found = plate(dielectric(base, 0.0, coat(factor, roughness)), cosine);
            let error = found - expected;
            assert!(
                error.abs() < 0.01 * expected + 3e-4,
                "{roughness} at {cosine} on {base}: {found}, not {expected}"
            );
        }
    }
}

#[test]
fn a_smooth_coat_reflects_by_schlicks_formula() {
    for cosine in [0.15_f32, 0.98] {
        let schlick = f64::from(0.04 + 0.96 * (1.0 - cosine).powi(5));
        let found = plate(dielectric(0.5, 0.0, coat(1.0, 0.0)), cosine);
        let expected = schlick + (1.0 - schlick) * 0.5;
        assert!((found / expected - 1.0).abs() < 0.01, "{cosine}: {found}, not {expected}");
    }
}

/// Directional albedos of a white sheen by quadrature: roughness, cosine, albedo.
const SHEENS: [(f32, f32, f64); 4] =
    [(0.5, 0.15, 0.4847), (0.5, 0.98, 0.031), (1.0, 0.15, 0.6442), (1.0, 0.98, 0.1697)];

#[test]
fn a_sheen_reflects_its_albedo_and_leaves_the_rest_to_the_base() {
    for (roughness, cosine, albedo) in SHEENS {
        for (colour, base) in [(1.0_f32, 0.0_f32), (0.5, 0.4)] {
            let of_sheen = albedo * f64::from(colour);
            let expected = of_sheen + (1.0 - of_sheen) * f64::from(base);
            let found = plate(dielectric(base, 0.0, sheen(colour, roughness)), cosine);
            let error = found - expected;
            assert!(error.abs() < 0.01 * expected + 2e-3, "{roughness} at {cosine}: {found}, not {expected}");
        }
    }
}

#[test]
fn a_leaf_shows_the_light_on_both_of_its_sides() {
    let found = plate(dielectric(0.6, 0.0, leaf(0.25, 0.8)), 0.9);
    let expected = 0.75 * 0.6 + 0.25 * 0.8;
    assert!((found / expected - 1.0).abs() < 0.01, "{found}, not {expected}");
}

/// Seen from above, a plate of black dielectric with roughness 0.1 shows its F0. The sRGB code 188 is 0.5029,
/// an alpha of 128 is 0.5.
#[test]
fn textures_of_the_reflectance_multiply_it_before_its_limit() {
    for (specular, texel, expected) in [
        (0.996_f32, [188, 188, 188, 255], 0.996 * 0.5029),
        (0.04, [255, 255, 255, 128], 0.04 * 128.0 / 255.0),
        (3.0, [188, 188, 188, 128], 128.0 / 255.0),
    ] {
        let f0 = Vec3::splat(specular.min(1.0));
        let layers = Layers {
            specular_texture: Some(0),
            specular_colour_texture: Some(0),
            ..Layers::none(Vec3::splat(specular))
        };
        let reflection = Reflection::MetallicRoughness {
            base_colour: Vec3::ZERO,
            metallic: 0.0,
            roughness: 0.1,
            dielectric: f0,
            grazing: 1.0,
            transmission: None,
        };
        let material = Material { layers: Some(Box::new(layers)), ..Material::new("surface", reflection) };
        let mut scene = plate_of(material, 0.98);
        scene.textures.push(Texture::new(0));
        scene.images.push(Image {
            name: "reflectance".to_owned(),
            width: 1,
            height: 1,
            encoding: Encoding::Srgb,
            texels: vec![texel],
        });
        let found = shown(&scene);
        assert!((found / expected - 1.0).abs() < 0.01, "{specular}: {found}, not {expected}");
    }
}

const EMISSION: f32 = 1.0;
const ALBEDO: f32 = 0.5;

/// Radiance of each pixel in a room of uniform radiance 1 with an object in it.
fn furnace_with(thing: Material, add: impl Fn(&mut Scene)) -> Vec<[f32; 3]> {
    let wall = Material { emission: Vec3::splat(EMISSION * (1.0 - ALBEDO)), ..lambertian("wall", ALBEDO) };
    let view = camera(Vec3::new(0.1, 0.05, 0.9), Vec3::new(-0.1, -0.05, -1.0));
    let mut scene = scene(room([0; 6]), vec![wall, thing], view);
    add(&mut scene);
    let settings = settings().with(|s| {
        s.picture.width = 48;
        s.picture.height = 48;
        s.integrator.samples = 8;
        s.integrator.gather_rays = 16;
        s.photons.count = 100_000;
    });
    radiances(&render_or_panic(&scene, &settings).film)
}

/// Checks that the object does not show: the mean of the picture, and of each block of 8x8 pixels, is 1.
fn does_not_show(all: &[[f32; 3]], tolerance: f64) {
    let error = mean(all) - 1.0;
    assert!(error.abs() < 0.4 * tolerance, "the mean is off by {error}");
    for block in 0..36 {
        let corner = block / 6 * 8 * 48 + block % 6 * 8;
        let pixels: Vec<[f32; 3]> = (0..64).map(|i| all[corner + i / 8 * 48 + i % 8]).collect();
        let error = mean(&pixels) - 1.0;
        assert!(error.abs() < tolerance, "block {block} is off by {error}");
    }
}

fn sheet(scene: &mut Scene) {
    let corner = |x: f32, y: f32| Vec3::new(0.5 * x, 0.5 * y, 0.1 * x);
    scene.triangles.extend(quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 1));
}

fn glass(roughness: f32, is_volume: bool) -> Material {
    let transmission = Transmission { factor: 1.0, ior: 1.5, is_volume, absorption: Vec3::ZERO };
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::ONE,
        metallic: 0.0,
        roughness,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: Some(transmission),
    };
    Material::new("glass", reflection)
}

/// Sunlight through a pane is a caustic on the floor. A coat on the floor takes its share of the light, and
/// each photon is stored once for both layers.
#[test]
fn a_caustic_below_a_coat_is_dimmed_by_the_coat() {
    let look = |floor: Material| {
        let square = |half: f32, y: f32, material: u32| {
            let corner = |x: f32, z: f32| Vec3::new(x * half, y, -z * half);
            quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], material)
        };
        let mut view = camera(Vec3::new(0.0, 0.3, 0.9), Vec3::new(0.0, -0.3, -0.9));
        view.projection = Projection::perspective(0.3);
        let triangles = [square(1.0, 0.0, 0), square(1.2, 0.5, 1)].concat();
        let sun = PunctualLight {
            name: "sun".to_owned(),
            kind: PunctualKind::Directional { direction: Vec3::NEG_Y, angle: 0.0 },
            intensity: Vec3::ONE,
            axes: LightAxes::default(),
        };
        let lit =
            scene(triangles, vec![floor, glass(0.0, false)], view).with(|scene| scene.lights = vec![sun]);
        shown(&lit)
    };
    let bare = look(dielectric(0.5, 0.0, none()));
    for roughness in [0.1_f32, 0.3, 0.6] {
        let share = look(dielectric(0.5, 0.0, coat(1.0, roughness))) / bare;
        assert!((0.7..1.0).contains(&share), "{roughness}: {share}");
    }
}

#[test]
fn a_white_leaf_is_invisible_in_a_furnace() {
    for factor in [0.5, 0.9] {
        does_not_show(&furnace_with(dielectric(1.0, 0.0, leaf(factor, 1.0)), sheet), 0.03);
    }
}

#[test]
fn rough_glass_is_invisible_in_a_furnace() {
    let ball = |scene: &mut Scene| add_ball(scene, Vec3::new(-0.2, -0.1, 0.0), 0.4, 24, 1);
    does_not_show(&furnace_with(glass(0.2, false), sheet), 0.03);
    does_not_show(&furnace_with(glass(0.1, true), ball), 0.04);
}

#[test]
fn a_coat_on_white_is_invisible_in_a_furnace() {
    does_not_show(&furnace_with(dielectric(1.0, 0.0, coat(1.0, 0.2)), sheet), 0.03);
    does_not_show(&furnace_with(dielectric(1.0, 0.0, sheen(0.8, 0.8)), sheet), 0.04);
}
