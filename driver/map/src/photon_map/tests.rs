use glam::Vec3;
use photoncard_scene::{Environment, Scene, gltf};

use super::*;

fn shipped(name: &str) -> Scene {
    let path = format!("{}/../../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

/// The house under a uniform sky.
fn house() -> Scene {
    shipped("house.glb").with(|scene| scene.environment = Some(Environment::constant(Vec3::ONE)))
}

/// Settings of small maps, for the camera of a scene or for any camera.
fn settings(scene: &Scene, photons_for: PhotonsFor) -> PhotonSettings {
    PhotonSettings {
        camera: (photons_for == PhotonsFor::Camera).then(|| scene.cameras[0].of_frame(1, 1)),
        caustic_photons: 0,
        caustic_neighbors: 50,
        seed: 3,
        photons: 60_000,
        neighbors: 50,
        max_distance: None,
        layout: PhotonLayout::Lines,
        radiance: Radiance::Precomputed,
    }
}

#[test]
fn an_image_is_the_same_on_any_number_of_threads() {
    let (glossy, house) = (shipped("cornell-glossy.gltf"), house());
    for (scene, photons_for, layout) in [
        (&glossy, PhotonsFor::Scene, PhotonLayout::Lines),
        (&glossy, PhotonsFor::Scene, PhotonLayout::Jensen),
        (&house, PhotonsFor::Camera, PhotonLayout::Lines),
    ] {
        let settings = PhotonSettings { layout, ..settings(scene, photons_for) };
        let images = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let packed = PackedScene::new(scene).expect("packs");
            pool.install(|| map_photons(packed, &settings, &|_| true)).expect("maps").image
        });
        assert!(images.iter().all(|image| image.lines() == images[0].lines()), "{layout:?} {photons_for:?}");
    }
}

/// Number of photons inside the house, and their power on the floor and elsewhere, watts.
fn inside(packed: &PackedScene, settings: &PhotonSettings) -> (usize, [f64; 2]) {
    let photons = TracedPhotons::new(packed, settings, &|_| true).expect("the house is lit").photons;
    let is_inside =
        |position: Vec3| position.abs().cmple(Vec3::new(2.51, 2.61, 2.01)).all() && position.y > -0.01;
    let mut powers = [0.0; 2];
    let mut count = 0;
    for photon in photons.iter().filter(|photon| is_inside(photon.position.into())) {
        let power: f32 = photon.power.decode().into_iter().sum();
        powers[usize::from(photon.position[1] > 0.01)] += f64::from(power * photons.power_unit());
        count += 1;
    }
    (count, powers)
}

/// Means over seeds of the numbers and powers from [`inside`], and standard errors of the powers.
fn means(packed: &PackedScene, settings: PhotonSettings, seeds: u32) -> (f64, [[f64; 2]; 2]) {
    let all: Vec<_> = (0..seeds).map(|seed| inside(packed, &PhotonSettings { seed, ..settings })).collect();
    let seeds = f64::from(seeds);
    let count = all.iter().map(|(count, _)| *count as f64).sum::<f64>() / seeds;
    let powers = [0, 1].map(|part: usize| {
        let mean = all.iter().map(|(_, powers)| powers[part]).sum::<f64>() / seeds;
        let squares: f64 = all.iter().map(|(_, powers)| (powers[part] - mean).powi(2)).sum();
        [mean, (squares / (seeds * (seeds - 1.0))).sqrt()]
    });
    (count, powers)
}

#[test]
fn guided_photons_are_where_the_camera_uses_them_and_bring_equal_light() {
    let scene = house();
    let packed = PackedScene::new(&scene).expect("packs");
    let [of_scene, of_camera] =
        [PhotonsFor::Scene, PhotonsFor::Camera].map(|photons_for| settings(&scene, photons_for));
    let (few, expected) = means(&packed, PhotonSettings { photons: 500_000, ..of_scene }, 5);
    let (many, found) = means(&packed, of_camera, 16);
    let [few, many] = [few / 500_000.0, many / of_camera.photons as f64];
    assert!(many > 10.0 * few, "{many} of the photons, and {few}");
    for ([found, own], [expected, error]) in found.into_iter().zip(expected) {
        let error = own.hypot(error);
        println!("{found} W, expected {expected} W, +- {error} W");
        assert!(error < 0.05 * expected, "an error of {error} W of {expected} W");
        assert!((found - expected).abs() < 3.5 * error, "{found} W instead of {expected} W, +-{error} W");
    }
}
