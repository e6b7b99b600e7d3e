//! Photons guided to a camera give the same mean of a picture as photons guided to the whole scene.

use glam::Vec3;
use photoncard_driver::photon_map::PhotonsFor;
use photoncard_driver::render::{CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{Material, Scene, Triangle};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, scene};

/// Cells (x, z) of a winding corridor 1 m wide, from its lit end to its dark end.
const CORRIDOR: [[i32; 2]; 10] =
    [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [3, 2], [4, 2], [4, 1], [4, 0], [5, 0]];

/// Corridor of [`CORRIDOR`] with a lamp on its first wall, seen from its dark end.
fn corridor(albedo: f32) -> Scene {
    let mut triangles: Vec<Triangle> = Vec::new();
    for [x, z] in CORRIDOR {
        let at = |dx: i32, y: i32, dz: i32| Vec3::new((x + dx) as f32, y as f32, (z + dz) as f32);
        triangles.extend(quad([at(0, 0, 1), at(1, 0, 1), at(1, 0, 0), at(0, 0, 0)], 0));
        triangles.extend(quad([at(0, 1, 0), at(1, 1, 0), at(1, 1, 1), at(0, 1, 1)], 0));
        let walls = [
            ([-1, 0], [at(0, 0, 1), at(0, 0, 0), at(0, 1, 0), at(0, 1, 1)]),
            ([1, 0], [at(1, 0, 0), at(1, 0, 1), at(1, 1, 1), at(1, 1, 0)]),
            ([0, -1], [at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0)]),
            ([0, 1], [at(1, 0, 1), at(0, 0, 1), at(0, 1, 1), at(1, 1, 1)]),
        ];
        for ([dx, dz], corners) in walls {
            if !CORRIDOR.contains(&[x + dx, z + dz]) {
                let is_lamp = [x, z] == CORRIDOR[0] && [dx, dz] == [-1, 0];
                triangles.extend(quad(corners, u32::from(is_lamp)));
            }
        }
    }
    let lamp = Material { emission: Vec3::splat(10.0), ..lambertian("lamp", albedo) };
    let view = camera(Vec3::new(5.9, 0.5, 0.5), Vec3::NEG_X);
    scene(triangles, vec![lambertian("wall", albedo), lamp], view)
}

/// Number of photons: so few that they are far apart at the dark end.
const PHOTONS: usize = 20_000;

fn settings(photons_for: PhotonsFor, seed: u32) -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 12, height: 12, ..Picture::default() },
        photons: PhotonMaps { count: PHOTONS, photons_for, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 16, samples: 4, seed, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:2".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

/// Mean over seeds of the pictures' means, and its standard error.
struct Pictures {
    mean: f64,
    error: f64,
}

impl Pictures {
    fn new(scene: &Scene, photons_for: PhotonsFor, seeds: u32) -> Self {
        let renders: Vec<_> =
            (0..seeds).map(|seed| render_or_panic(scene, &settings(photons_for, seed))).collect();
        let means: Vec<f64> = renders.iter().map(|render| mean(&radiances(&render.film))).collect();
        let count = f64::from(seeds);
        let mean = means.iter().sum::<f64>() / count;
        let squares: f64 = means.iter().map(|other| (other - mean).powi(2)).sum();
        let error = (squares / (count * (count - 1.0))).sqrt();
        Self { mean, error }
    }
}

/// At the dark end photons are so sparse that a gather of fifty would reach into the light around the corner.
#[test]
fn photons_for_the_scene_and_for_the_camera_give_a_dark_corridor_equal_means() {
    let scene = corridor(0.8);
    let of_scene = Pictures::new(&scene, PhotonsFor::Scene, 16);
    // A picture with photons for the camera takes several times as long, so that fewer of them are rendered.
    let of_camera = Pictures::new(&scene, PhotonsFor::Camera, 10);
    let error = of_scene.error.hypot(of_camera.error);
    println!("{} +- {}, {} +- {}", of_scene.mean, of_scene.error, of_camera.mean, of_camera.error);
    assert!(error < 0.25 * of_scene.mean, "an error of {error} in {}", of_scene.mean);
    assert!(
        (of_camera.mean - of_scene.mean).abs() < 3.0 * error,
        "{} +- {error}",
        of_camera.mean - of_scene.mean
    );
}
