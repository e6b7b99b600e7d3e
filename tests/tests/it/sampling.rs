//! Pictures by every `--sampling` of gather rays converge to the same one.

use glam::{DVec3, Vec3};
use photoncard_driver::render::{PhotonMaps, Picture, RenderSettings, Sampling};
use photoncard_driver::scene::gltf;
use photoncard_tests::mapped::{IndirectLight, MappedScene};

/// Checks the mean over seeds of each sampling against 10,000 gather rays, within their standard errors.
fn check(scene: &str, camera: Option<&str>, assignments: &[&str]) {
    with_light_of(scene, camera, assignments, |light| {
        let reference = light.radiance(Sampling::Reflection, 10_000, 1);
        let reference: Vec<DVec3> = reference.into_iter().map(Vec3::as_dvec3).collect();
        for sampling in
            [Sampling::Reflection, Sampling::Photon, Sampling::Product, Sampling::Mixture, Sampling::Focused]
        {
            check_sampling(light, sampling, &reference);
        }
    });
}

/// Calls `check` with the indirect light at points that a camera of a shipped scene sees.
fn with_light_of(
    scene: &str,
    camera: Option<&str>,
    assignments: &[&str],
    check: impl FnOnce(&IndirectLight),
) {
    let path = format!("{}/../scenes/{scene}", env!("CARGO_MANIFEST_DIR"));
    let mut scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
    assignments.iter().for_each(|assignment| scene.apply(assignment).expect("a material of the scene"));
    let settings = RenderSettings {
        picture: Picture { camera: camera.map(Into::into), ..Picture::default() },
        photons: PhotonMaps { count: 50_000, neighbors: 50, ..PhotonMaps::default() },
        ..RenderSettings::default()
    };
    let mapped = MappedScene::new(scene, &settings);
    check(&IndirectLight::new(&mapped, &settings, 4));
}

fn check_sampling(light: &IndirectLight, sampling: Sampling, reference: &[DVec3]) {
    // With `photon`, rare rays have great weights: the variance over few seeds would be too low.
    const SEEDS: u32 = 120;
    const RAYS: u32 = 32;
    let runs: Vec<Vec<Vec3>> = (100..100 + SEEDS).map(|seed| light.radiance(sampling, RAYS, seed)).collect();
    let count = SEEDS as f64;
    let [mut worst, mut sum, mut sum_variance] = [0.0_f64; 3];
    for (point, expected) in reference.iter().enumerate() {
        let values = || runs.iter().map(|run| run[point].as_dvec3().element_sum());
        let mean = values().sum::<f64>() / count;
        let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0) / count;
        // Variance of the difference, if the reference's rays have the variance of the sampling's.
        let variance =
            variance * (1.0 + count * RAYS as f64 / 10_000.0) + (1e-4 * expected.element_sum()).powi(2);
        let deviation = mean - expected.element_sum();
        worst = worst.max(deviation.abs() / variance.sqrt());
        sum += deviation;
        sum_variance += variance;
    }
    let overall = sum / sum_variance.sqrt();
    assert!(overall.abs() < 3.0, "{sampling:?}: the mean of all points is off by {overall} standard errors");
    assert!(worst < 5.0, "{sampling:?}: a point is off by {worst} standard errors");
}

#[test]
fn indirect_light_of_the_cornell_box_is_equal_by_every_sampling() {
    check("cornell.gltf", None, &[]);
}

#[test]
fn indirect_light_from_a_spot_is_equal_by_every_sampling() {
    check("cornell-uplight.gltf", None, &[]);
}

#[test]
fn indirect_light_of_glossy_floors_is_equal_by_every_sampling() {
    for exponent in ["1", "8", "32", "128"] {
        check("cornell-glossy.gltf", Some("floor"), &[&format!("floor.exponent={exponent}")]);
    }
}

#[test]
fn indirect_light_of_the_atrium_is_equal_by_every_sampling() {
    check("atrium.glb", None, &[]);
}

#[test]
fn fewer_than_eight_rays_follow_the_reflection_by_every_sampling() {
    with_light_of("cornell-glossy.gltf", Some("floor"), &[], |light| {
        for sampling in [Sampling::Photon, Sampling::Product, Sampling::Mixture, Sampling::Focused] {
            let is_of_reflection =
                |rays| light.radiance(sampling, rays, 1) == light.radiance(Sampling::Reflection, rays, 1);
            assert_eq!([1, 7, 8].map(is_of_reflection), [true, true, false], "{sampling:?}");
        }
    });
}
