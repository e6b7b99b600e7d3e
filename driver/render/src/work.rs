//! Work of cards on a picture: the preparation of the card image, the outcome, and the time of each phase.

use std::ops::AddAssign;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use photoncard_cards::scheduler::TileCounts;
use photoncard_cards::session::LinkBytes;
use photoncard_map::pack::{CardImage, PackedScene};
use photoncard_map::photon_map::{self, GatherParameters, Guiding, MappedImage, PhotonTimes, map_photons};
use photoncard_picture::cryptomatte::Identities;
use photoncard_picture::film::Film;
use photoncard_picture::sink::TileSink;
use photoncard_scene::Scene;
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{FrameParameters, Tile};
use serde::Serialize;

use super::outputs::Outputs;
use super::{Observer, Phase, RenderError, RenderSettings};
use crate::emulator::memory_model::MemoryTraffic;

/// Function that checks whether a chip with a budget can render a picture.
pub(super) type BudgetCheck<'a> = &'a dyn Fn(&Budget) -> Result<(), RenderError>;

/// Function that applies a check to the budgets of all chips.
pub(super) type FitChips<'a> = dyn FnMut(BudgetCheck) -> Result<(), RenderError> + 'a;

/// Work of the cards on a picture.
pub(super) struct Work<'a> {
    pub(super) settings: &'a RenderSettings,
    pub(super) image: &'a Arc<CardImage>,
    pub(super) frame: &'a FrameParameters,
    /// All tiles of the picture.
    pub(super) tiles: Vec<Tile>,
    /// Film of the picture, which is also one of the sinks. It already contains the tiles of a resumed
    /// render.
    pub(super) film: &'a Mutex<Film>,
    /// Destinations of finished tiles.
    pub(super) sinks: Vec<&'a dyn TileSink>,
    /// Outputs that are checked for failures during the work.
    pub(super) outputs: &'a Outputs<'a>,
}

/// Outcome of the work of cards.
#[derive(Default)]
pub(super) struct Outcome {
    pub(super) counters: Counters,
    /// Bytes transferred over the link of each card.
    pub(super) links: Vec<LinkBytes>,
    /// Memory traffic; `None` if memory is not modelled.
    pub(super) traffic: Option<MemoryTraffic>,
    pub(super) cards: usize,
    /// Number of cards that were given up, left out because of their budget, or never answered the greeting.
    pub(super) cards_given_up: usize,
    /// Numbers of tiles that were taken over, verified, repeated or revoked.
    pub(super) tiles: TileCounts,
    /// Names of cards with dazzling tiles that no other card verified, each with the number of its tiles. The
    /// light of a dazzling tile is far above that of the scene's surfaces. Tiles taken over from a file are
    /// listed under the name [`EARLIER_RENDER`](crate::statistics::EARLIER_RENDER).
    pub(super) dazzling: Vec<(String, usize)>,
    /// Error that ended the work. The other fields describe the work until then.
    pub(super) failure: Option<RenderError>,
    /// Time until the last card was loaded, seconds.
    pub(super) load_seconds: f64,
    /// Time after the last card was loaded, seconds.
    pub(super) render_seconds: f64,
}

/// Card image, and the parameters of its photon maps.
#[derive(Clone)]
pub(super) struct Prepared {
    pub(super) image: Arc<CardImage>,
    /// Names of the image's identities; `None` for an image without identities.
    pub(super) identities: Option<Arc<Identities>>,
    /// Parameters of gathers in the photon maps.
    pub(super) gathers: GatherParameters,
    /// Number of light paths that were traced for the photons.
    pub(super) paths: u64,
    /// Guiding of the photon paths to the camera; `None` if photons are for any camera.
    pub(super) guiding: Option<Guiding>,
}

/// Adds the photon maps to a packed scene.
///
/// # Errors
/// If the card image does not fit the chips, the photons cannot be traced, or the observer stops the render.
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
    let identities = packed.identities();
    let mapped = map_photons(packed, &photon_settings, &progress)?;
    fit(&|budget| Ok(photon_map::check_image(&mapped.image, budget)?))?;
    let PhotonTimes { tracing, building, measuring, estimating } = mapped.times;
    times.photons = tracing.as_secs_f64();
    times.pack += start.elapsed().as_secs_f64() - times.photons;
    times.photon_map = building.as_secs_f64();
    times.discs = measuring.as_secs_f64();
    times.irradiance = estimating.as_secs_f64();
    let MappedImage { image, gathers, paths, guiding, .. } = mapped;
    Ok(Prepared { image: Arc::new(image), identities, gathers, paths, guiding })
}

/// Times of the phases, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Time to read the scene file.
    pub scene: f64,
    /// Time of pilot renders, from which settings are chosen.
    pub pilot: f64,
    /// Time to trace photons.
    pub photons: f64,
    /// Time to build the hierarchy, the photon map and the card image.
    pub pack: f64,
    /// Part of `pack` for the hierarchy and the other sections of the scene.
    pub hierarchy: f64,
    /// Part of `pack` for the photon map.
    pub photon_map: f64,
    /// Part of `pack` to measure the maximum distance of gathers, and the factors that correct the area of a
    /// gather at edges and in corners.
    pub discs: f64,
    /// Part of `pack` for irradiance points, if irradiance is precomputed.
    pub irradiance: f64,
    /// Time until the slowest card was loaded.
    pub load: f64,
    /// Time of rendering, after the last card was loaded.
    pub render: f64,
    /// Time of the denoiser; 0 without one. The caller of the library sets it, as it sets `scene`.
    pub denoise: f64,
    /// Total time.
    pub total: f64,
}

impl AddAssign for Times {
    fn add_assign(&mut self, more: Self) {
        let Self { scene, pilot, photons, pack, hierarchy, photon_map, .. } = more;
        let Self { discs, irradiance, load, render, denoise, total, .. } = more;
        for (time, more) in [
            (&mut self.scene, scene),
            (&mut self.pilot, pilot),
            (&mut self.photons, photons),
            (&mut self.pack, pack),
            (&mut self.hierarchy, hierarchy),
            (&mut self.photon_map, photon_map),
            (&mut self.discs, discs),
            (&mut self.irradiance, irradiance),
            (&mut self.load, load),
            (&mut self.render, render),
            (&mut self.denoise, denoise),
            (&mut self.total, total),
        ] {
            *time += more;
        }
    }
}
