//! Pictures against path-traced references, by the means of blocks.
//!
//! The references have 256x256 pixels and the renders 64x64: a block of 16x16 of the one is a block of 4x4 of the
//! other, as both have a box filter.

use std::path::PathBuf;

use photoncard_driver::exr::{RgbImage, read_rgb};
use photoncard_driver::film::Film;
use photoncard_driver::render::{Radiance, RenderSettings, Sampling};
use photoncard_driver::scene::gltf;
use photoncard_tests::render_or_panic;

/// Blocks along each side.
const BLOCKS: usize = 16;
/// Blocks whose reference exceeds this see the emitter, and are left out.
const EMITTER: f32 = 5.0;

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Mean of each block over pixels and channels, and the greatest channel in it.
fn blocks(pixels: &[[f32; 3]], side: usize) -> Vec<(f64, f32)> {
    let block = side / BLOCKS;
    let block_of = |index: usize| (index / side / block) * BLOCKS + (index % side) / block;
    let mut blocks = vec![(0.0, 0.0_f32); BLOCKS * BLOCKS];
    for (index, pixel) in pixels.iter().enumerate() {
        let (mean, greatest) = &mut blocks[block_of(index)];
        *mean += pixel.iter().map(|&c| c as f64).sum::<f64>() / (3 * block * block) as f64;
        *greatest = pixel.iter().fold(*greatest, |a, &b| a.max(b));
    }
    blocks
}

fn compare(film: &Film, reference: &RgbImage) {
    let image: Vec<[f32; 3]> = film.pixels().iter().map(|pixel| pixel.radiance).collect();
    let pairs: Vec<(f64, f64)> = blocks(&image, film.width() as usize)
        .into_iter()
        .zip(blocks(&reference.pixels, reference.width))
        .filter(|(_, (_, greatest))| *greatest <= EMITTER)
        .map(|((mean, _), (expected, _))| (mean, expected))
        .collect();
    assert!(pairs.len() > 240);
    let sums = pairs.iter().fold((0.0, 0.0), |(a, b), (mean, expected)| (a + mean, b + expected));
    let overall = sums.0 / sums.1 - 1.0;
    let mut errors: Vec<f64> = pairs.iter().map(|(mean, expected)| (mean / expected - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let [median, high] = [errors.len() / 2, errors.len() * 95 / 100].map(|place| errors[place]);
    assert!(overall.abs() < 0.01, "the overall mean is off by {overall}");
    assert!(median < 0.015, "the median block is off by {median}");
    assert!(high < 0.05, "the 95th percentile of the blocks is off by {high}");
}

/// Checks a scene as it is rendered by default, with all that saves gathers, and with precomputed irradiance.
fn check(scene: &str, reference: &str) {
    check_with(scene, reference, Sampling::Reflection, None, Radiance::Density);
    check_with(scene, reference, Sampling::Product, Some(0.025), Radiance::Density);
    check_with(scene, reference, Sampling::Product, None, Radiance::Precomputed);
}

fn check_with(
    scene: &str,
    reference: &str,
    sampling: Sampling,
    irradiance_error: Option<f32>,
    radiance: Radiance,
) {
    let scene = gltf::load(&path("../scenes").join(scene)).expect("a shipped scene loads");
    let settings = RenderSettings {
        width: 64,
        height: 64,
        photons: 300_000,
        gather_rays: if irradiance_error.is_some() { 256 } else { 32 },
        samples: 16,
        sampling,
        irradiance_error,
        radiance,
        cards: vec!["emulated:2".parse().unwrap()],
        ..RenderSettings::default()
    };
    let film = render_or_panic(&scene, &settings).film;
    compare(&film, &read_rgb(&path("references").join(reference)).expect("a shipped reference reads"));
}

#[test]
fn the_cornell_box_is_right() {
    check("cornell.gltf", "cornell.exr");
}

#[test]
fn the_glossy_cornell_box_is_right() {
    check("cornell-glossy.gltf", "cornell-glossy-032.exr");
}
