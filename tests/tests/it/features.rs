//! Features for a denoiser: albedo and normal of a pixel are those of what mirrors, glass and sharp lobes
//! show.

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use glam::{Vec3, Vec4};
use photoncard_driver::denoise::{DenoiseError, Denoiser};
use photoncard_driver::film::Film;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{
    Camera, Coat, Encoding, Environment, Image, Layers, Material, NormalMap, Projection, Reflection, Scene,
    Texture, Triangle,
};
use photoncard_tests::shapes::{add_tangents, add_textured_quad};
use photoncard_tests::{camera, glass, lambertian, mean, quad, render_or_panic, room, scene, skip};

use super::specular::mirror;

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 24, height: 24, ..Picture::default() },
        photons: PhotonMaps { count: 2_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 1, samples: 64, ..Integrator::default() },
        ..RenderSettings::default()
    }
}

fn film(scene: &Scene) -> Film {
    render_or_panic(scene, &settings()).film
}

fn albedos(film: &Film) -> Vec<[f32; 3]> {
    film.pixels().map(|pixel| pixel.albedo).collect()
}

fn normals(film: &Film) -> Vec<[f32; 3]> {
    film.pixels().map(|pixel| pixel.normal).collect()
}

fn greatest_difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Metal of this reflectance at normal incidence, with a GGX lobe.
fn metal(reflectance: f32, roughness: f32) -> Material {
    let mut metal = mirror(reflectance);
    if let Reflection::MetallicRoughness { roughness: of_metal, .. } = &mut metal.reflection {
        *of_metal = roughness;
    }
    metal
}

/// Room with a striped floor and an emissive ceiling. Its wall at z = -1 has the material `wall`; the room is
/// open there if `None`.
fn room_before(wall: Option<Material>, view: Camera) -> Scene {
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.4) };
    let floor = Material { base_texture: Some(0), ..lambertian("floor", 0.9) };
    let is_open = wall.is_none();
    let materials = vec![lambertian("side", 0.3), lamp, wall.unwrap_or_else(|| mirror(1.0)), floor];
    let is_at =
        |triangle: &Triangle, axis: usize| triangle.vertices.iter().all(|vertex| vertex[axis] == -1.0);
    let mut triangles = room([0, 0, 0, 1, 2, 0]);
    triangles.retain(|triangle| !(is_at(triangle, 1) || is_open && is_at(triangle, 2)));
    let mut scene = scene(triangles, materials, view);
    let corner = |x: f32, z: f32| Vec3::new(x, -1.0, z);
    let corners = [corner(-1., 1.), corner(1., 1.), corner(1., -1.), corner(-1., -1.)];
    add_textured_quad(&mut scene, corners, [[0., 0.], [4., 0.], [4., 4.], [0., 4.]], 3);
    let texels = vec![[255, 40, 90, 255], [30, 200, 160, 255]];
    let encoding = Encoding::Srgb;
    scene.images.push(Image { name: "stripes".into(), width: 2, height: 1, texels, encoding });
    scene.textures.push(Texture::new(0));
    scene
}

/// A camera, and its mirror image in the plane z = -1.
fn both_cameras() -> [Camera; 2] {
    let view = camera(Vec3::new(0.1, 0.2, 0.4), Vec3::new(-0.1, -0.25, -1.0));
    let view = Camera { projection: Projection::perspective(0.6), ..view };
    let turned = |vector: Vec3| Vec3::new(vector.x, vector.y, -vector.z);
    let [origin, right, up, forward] = [view.origin, view.right, view.up, view.forward].map(turned);
    let image = Camera { origin: origin - 2.0 * Vec3::Z, right, up, forward, ..view.clone() };
    [view, image]
}

