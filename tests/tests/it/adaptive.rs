//! Adaptive sampling lowers the noise where samples differ, and keeps the picture's expected value.

use photoncard_driver::render::{Filter, Integrator, PhotonMaps, Picture, RenderSettings, Rendering};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_tests::render_or_panic;

/// Samples per pixel: four probes, and one sample whose number of paths the probes choose.
const SAMPLES: u32 = 5;

fn room() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf");
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

fn settings(seed: u32, adaptive_threshold: Option<f32>, gather_rays: u32) -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 12, height: 12, filter: Filter::Box, ..Picture::default() },
        photons: PhotonMaps { count: 100, ..PhotonMaps::default() },
        integrator: Integrator {
            seed,
            samples: SAMPLES,
            gather_rays,
            shadow_rays: 1,
            adaptive_threshold,
            ..Integrator::default()
        },
        ..RenderSettings::default()
    }
}

/// Over `seeds` renders: mean of the pictures' means, its standard error, and mean over pixels of their
/// variance.
fn moments(threshold: Option<f32>, gather_rays: u32, seeds: u32) -> [f64; 3] {
    let scene = room();
    let radiances = |seed| -> Vec<f64> {
        let Rendering { film, .. } = render_or_panic(&scene, &settings(seed, threshold, gather_rays));
        film.pixels()
            .map(|pixel| pixel.radiance.iter().map(|&light| f64::from(light)).sum::<f64>() / 3.0)
            .collect()
    };
    let pictures: Vec<Vec<f64>> = (0..seeds).map(radiances).collect();
    let seeds = f64::from(seeds);
    let [_, mean, variance_of_mean] = mean_and_variance(
        &pictures.iter().map(|pixels| pixels.iter().sum::<f64>() / pixels.len() as f64).collect::<Vec<_>>(),
    );
    let pixels = pictures[0].len();
    let variance = (0..pixels)
        .map(|pixel| mean_and_variance(&pictures.iter().map(|pixels| pixels[pixel]).collect::<Vec<_>>())[2])
        .sum::<f64>()
        / pixels as f64;
    [mean, (variance_of_mean / seeds).sqrt(), variance]
}

/// Number, mean and variance of values.
fn mean_and_variance(values: &[f64]) -> [f64; 3] {
    let number = values.len() as f64;
    let mean = values.iter().sum::<f64>() / number;
    [number, mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (number - 1.0)]
}

/// Checks that two means differ by less than four standard errors, and that four standard errors are less
/// than 8 % of the mean.
fn check_means([even, even_error, _]: [f64; 3], [adaptive, error, _]: [f64; 3]) {
    let allowed = 4.0 * even_error.hypot(error);
    assert!((adaptive - even).abs() < allowed, "{adaptive} beside {even}, {allowed} allowed");
    assert!(allowed < 0.08 * even, "the comparison tells little apart: {allowed} of {even}");
}

/// Most pixels see an edge of the lamp, of a box or of a shadow. A plain mean over all paths would be too
/// dark: bright probes add more paths, and so would weigh less in it.
#[test]
fn adaptive_sampling_changes_the_noise_and_not_the_mean() {
    let [even, adaptive] = [None, Some(0.02)].map(|threshold| moments(threshold, 0, 84));
    check_means(even, adaptive);
    let [even_variance, variance] = [even[2], adaptive[2]];
    assert!(variance < 0.75 * even_variance, "{variance} of {even_variance}");
}

/// On a Lambertian surface, the paths of a sample share the sample's sixteen gather rays; each path has at
/// least one.
#[test]
fn paths_that_share_gather_rays_have_the_mean_of_samples_with_rays_of_their_own() {
    check_means(moments(None, 16, 54), moments(Some(0.005), 16, 54));
}

/// More paths per sample do not cast more gather rays on Lambertian surfaces, except that each path has at
/// least one.
#[test]
fn paths_divide_the_gather_rays_of_their_sample() {
    let scene = room();
    let rays = |threshold| render_or_panic(&scene, &settings(1, threshold, 16)).statistics.rays;
    let [even, adaptive] = [None, Some(0.02)].map(rays);
    assert!(adaptive.eye > 2 * even.eye, "{adaptive:?} {even:?}");
    assert!(adaptive.gather < even.gather * 5 / 4, "{adaptive:?} {even:?}");
}

/// In a furnace all probes have equal light, so that further samples have one path.
#[test]
fn pixels_without_noise_have_one_path_a_sample() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/furnace.gltf");
    let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
    let settings = settings(0, Some(0.1), 0).with(|s| s.integrator.shadow_rays = 0);
    let rendering = render_or_panic(&scene, &settings);
    assert_eq!(rendering.statistics.rays.eye, 12 * 12 * u64::from(SAMPLES));
}
