//! Photon map: writes photons, the trees above them, caustics and irradiance points as sections of the card
//! image.
//!
//! This module uses [`crate::pack`], which writes sections, [`crate::photon`], which traces photons, and
//! `density`, which measures the maximum distance of gathers and the disc fractions.

mod budget;
mod irradiance;
mod kd_tree;
mod kernels;
mod leaves;
mod neighbors;
mod outliers;
mod radius;
mod settings;
mod size;
mod store;
#[cfg(test)]
mod tests;

use std::time::{Duration, Instant};

use photoncard_shared::layout::Photon;
use photoncard_shared::message::{Camera, CausticGather, Radiance};
use serde::{Deserialize, Serialize};

pub use self::budget::{check_image, check_packed};
pub use self::irradiance::precompute_irradiance;
pub use self::kd_tree::to_kd_tree;
pub use self::settings::{PhotonLayout, PhotonSettings, PhotonsFor};
pub use self::size::PhotonMapSize;
use self::store::store_caustics;
pub use self::store::store_photons;
use crate::density::{GatherDistances, SampledDistances, measure_discs};
use crate::pack::{CardImage, PackedScene};
pub use crate::photon::Guiding;
use crate::photon::{
    ImportonGrid, Importons, PhotonError, PhotonPass, Photons, trace_caustics_for, trace_for,
};

/// Lower bound of the maximum distance of a gather, in cells of the photon grid, so that the grid is not
/// visible.
const MIN_CELLS: f32 = 8.0;

/// Length of the gather rays that go on, divided by the usual radius of a gather. In a gap that is narrower
/// than this radius, few rays are longer, and photons from outside the gap light their ends.
const NEAR: f32 = 4.0;
/// Diagonal of the scene divided by the maximum length of the gather rays that go on. Where photons are
/// sparse, most rays would go on without this limit.
const DIAGONAL_OVER_NEAR: f32 = 16.0;

/// Card image with its photon map, ready for gathers.
pub struct MappedImage {
    /// Card image with the photon map.
    pub image: CardImage,
    /// Parameters of gathers in the maps.
    pub gathers: GatherParameters,
    /// Number of paths traced from the lights.
    pub paths: u64,
    /// Statistics of the guiding of the paths; `None` if photons are for any camera.
    pub guiding: Option<Guiding>,
    /// Time of each step of the photon pass.
    pub times: PhotonTimes,
}

/// Parameters of gathers that follow from the photons.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GatherParameters {
    /// Maximum distance of a gather, metres.
    pub max_distance: f32,
    /// Length below which gather rays go on unless settings state one, metres; 0 for none.
    pub near_distance: f32,
    /// Parameters of gathers in the caustic map; `None` without a caustic map.
    pub caustics: Option<CausticGather>,
}

impl GatherParameters {
    /// Gathers within `max_distance` metres at the end of every gather ray, without a caustic map.
    pub fn within(max_distance: f32) -> Self {
        Self { max_distance, near_distance: 0.0, caustics: None }
    }
}

/// Time of each step of the photon pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PhotonTimes {
    /// Time of tracing photons.
    pub tracing: Duration,
    /// Time of building the tree and writing its lines.
    pub building: Duration,
    /// Time of measuring the maximum distance of gathers and the disc fractions.
    pub measuring: Duration,
    /// Time of precomputing irradiance; zero if it is not precomputed.
    pub estimating: Duration,
}

/// Traces photons in a packed scene and adds the photon map to its image. `progress` is called with the
/// number of photons stored, also while the map is measured, and returns whether to continue.
///
/// # Errors
/// If the scene is too wide, the card image grows too large, or `progress` returns false.
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

/// Photons of the photon map and of the caustic map of a scene.
pub struct TracedPhotons {
    /// Photons of the photon map.
    pub photons: Photons,
    /// Number of paths traced from the lights.
    pub(crate) paths: u64,
    /// Statistics of the guiding of the paths; `None` if photons are for any camera.
    pub(crate) guiding: Option<Guiding>,
    /// Caustic photons; `None` if none were requested or found.
    pub(crate) caustic: Option<Photons>,
    /// Importons of the camera for which the photons are traced; `None` if they are for any camera.
    pub(crate) importons: Option<Importons>,
}

impl TracedPhotons {
    /// Traces photons in a packed scene.
    ///
    /// # Errors
    /// As [`map_photons`].
    pub fn new(
        packed: &PackedScene,
        settings: &PhotonSettings,
        progress: &(dyn Fn(usize) -> bool + Sync),
    ) -> Result<Self, PhotonError> {
        let importons = importons(packed, settings)?;
        let [of_map, of_caustics] = [
            importons.as_ref().map(|importons| &importons.indirect),
            importons.as_ref().map(|importons| &importons.caustic),
        ];
        let PhotonPass { photons, paths, guiding, .. } =
            trace_for(packed, of_map, settings.seed, settings.photons, progress)?;
        let caustic = caustics(packed, of_caustics, settings, progress)?;
        Ok(Self { photons, paths, guiding, caustic, importons })
    }

