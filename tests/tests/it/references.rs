//! Pictures equal path-traced references in the means of blocks.
//!
//! The width of a render is a fourth of its reference's. As both have a box filter, a block of 4x4 pixels of
//! the render corresponds to one of 16x16 pixels of the reference.

use std::path::PathBuf;

use photoncard_driver::exr::{self, RgbImage, Shown};
use photoncard_driver::film::Film;
use photoncard_driver::render::{
    CardSet, Integrator, PhotonMaps, Picture, Radiance, RenderSettings, Sampling,
};
use photoncard_driver::scene::{Environment, gltf};
use photoncard_tests::render_or_panic;

/// Side of a block, in pixels of the reference.
const BLOCK: usize = 16;
/// Ratio of the reference's width to that of the render.
const SHRUNK: usize = 4;
/// Radiance above which a block of the reference counts as seeing an emitter, and is left out.
const EMITTER: f32 = 5.0;

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// For each block, mean over pixels and channels, and greatest channel.
fn blocks(pixels: &[[f32; 3]], width: usize, block: usize) -> Vec<(f64, f32)> {
    let across = width / block;
    let block_of = |index: usize| (index / width / block) * across + (index % width) / block;
    let mut blocks = vec![(0.0, 0.0_f32); pixels.len() / (block * block)];
    for (index, pixel) in pixels.iter().enumerate() {
        let (mean, greatest) = &mut blocks[block_of(index)];
        *mean += pixel.iter().map(|&c| c as f64).sum::<f64>() / (3 * block * block) as f64;
        *greatest = pixel.iter().fold(*greatest, |a, &b| a.max(b));
    }
    blocks
}

/// Checks the error of the picture's mean; and that the median and the 95th percentile of the blocks' errors
/// are at most `most`.
fn compare(film: &Film, reference: &RgbImage, most: [f64; 2]) {
    let image: Vec<[f32; 3]> = film.pixels().map(|pixel| pixel.radiance).collect();
    let pairs: Vec<(f64, f64)> = blocks(&image, film.width() as usize, BLOCK / SHRUNK)
        .into_iter()
        .zip(blocks(&reference.pixels, reference.width, BLOCK))
        .filter(|(_, (_, greatest))| *greatest <= EMITTER)
        .map(|((mean, _), (expected, _))| (mean, expected))
        .collect();
    assert!(pairs.len() * BLOCK * BLOCK > reference.pixels.len() * 8 / 10);
    let sums = pairs.iter().fold((0.0, 0.0), |(a, b), (mean, expected)| (a + mean, b + expected));
    let overall = sums.0 / sums.1 - 1.0;
    let mut errors: Vec<f64> = pairs.iter().map(|(mean, expected)| (mean / expected - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let [median, high] = [errors.len() / 2, errors.len() * 95 / 100].map(|place| errors[place]);
    assert!(overall.abs() < 0.01, "the overall mean is off by {overall}");
    println!("overall {overall:+.4}, median {median:.4}, 95th percentile {high:.4}");
    let [most_median, most_high] = most;
    assert!(median < most_median, "the median block is off by {median}");
    assert!(high < most_high, "the 95th percentile of the blocks is off by {high}");
}

/// Checks a scene without importance sampling of photons, with importance sampling and irradiance records,
/// with precomputed irradiance, and with gather rays that all go on.
fn check(scene: &str, reference: &str) {
    check_with(scene, reference, |s| s.integrator.sampling = Sampling::Reflection);
    check_with(scene, reference, |s| {
        (s.integrator.irradiance_error, s.integrator.gather_rays) = (Some(0.025), 256);
    });
    check_with(scene, reference, |s| s.photons.radiance = Radiance::Precomputed);
    check_with(scene, reference, |s| {
        (s.integrator.sampling, s.integrator.near_distance) = (Sampling::Reflection, Some(1e3));
    });
}

fn check_with(scene: &str, reference: &str, change: impl FnOnce(&mut RenderSettings)) {
    let scene = gltf::load(&path("../scenes").join(scene)).expect("a shipped scene loads");
    let settings = RenderSettings {
        picture: Picture { width: 64, height: 64, ..Picture::default() },
        photons: PhotonMaps { count: 150_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 32, samples: 8, ..Integrator::default() },
        cards: CardSet { addresses: vec!["emulated:2".parse().unwrap()], ..CardSet::default() },
        ..RenderSettings::default()
    };
    let film = render_or_panic(&scene, &settings.with(change)).film;
    compare(&film, &read(reference), [0.015, 0.05]);
}

fn read(reference: &str) -> RgbImage {
    exr::read(&path("references").join(reference), Shown::Rendered).expect("a shipped reference reads")
}

/// Checks a scene with mirrors, glass, textures or a sky, for a number of photons and of samples.
fn check_light_paths(scene: &str, reference: &str, environment: Option<&str>, numbers: [u32; 2]) {
    check_light_paths_with(scene, reference, environment, numbers, None);
}

fn check_light_paths_with(
    scene: &str,
    reference: &str,
    environment: Option<&str>,
    [photons, samples]: [u32; 2],
    near_distance: Option<f32>,
) {
    let mut scene = gltf::load(&path("../scenes").join(scene)).expect("a shipped scene loads");
    let file = environment.map(|file| path("../scenes").join(file));
    scene.environment = file.map(|file| Environment::load(&file).expect("a shipped sky loads"));
    let reference = read(reference);
    let settings = RenderSettings {
        picture: Picture {
            width: (reference.width / SHRUNK) as u32,
            height: (reference.height / SHRUNK) as u32,
            ..Picture::default()
        },
        photons: PhotonMaps { count: photons as usize, ..PhotonMaps::default() },
        integrator: Integrator {
            gather_rays: 8,
            shadow_rays: 2,
            samples,
            near_distance,
            ..Integrator::default()
        },
        cards: CardSet { addresses: vec!["emulated:2".parse().unwrap()], ..CardSet::default() },
        ..RenderSettings::default()
    };
    compare(&render_or_panic(&scene, &settings).film, &reference, [0.02, 0.06]);
}

#[test]
fn the_cornell_box_agrees_with_its_reference() {
    check("cornell.gltf", "cornell.exr");
}

#[test]
fn the_glossy_cornell_box_agrees_with_its_reference() {
    check("cornell-glossy.gltf", "cornell-glossy-032.exr");
}

#[test]
fn mirror_and_glass_balls_with_caustics_agree_with_their_reference() {
    check_light_paths("cornell-spheres.glb", "cornell-spheres.exr", None, [250_000, 32]);
}

#[test]
fn a_room_full_of_textures_agrees_with_its_reference() {
    check_light_paths("room.glb", "room.exr", None, [250_000, 32]);
}

#[test]
fn a_court_under_a_sky_agrees_with_its_reference() {
    check_light_paths("atrium-open.glb", "atrium-sky.exr", Some("sky.exr"), [500_000, 40]);
}

#[test]
fn scenes_agree_with_their_references_where_all_gather_rays_go_on() {
    let numbers = [100_000, 32];
    check_light_paths_with("cornell-spheres.glb", "cornell-spheres.exr", None, numbers, Some(1e3));
    check_light_paths_with("atrium-open.glb", "atrium-sky.exr", Some("sky.exr"), numbers, Some(1e3));
}