#[test]
fn a_mirror_has_the_albedo_and_the_normals_of_what_it_shows() {
    let [view, image] = both_cameras();
    let [seen, direct] = [film(&room_before(Some(mirror(0.8)), view)), film(&room_before(None, image))];
    let expected: Vec<[f32; 3]> =
        albedos(&direct).into_iter().map(|albedo| albedo.map(|a| 0.8 * a)).collect();
    let difference = greatest_difference(&albedos(&seen), &expected);
    assert!(difference < 2e-3, "{difference}");
    let difference = greatest_difference(&normals(&seen), &normals(&direct));
    assert!(difference < 2e-3, "{difference}");
    let reds = || expected.iter().map(|albedo| albedo[0]);
    assert!(reds().fold(0.0, f32::max) > 2.0 * reds().fold(1.0, f32::min), "the floor is seen");
}

#[test]
fn polished_metal_has_the_albedo_of_what_it_shows_and_rough_metal_its_own() {
    let [view, image] = both_cameras();
    let direct = film(&room_before(None, image));
    let seen = film(&room_before(Some(metal(0.8, 0.05)), view.clone()));
    let [seen_mean, direct_mean] = [&seen, &direct].map(|film| mean(&albedos(film)));
    assert!((seen_mean / (0.8 * direct_mean) - 1.0).abs() < 0.02, "{seen_mean} {direct_mean}");
    let [seen_up, direct_up] =
        [&seen, &direct].map(|film| film.pixels().map(|pixel| pixel.normal[1]).sum::<f32>());
    assert!((seen_up / direct_up - 1.0).abs() < 0.02, "{seen_up} {direct_up}");
    let rough = film(&room_before(Some(metal(0.8, 0.4)), view));
    assert!(rough.pixels().all(|pixel| pixel.albedo[0] > 0.6 && pixel.normal[2] > 0.99));
}

/// Plastic with layers and a base of 0.8.
fn plastic(roughness: f32, layers: Layers) -> Material {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(0.8),
        metallic: 0.0,
        roughness,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    Material { layers: Some(Box::new(layers)), ..Material::new("plastic", reflection) }
}

/// The wall of [`room_before`] with a texture, whose only texel is a normal 20 degrees off the wall's.
fn room_before_bumps(wall: Material, view: Camera) -> Scene {
    let mut scene = room_before(None, view);
    scene.materials[2] = wall;
    let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| Vec3::new(x, y, -1.0));
    add_textured_quad(&mut scene, corners, [[0., 1.], [1., 1.], [1., 0.], [0., 0.]], 2);
    add_tangents(&mut scene, 2, Vec4::new(1.0, 0.0, 0.0, 1.0));
    let (name, encoding) = ("bumps".into(), Encoding::Linear);
    scene.images.push(Image { name, width: 1, height: 1, texels: vec![[171, 128, 247, 255]], encoding });
    scene.textures.push(Texture::new(1));
    scene
}

#[test]
fn coats_and_bumps_of_plastic_leave_the_features_of_the_plastic() {
    let [view, _] = both_cameras();
    let none = || Layers::none(Vec3::splat(0.04));
    let coat =
        Coat { factor: 1.0, roughness: 0.1, factor_texture: None, roughness_texture: None, normal: None };
    let coated = plastic(0.9, Layers { coat: Some(coat), ..none() });
    let bumpy = plastic(0.2, Layers { normal: Some(NormalMap { texture: 1, scale: 1.0 }), ..none() });
    let coated = film(&room_before(Some(coated), view.clone()));
    let bumpy = film(&room_before_bumps(bumpy, view));
    for (film, least) in [(coated, 0.999), (bumpy, 0.93)] {
        assert!(film.pixels().all(|pixel| pixel.normal[2] > least && pixel.albedo[0] > 0.6));
    }
}

/// A denoiser must not take what mirrors and glass show of the sky for the sky itself.
#[test]
fn the_sky_in_a_mirror_has_the_depth_of_the_mirror() {
    let corner = |x: f32, y: f32| Vec3::new(x, y, -2.0);
    let pane = quad([corner(-0.2, -0.2), corner(0.2, -0.2), corner(0.2, 0.2), corner(-0.2, 0.2)], 0);
    for material in [mirror(1.0), glass("pane", Vec3::ONE, false)] {
        let view = camera(Vec3::ZERO, Vec3::NEG_Z);
        let mut scene = scene(pane.to_vec(), vec![material], view);
        scene.environment = Some(Environment::constant(Vec3::ONE));
        let film = film(&scene);
        let [middle, corner] =
            [film.pixel(12, 12), film.pixel(0, 0)].map(|pixel| pixel.expect("a pixel").depth);
        assert!((middle - 2.0).abs() < 0.01 && corner == f32::INFINITY, "{middle} {corner}");
    }
}