    /// Fraction of the photons that the picture of a camera can use, estimated by few eye paths.
    ///
    /// # Errors
    /// If the card image is invalid.
    pub fn used_share(&self, packed: &PackedScene, camera: &Camera) -> Result<f64, PhotonError> {
        let used = Importons::few(packed, camera)?.indirect;
        let is_used = |photon: &Photon| used.is_used(photon.position.into(), photon.normal);
        let count = self.photons.iter().filter(is_used).count();
        Ok(count as f64 / self.photons.len().max(1) as f64)
    }
}

/// Adds the photon map to the card image of a packed scene, from photons that were traced before.
/// [`map_photons`] does both steps.
pub fn map_traced(
    packed: PackedScene,
    traced: TracedPhotons,
    settings: &PhotonSettings,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<MappedImage, PhotonError> {
    let TracedPhotons { mut photons, paths, guiding, caustic, importons } = traced;
    let has_punctual_caustics =
        packed.radiance_of_caustics().is_some_and(|radiance| radiance.mean.is_infinite());
    let mut times = PhotonTimes::default();
    let start = Instant::now();
    let cell = photons.grid().cell;
    if guiding.is_some() {
        outliers::spread(&mut photons, &packed).map_err(PhotonError::Unsound)?;
    }
    let mut image = store_photons(packed, photons, settings.neighbors)?;
    times.building = start.elapsed();
    let start = Instant::now();
    let sampled = SampledDistances::new(&image, settings.neighbors)?;
    sampled.write_shares(&mut image);
    let mut distances = sampled.of_gathers(&image, importons.as_ref());
    if let Some(distance) = settings.max_distance {
        // A distance beyond the scene's diagonal has no further effect.
        let greatest = distance.min(image.diagonal());
        distances = GatherDistances { usual: distances.usual.min(greatest), greatest };
    } else if importons.is_some() {
        // Photons for a camera may be dense in a small part of a wide scene.
        distances.greatest = distances.greatest.max(MIN_CELLS * cell);
    }
    let max_distance = distances.greatest;
    if max_distance < MIN_CELLS * cell {
        return Err(PhotonError::TooWide { cell, max_distance });
    }
    measure_discs(&mut image, settings.neighbors, distances, &|| progress(settings.photons))?;
    times.measuring = start.elapsed();
    if settings.layout == PhotonLayout::Jensen {
        let start = Instant::now();
        image = to_kd_tree(image)?;
        times.building += start.elapsed();
    }
    let mut caustics = None;
    if let Some(mut photons) = caustic {
        let start = Instant::now();
        let max_distance = kernels::spread(&mut photons, settings.caustic_neighbors, image.diagonal());
        image = store_caustics(image, photons, max_distance)?;
        caustics = Some(CausticGather { neighbors: settings.caustic_neighbors, max_distance });
        times.building += start.elapsed();
    }
    if settings.radiance == Radiance::Precomputed {
        let start = Instant::now();
        let go_on = || progress(settings.photons);
        image = precompute_irradiance(image, settings.neighbors, max_distance, &go_on)?;
        times.estimating = start.elapsed();
    }
    // No ray can hit the lights of these caustics.
    let near_distance = if caustics.is_none() && has_punctual_caustics {
        0.0
    } else {
        (NEAR * distances.usual).min(image.diagonal() / DIAGONAL_OVER_NEAR)
    };
    let gathers = GatherParameters { max_distance, near_distance, caustics };
    Ok(MappedImage { image, gathers, paths, guiding, times })
}

/// Importons of the camera for which photons are traced; `None` for any camera.
fn importons(packed: &PackedScene, settings: &PhotonSettings) -> Result<Option<Importons>, PhotonError> {
    // Area of a gather's disc divided by that of the surface, if photons are equally dense everywhere.
    let share = |neighbors: u32, photons: usize| neighbors as f32 / photons.max(1) as f32;
    let shares = [
        share(settings.neighbors, settings.photons),
        share(settings.caustic_neighbors, settings.caustic_photons),
    ];
    let importons = settings.camera.map(|camera| Importons::new(packed, &camera, shares));
    importons.transpose().map_err(PhotonError::Unsound)
}

/// Traces caustic photons; `None` if none were requested or found. Without a caustic map, gather rays carry
/// the light of caustics.
fn caustics(
    packed: &PackedScene,
    importons: Option<&ImportonGrid>,
    settings: &PhotonSettings,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<Option<Photons>, PhotonError> {
    if settings.caustic_photons == 0 {
        return Ok(None);
    }
    let go_on = || progress(settings.photons);
    let photons = trace_caustics_for(packed, importons, settings.seed, settings.caustic_photons, &go_on)?;
    Ok((!photons.is_empty()).then_some(photons))
}
