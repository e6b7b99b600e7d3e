//! Caustics of few photons: sparse light beside a dense patch.

use glam::Vec3;
use photoncard_driver::render::{CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{Material, PunctualKind, PunctualLight, Reflection, Scene, Transmission};
use photoncard_tests::shapes::{add_ball, cuboid};
use photoncard_tests::{camera, lambertian, mean, radiances, render_or_panic, room, scene};

fn smooth(name: &str, metallic: f32, transmission: Option<Transmission>) -> Material {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::ONE,
        metallic,
        roughness: 0.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission,
    };
    Material::new(name, reflection)
}

/// Room with a light above two balls. A glass one focuses it on the floor, and a metal one scatters it over
/// the walls. The camera sees a part of the ceiling.
fn two_balls() -> Scene {
    let glass = Transmission { factor: 1.0, ior: 1.5, is_volume: true, absorption: Vec3::ZERO };
    let materials =
        vec![lambertian("wall", 0.5), smooth("glass", 0.0, Some(glass)), smooth("metal", 1.0, None)];
    let mut view = camera(Vec3::new(0.1, -0.7, 0.1), Vec3::new(0.3, 1.0, 0.2));
    view.vertical_fov = 0.6;
    let mut scene = scene(room([0; 6]), materials, view);
    add_ball(&mut scene, Vec3::new(-0.5, -0.6, 0.0), 0.3, 24, 1);
    add_ball(&mut scene, Vec3::new(0.55, -0.75, 0.1), 0.15, 24, 2);
    let kind = PunctualKind::Point { position: Vec3::new(0.0, 0.6, 0.0) };
    scene.lights.push(PunctualLight { name: "light".into(), kind, intensity: Vec3::ONE });
    scene
}

/// Radiance of each pixel of a picture with caustics only.
fn caustics(scene: &Scene, photons: usize, seed: u32) -> Vec<[f32; 3]> {
    let settings = RenderSettings {
        picture: Picture { width: 24, height: 24, ..Picture::default() },
        photons: PhotonMaps { count: 1000, caustic_photons: Some(photons), ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 0, shadow_rays: 0, samples: 4, seed, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:2".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    };
    radiances(&render_or_panic(scene, &settings).film)
}

#[test]
fn sparse_light_beside_a_focus_is_smooth_with_the_mean_of_many_photons() {
    let scene = two_balls();
    let [first, second] = [1, 2].map(|seed| caustics(&scene, 20_000, seed));
    let expected = mean(&caustics(&scene, 500_000, 3));
    assert!(expected > 0.0);
    let found = 0.5 * (mean(&first) + mean(&second));
    assert!((found / expected - 1.0).abs() < 0.06, "{found} instead of {expected}");
    let squares =
        first.as_flattened().iter().zip(second.as_flattened()).map(|(a, b)| f64::from(a - b).powi(2));
    let deviation = (0.5 * squares.sum::<f64>() / (3 * first.len()) as f64).sqrt() / expected;
    assert!(deviation < 0.25, "a deviation of {deviation}");
}

/// Room with a lamp above a mirror that lies at the foot of a wall, in the gap behind a board or without the
/// board. The camera sees the board, or the wall behind it.
fn mirror_behind_a_board(has_board: bool) -> Scene {
    let materials = vec![lambertian("wall", 0.5), smooth("metal", 1.0, None)];
    let mut triangles = room([0; 6]);
    triangles.extend(cuboid(Vec3::new(-0.93, -0.95, 0.0), Vec3::new(0.05, 0.02, 0.9), 1));
    if has_board {
        triangles.extend(cuboid(Vec3::new(-0.85, 0.0, 0.0), Vec3::new(0.02, 0.9, 0.95), 0));
    }
    let mut view = camera(Vec3::new(0.5, 0.0, 0.0), Vec3::NEG_X);
    view.vertical_fov = 0.6;
    let mut scene = scene(triangles, materials, view);
    let kind = PunctualKind::Point { position: Vec3::new(-0.93, 0.96, 0.2) };
    scene.lights.push(PunctualLight { name: "lamp".into(), kind, intensity: Vec3::ONE });
    scene
}

#[test]
fn a_board_is_not_lit_by_a_caustic_on_the_wall_behind_it() {
    let [on_board, on_wall] =
        [true, false].map(|has_board| mean(&caustics(&mirror_behind_a_board(has_board), 2_000, 1)));
    assert!(on_wall > 0.0);
    assert!(on_board < 0.01 * on_wall, "{on_board} beside {on_wall}");
}
