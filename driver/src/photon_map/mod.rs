//! The photon map: photons, trees above them, caustics and irradiance points as sections of the card image.
//!
//! The module uses [`crate::pack`], which writes sections, [`crate::photon`], which traces photons, and `density`, which
//! measures the maximum distance of gathers and the disc fractions.

mod budget;
mod irradiance;
mod kd_tree;
mod leaves;
mod radius;
mod settings;
mod size;
mod store;

use std::time::{Duration, Instant};

use photoncard_shared::message::{CausticGather, Radiance};

pub use self::budget::{check_image, check_packed};
pub use self::irradiance::precompute_irradiance;
pub use self::kd_tree::to_kd_tree;
pub use self::settings::{PhotonLayout, PhotonSettings};
pub use self::size::PhotonMapSize;
use self::store::store_caustics;
pub use self::store::store_photons;
use crate::density::{automatic_max_distance, caustic_max_distance, measure_discs};
use crate::pack::{CardImage, PackedScene};
use crate::photon::{PhotonError, PhotonPass, Photons, trace, trace_caustics};

/// Lower bound of the maximum distance of a gather, in cells of the photon grid, so that the grid does not show.
const MIN_CELLS: f32 = 8.0;

/// Card image with its photon map, ready for gathers.
pub struct MappedImage {
    /// Card image.
    pub image: CardImage,
    /// Maximum distance of a gather, metres.
    pub max_distance: f32,
    /// Parameters of gathers in the caustic map; `None` without a caustic map.
    pub caustics: Option<CausticGather>,
    /// Number of paths traced from the lights.
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
    /// Measuring the maximum distance of gathers, and the disc fractions.
    pub measuring: Duration,
    /// Precomputing irradiance; zero without it.
    pub estimating: Duration,
}

/// Traces photons in a packed scene and completes its image with the photon map. `progress` is called with the number of
/// photons stored, also while the map is measured, and returns whether to go on.
///
/// # Errors
/// If hardly any path meets a surface, the image grows too large, or `progress` returns false.
pub fn map_photons(
    packed: PackedScene,
    settings: &PhotonSettings,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<MappedImage, PhotonError> {
    let start = Instant::now();
    let traced = TracedPhotons::new(&packed, settings, progress)?;
    let tracing = start.elapsed();
    let mut mapped = map_traced(packed, traced, settings, progress)?;
    mapped.times.tracing = tracing;
    Ok(mapped)
}

/// Photons of a scene, of both maps.
pub(crate) struct TracedPhotons {
    pub(crate) photons: Photons,
    /// Number of paths traced from the lights.
    pub(crate) paths: u64,
    /// Caustic photons, if requested and if any are found.
    pub(crate) caustic: Option<Photons>,
}

impl TracedPhotons {
    /// Traces photons in a packed scene.
    ///
    /// # Errors
    /// As [`map_photons`].
    pub(crate) fn new(
        packed: &PackedScene,
        settings: &PhotonSettings,
        progress: &(dyn Fn(usize) -> bool + Sync),
    ) -> Result<Self, PhotonError> {
        let PhotonPass { photons, paths, .. } = trace(packed, settings.seed, settings.photons, progress)?;
        Ok(Self { photons, paths, caustic: caustics(packed, settings, progress)? })
    }
}

/// Completes the image of a packed scene with its photons, as [`map_photons`].
pub(crate) fn map_traced(
    packed: PackedScene,
    traced: TracedPhotons,
    settings: &PhotonSettings,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<MappedImage, PhotonError> {
    let TracedPhotons { photons, paths, caustic } = traced;
    let mut times = PhotonTimes::default();
    let start = Instant::now();
    let cell = photons.grid().cell;
    let mut image = store_photons(packed, photons, settings.neighbors)?;
    times.building = start.elapsed();
    let start = Instant::now();
    let max_distance = match settings.max_distance {
        // A distance beyond the scene's diagonal has no further effect.
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

/// Caustic photons, if requested and if any are found. Without a caustic map gather rays carry the light of caustics.
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
