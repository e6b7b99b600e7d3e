//! Gather rays that end near their point go on: light in a gap narrower than a gather's radius.

use glam::Vec3;
use photoncard_driver::render::measure::{Meter, Point};
use photoncard_driver::render::{Integrator, PhotonMaps, RenderSettings, Unobserved};
use photoncard_driver::scene::{Material, Scene};
use photoncard_tests::shapes::cuboid;
use photoncard_tests::{camera, lambertian, quad, room, scene};

/// Width of the gap between the wall x = -1 and a cupboard, metres.
const GAP: f32 = 0.04;

/// Room with a lamp below the ceiling, and a cupboard before the wall x = -1.
fn cupboard() -> Scene {
    let mut triangles = room([0; 6]);
    let half = Vec3::new(0.1, 0.75, 0.6);
    triangles.extend(cuboid(Vec3::new(GAP - 1.0 + half.x, half.y - 1.0, 0.0), half, 0));
    let corner = |x: f32, z: f32| Vec3::new(0.3 * x, 0.98, 0.3 * z);
    triangles.extend(quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 1));
    let lamp = Material { emission: Vec3::splat(20.0), ..lambertian("lamp", 0.0) };
    scene(triangles, vec![lambertian("wall", 0.7), lamp], camera(Vec3::new(0.9, 0.0, 0.0), Vec3::NEG_X))
}

/// Irradiance on the wall behind the cupboard, W/m^2, at points of increasing depth below its upper edge.
fn behind(near_distance: Option<f32>, samples: u32) -> Vec<f64> {
    let scene = cupboard();
    let settings = RenderSettings {
        photons: PhotonMaps { count: 200_000, ..PhotonMaps::default() },
        integrator: Integrator { samples, gather_rays: 64, near_distance, ..Integrator::default() },
        ..RenderSettings::default()
    };
    let at = |depth: f64| Point { position: [-0.999, 0.5 - depth, 0.1], normal: [1.0, 0.0, 0.0] };
    let points = [0.05, 0.1, 0.2, 0.3].map(at);
    let mut meter = Meter::new(&scene, &settings, [1.0 / 3.0; 3]);
    let readings = meter.measure(0, &points, &Unobserved).unwrap_or_else(|error| panic!("{error}"));
    readings.iter().map(|reading| reading.irradiance().iter().sum::<f64>() / 3.0).collect()
}

#[test]
fn a_gap_behind_a_cupboard_is_as_dark_as_paths_find_it() {
    let by_paths = behind(Some(1e3), 128);
    let leaky = behind(Some(0.0), 16);
    let found = behind(None, 32);
    assert!(by_paths.is_sorted_by(|shallow, deep| deep < shallow), "{by_paths:?}");
    for (index, expected) in by_paths.iter().enumerate() {
        let error = (found[index] - expected).abs();
        assert!(error < 0.02 * expected + 0.01 * by_paths[0], "{} for {expected}", found[index]);
    }
    let leak = |depth: usize| leaky[depth] - by_paths[depth];
    assert!(leak(1) > 0.05 * by_paths[0] && leak(2) > 0.05 * by_paths[0], "without near ends {leaky:?}");
}
