//! The photon pass: light is traced from the emitters and stored where it arrives.
//!
//! It depends on the scene, the seed and the number of photons alone, never on threads, camera, tile or chip. What a
//! gather needs to know beyond the photons, its greatest distance and the disc fractions, depends on the number of
//! neighbours as well.

mod ball;
mod chords;
mod disc;
mod emit;
mod error;
mod irradiance;
mod lane_vectors;
pub(crate) mod leaves;
pub(crate) mod map;
mod search;
mod shadows;
mod sides;
pub(crate) mod stored;
mod surroundings;
mod trace;

use std::time::{Duration, Instant};

pub use error::PhotonError;
pub use irradiance::precompute_irradiance;
pub(crate) use search::search_radius;
pub use stored::Photons;
pub use trace::{PhotonPass, trace, trace_caustics};

use photoncard_shared::message::{CausticGather, Radiance};

use self::disc::measure_discs;
use self::search::{automatic_max_distance, caustic_max_distance};
use crate::pack::{CardImage, PackedScene};

/// A gather looks at least so many cells of the grid far, so that the grid does not show.
const LEAST_CELLS: f32 = 8.0;

/// What a photon map is asked to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Seed of the photon paths.
    pub seed: u32,
    /// Photons to store.
    pub photons: usize,
    /// Photons that a gather will look for.
    pub neighbors: u32,
    /// Greatest distance of a gather, metres; `None` for the one that the photons' density suggests.
    pub max_distance: Option<f32>,
    /// Photons of caustics to store; 0 for no caustic map.
    pub caustic_photons: usize,
    /// Photons that a gather of caustics will look for.
    pub caustic_neighbors: u32,
    /// How the map is laid out.
    pub layout: PhotonLayout,
    /// What gathers tell radiance by: irradiance points are made if they ask for them.
    pub radiance: Radiance,
}

/// How the photon map is laid out in card memory. What a gather finds is the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PhotonLayout {
    /// The left-balanced kd-tree of Jensen (2001), of 20-byte records: the dissertation's.
    Jensen,
    /// Photons in leaves that fill a line of card memory each: smaller, and faster to search.
    #[default]
    Lines,
}

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
    /// How long it took.
    pub times: PhotonTimes,
}

/// How long each step of the photon pass took.
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

/// Traces photons in a packed scene and completes its image with their map. `progress` is told how many photons are
/// stored, and says whether to go on; it is asked again while the map is measured.
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
    let cell = photons.grid.cell;
    let mut image = packed.with_photons(photons, settings.neighbors)?;
    times.building = start.elapsed();
    let start = Instant::now();
    let max_distance = match settings.max_distance {
        // Farther than the scene is wide is as good as that wide.
        Some(distance) => distance.min(image.diagonal()),
        None => automatic_max_distance(&image, settings.neighbors)?,
    };
    if max_distance < LEAST_CELLS * cell {
        return Err(PhotonError::TooWide { cell, max_distance });
    }
    measure_discs(&mut image, settings.neighbors, max_distance, &|| progress(settings.photons))?;
    times.measuring = start.elapsed();
    if settings.layout == PhotonLayout::Jensen {
        let start = Instant::now();
        image = image.with_photon_tree()?;
        times.building += start.elapsed();
    }
    let mut caustics = None;
    if let Some(photons) = caustic {
        let start = Instant::now();
        image = image.with_caustics(photons, settings.caustic_neighbors)?;
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
