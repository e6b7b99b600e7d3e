//! The photon map: photons, trees above them, caustics and irradiance points as sections of the card image.
//!
//! It stands above what it joins: [`crate::pack`] writes sections, [`crate::photon`] traces photons, and `density`
//! measures what a gather on the chip knows beyond them, its greatest distance and the disc fractions.

mod budget;
mod irradiance;
mod kd_tree;
mod leaves;
mod radius;
mod settings;
mod store;

use std::time::{Duration, Instant};

use photoncard_shared::message::{CausticGather, Radiance};

pub use self::budget::{check_image, check_packed};
pub use self::irradiance::precompute_irradiance;
pub use self::kd_tree::to_kd_tree;
pub use self::settings::{PhotonLayout, PhotonSettings};
use self::store::store_caustics;
pub use self::store::store_photons;
use crate::density::{automatic_max_distance, caustic_max_distance, measure_discs};
use crate::pack::{CardImage, PackedScene};
use crate::photon::{PhotonError, PhotonPass, Photons, trace, trace_caustics};

/// Smallest greatest distance of a gather, cells of the photon grid: so that the grid does not show.
const MIN_CELLS: f32 = 8.0;

/// A card image with its photon map, ready for gathers.
pub struct MappedImage {
    /// The image.
    pub image: CardImage,
    /// Greatest distance of a gather, metres.
    pub max_distance: f32,
    /// The gathers of caustics, if there is a map of them.
    pub caustics: Option<CausticGather>,
    /// Paths that were traced from the lights.
    pub paths: u64,
    /// Time of each step.
    pub times: PhotonTimes,
}

/// Time of each step of the photon pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PhotonTimes {
    /// Tracing photons.
    pub tracing: Duration,
    /// Building the tree and writing its lines.
    pub building: Duration,
    /// Measuring how far gathers look, and the disc fractions.
    pub measuring: Duration,
    /// Estimating irradiance at photons, if it is precomputed.
    pub estimating: Duration,
}

/// Traces photons in a packed scene and completes its image with their map. `progress` gets the number of photons
/// stored, and returns whether to go on; it is asked again while the map is measured.
///
/// # Errors
/// If hardly any path meets a surface, the image grows too large, or `progress` says to stop.
pub fn map_photons(
    packed: PackedScene,
    settings: &PhotonSettings,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<MappedImage, PhotonError> {
    let mut times = PhotonTimes::default();
    let start = Instant::now();
    let PhotonPass { photons, paths } = trace(&packed, settings.seed, settings.photons, progress)?;
    let caustic = caustics(&packed, settings, progress)?;
    times.tracing = start.elapsed();
    let start = Instant::now();
    let cell = photons.grid().cell;
    let mut image = store_photons(packed, photons, settings.neighbors)?;
    times.building = start.elapsed();
    let start = Instant::now();
    let max_distance = match settings.max_distance {
        // Farther than the scene is wide is as good as that wide.
        Some(distance) => distance.min(image.diagonal()),
        None => automatic_max_distance(&image, settings.neighbors)?,
    };
    if max_distance < MIN_CELLS * cell {
        return Err(PhotonError::TooWide { cell, max_distance });
    }
    measure_discs(&mut image, settings.neighbors, max_distance, &|| progress(settings.photons))?;
    times.measuring = start.elapsed();
    if settings.layout == PhotonLayout::Jensen {
        let start = Instant::now();
        image = to_kd_tree(image)?;
        times.building += start.elapsed();
    }
    let mut caustics = None;
    if let Some(photons) = caustic {
        let start = Instant::now();
        image = store_caustics(image, photons, settings.caustic_neighbors)?;
        let max_distance = caustic_max_distance(&image, settings.caustic_neighbors)?;
        caustics = Some(CausticGather { neighbors: settings.caustic_neighbors, max_distance });
        times.building += start.elapsed();
    }
    if settings.radiance == Radiance::Precomputed {
        let start = Instant::now();
        let go_on = || progress(settings.photons);
        image = precompute_irradiance(image, settings.neighbors, max_distance, &go_on)?;
        times.estimating = start.elapsed();
    }
    Ok(MappedImage { image, max_distance, caustics, paths, times })
}

/// The photons of caustics, if any are asked for and there are any: without a map of them gather rays bring their light.
fn caustics(
    packed: &PackedScene,
    settings: &PhotonSettings,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<Option<Photons>, PhotonError> {
    if settings.caustic_photons == 0 {
        return Ok(None);
    }
    let go_on = || progress(settings.photons);
    let photons = trace_caustics(packed, settings.seed, settings.caustic_photons, &go_on)?;
    Ok((!photons.is_empty()).then_some(photons))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::gltf;

    #[test]
    fn an_image_is_the_same_on_any_number_of_threads() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-glossy.gltf");
        let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
        for layout in [PhotonLayout::Lines, PhotonLayout::Jensen] {
            let settings = PhotonSettings {
                caustic_photons: 0,
                caustic_neighbors: 50,
                seed: 3,
                photons: 60_000,
                neighbors: 50,
                max_distance: None,
                layout,
                radiance: Radiance::Precomputed,
            };
            let images = [1, 2, 5].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                let packed = PackedScene::new(&scene).expect("packs");
                pool.install(|| map_photons(packed, &settings, &|_| true)).expect("maps").image
            });
            assert!(images.iter().all(|image| image.lines() == images[0].lines()), "{layout:?}");
        }
    }
}
