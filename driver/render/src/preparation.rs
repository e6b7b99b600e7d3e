//! Prepares a render: creates the card image with scene and photon maps.

use std::sync::Arc;
use std::time::Instant;

use photoncard_map::pack::{CardImage, PackedScene};
use photoncard_map::photon_map::{self, Guiding, MappedImage, PhotonTimes, map_photons};
use photoncard_scene::Scene;
use photoncard_shared::message::CausticGather;

use super::times::Times;
use super::work::FitChips;
use super::{Observer, Phase, RenderError, RenderSettings};

/// Card image, and the frame parameters that are derived from it.
#[derive(Clone)]
pub(super) struct Prepared {
    pub(super) image: Arc<CardImage>,
    /// Maximum distance of a gather, metres.
    pub(super) max_distance: f32,
    /// Parameters of gathers in the caustic map.
    pub(super) caustics: Option<CausticGather>,
    /// Number of paths that were traced for the photons.
    pub(super) paths: u64,
    /// Guiding of these paths; `None` if photons are for any camera.
    pub(super) guiding: Option<Guiding>,
}

/// Adds the photon maps to a packed scene.
///
/// # Errors
/// If the image does not fit the chips, the photons cannot be traced, or the observer stops the render.
pub(super) fn prepare(
    scene: &Scene,
    packed: PackedScene,
    settings: &RenderSettings,
    fit: &mut FitChips,
    times: &mut Times,
    observer: &dyn Observer,
) -> Result<Prepared, RenderError> {
    let start = Instant::now();
    let photon_settings = settings.photon_settings(scene);
    fit(&|budget| Ok(photon_map::check_packed(&packed, &photon_settings, budget)?))?;
    let total = settings.photons.count as u64;
    let progress = |stored: usize| {
        observer.progress(Phase::Photons, stored as u64, total);
        if stored as u64 == total {
            observer.progress(Phase::Pack, 0, 1);
        }
        !observer.is_stopped()
    };
    let mapped = map_photons(packed, &photon_settings, &progress)?;
    fit(&|budget| Ok(photon_map::check_image(&mapped.image, budget)?))?;
    let PhotonTimes { tracing, building, measuring, estimating } = mapped.times;
    times.photons = tracing.as_secs_f64();
    times.pack += start.elapsed().as_secs_f64() - times.photons;
    times.photon_map = building.as_secs_f64();
    times.discs = measuring.as_secs_f64();
    times.irradiance = estimating.as_secs_f64();
    let MappedImage { image, max_distance, caustics, paths, guiding, .. } = mapped;
    Ok(Prepared { image: Arc::new(image), max_distance, caustics, paths, guiding })
}