#[test]
fn a_denoiser_stops_soon_after_it_is_told_to() {
    let denoiser = match Denoiser::find() {
        Ok(denoiser) => denoiser,
        Err(error) => return skip(&format!("a stopped denoiser: {error}")),
    };
    let [view, _] = both_cameras();
    let film = film(&room_before(None, view));
    let asked = AtomicU32::new(0);
    let stops_at = |call: u32| {
        asked.store(0, Relaxed);
        denoiser.radiance(&film, Some(1), &|| asked.fetch_add(1, Relaxed) >= call)
    };
    assert!(stops_at(u32::MAX).is_ok());
    let all = asked.load(Relaxed);
    assert!(all > 6, "the denoiser asks within its filters, too: {all}");
    for call in [0, 1, all / 2] {
        assert!(matches!(stops_at(call), Err(DenoiseError::Stopped)));
        assert!(asked.load(Relaxed) < all);
    }
}

/// Reflectance of a thin wall of glass at normal incidence, with interreflection of its faces: 2R / (1 + R),
/// R = 0.04.
const THIN_WALL: f32 = 2.0 * 0.04 / 1.04;

#[test]
fn a_pane_has_the_albedo_behind_it_times_its_tint_and_that_of_its_reflection() {
    let pane = |z: f32| {
        let corner = |x: f32, y: f32| Vec3::new(x, y, z);
        quad([corner(-0.9, -0.9), corner(0.9, -0.9), corner(0.9, 0.9), corner(-0.9, 0.9)], 1)
    };
    let wall = Material { emission: Vec3::splat(0.5), ..lambertian("wall", 0.5) };
    let materials = vec![wall, glass("pane", Vec3::new(1.0, 0.5, 0.2), false)];
    let view = Camera { projection: Projection::perspective(0.1), ..camera(Vec3::ZERO, -Vec3::Z) };
    let triangles = [&room([0; 6])[..], &pane(-0.5)].concat();
    let all = albedos(&film(&scene(triangles, materials, view)));
    for (channel, tint) in [1.0, 0.5, 0.2].into_iter().enumerate() {
        let seen = all.iter().map(|albedo| albedo[channel]).sum::<f32>() / all.len() as f32;
        let expected = 0.5 * (THIN_WALL + (1.0 - THIN_WALL) * tint);
        assert!((seen / expected - 1.0).abs() < 0.01, "{channel}: {seen}, not {expected}");
    }
}

#[test]
fn rooms_of_mirrors_and_of_polished_metal_have_features_in_range() {
    let settings = settings().with(|s| {
        (s.picture.width, s.picture.height) = (8, 8);
        (s.photons.count, s.integrator.samples) = (200, 2);
    });
    for wall in [mirror(1.0), metal(1.0, 0.1)] {
        let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
        let corner = |x: f32, z: f32| Vec3::new(x, 0.9, z);
        let lamp_face = quad([corner(0., 0.), corner(0., 0.1), corner(0.1, 0.1), corner(0.1, 0.)], 1);
        let triangles = [&room([0; 6])[..], &lamp_face].concat();
        let view = camera(Vec3::new(0.1, 0.05, 0.9), Vec3::new(-0.1, -0.05, -1.0));
        let scene = scene(triangles, vec![wall, lamp], view);
        for pixel in render_or_panic(&scene, &settings).film.pixels() {
            assert!(pixel.albedo.into_iter().all(|albedo| (0.0..=1.0).contains(&albedo)), "{pixel:?}");
            assert!(Vec3::from(pixel.normal).length() < 1.001, "{pixel:?}");
        }
    }
}
