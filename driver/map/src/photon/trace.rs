//! Photon pass: traces paths until enough photons are stored.

use std::cell::LazyCell;

use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::crevices::Spacing;
use super::error::PhotonError;
use super::importons::ImportonGrid;
use super::pilot::{Guiding, caustic_share, guide, more_useful, tracer_of_more_photons};
use super::stored::{Photons, StoredPhoton};
use super::tracer::{PATHS_PER_TASK, Purpose, Traced, Tracer};
use crate::light::Sources;
use crate::pack::PackedScene;

/// Result of the photon pass.
pub struct PhotonPass {
    /// Photons in the order of their paths, at most as many as requested.
    pub photons: Photons,
    /// Number of paths traced.
    pub paths: u64,
    /// Statistics of the guiding of paths towards surfaces that a camera's picture uses; `None` if paths are
    /// not guided.
    pub guiding: Option<Guiding>,
}

/// Number of paths after which the pass ends unless each thousand further paths store at least one photon.
const FRUITLESS_PATHS: u64 = 1_000_000;
/// Number of paths by which each stored caustic photon raises the limit on paths.
const MAX_PATHS_TO_A_CAUSTIC_PHOTON: u64 = 20;
/// Maximum number of paths for caustics in addition to [`MAX_PATHS_TO_A_CAUSTIC_PHOTON`] per photon.
const MAX_PATHS_TO_CAUSTICS: f64 = 1_000_000.0;
/// Minimum number of paths for caustics in addition to [`MAX_PATHS_TO_A_CAUSTIC_PHOTON`] per photon.
const MIN_PATHS_TO_CAUSTICS: u64 = 125_000;
/// Minimum fraction of the arriving power (`caustic_share`) at which caustics get all
/// [`MAX_PATHS_TO_CAUSTICS`] additional paths. A smaller fraction gets proportionally fewer, but at least
/// [`MIN_PATHS_TO_CAUSTICS`].
const FULL_CAUSTIC_SHARE: f64 = 0.1;

/// Traces paths until `count` photons are stored. It stores none if no surface stores photons, and fewer if
/// most light misses all surfaces or ends on surfaces that store none. `progress` is called with the number
/// of photons and returns whether to continue.
///
/// # Errors
/// If `progress` returns false, or the packed scene is malformed.
pub fn trace(
    packed: &PackedScene,
    seed: u32,
    count: usize,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<PhotonPass, PhotonError> {
    trace_for(packed, None, seed, count, progress)
}

/// Traces as [`trace`] does, with paths that are guided towards importons if there are any.
pub(crate) fn trace_for(
    packed: &PackedScene,
    importons: Option<&ImportonGrid>,
    seed: u32,
    count: usize,
    progress: &(dyn Fn(usize) -> bool + Sync),
) -> Result<PhotonPass, PhotonError> {
    let is_fruitless = |stored: usize, paths: u64| paths >= FRUITLESS_PATHS + 1_000 * stored as u64;
    let traced = trace_while(packed, importons, (seed, Purpose::Indirect), count, &|stored, paths| {
        Ok(if !is_fruitless(stored, paths) && progress(stored) { u64::MAX } else { 0 })
    })?;
    let stored = traced.photons.len();
    if stored >= count || !packed.keeps_photons() {
        return Ok(traced);
    }
    if !is_fruitless(stored, traced.paths) {
        return Err(PhotonError::Stopped);
    }
    // These photons are all that there is to gather: other light misses the surfaces, or ends on them.
    Ok(traced)
}

/// Traces paths until `count` caustic photons are stored or a limit on paths is reached. The limit is first
/// 125,000 paths, and twenty more for each stored photon. Once it is reached, a pilot pass measures the share
/// of light that caustics contribute. The 125,000 is then replaced by a number in proportion to this share,
/// from 125,000 to a million. `go_on` returns whether to continue.
///
/// # Errors
/// If `go_on` returns false, or the packed scene is malformed.
pub fn trace_caustics(
    packed: &PackedScene,
    seed: u32,
    count: usize,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Photons, PhotonError> {
    trace_caustics_for(packed, None, seed, count, go_on)
}

/// Traces as [`trace_caustics`] does, with paths that are guided towards importons if there are any.
pub(crate) fn trace_caustics_for(
    packed: &PackedScene,
    importons: Option<&ImportonGrid>,
    seed: u32,
    count: usize,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Photons, PhotonError> {
    // The pilot runs only if its result is needed: most scenes with caustics do not need it.
    let worth = LazyCell::new(|| caustic_share(packed, seed).map(paths_worth));
    let traced = trace_while(packed, importons, (seed, Purpose::Caustics), count, &|stored, paths| {
        if !go_on() {
            return Ok(0);
        }
        let left = |least: u64| (least + MAX_PATHS_TO_A_CAUSTIC_PHOTON * stored as u64).saturating_sub(paths);
        match left(MIN_PATHS_TO_CAUSTICS) {
            0 => Ok(left((*worth)?)),
            more => Ok(more),
        }
    })?;
    if go_on() { Ok(traced.photons) } else { Err(PhotonError::Stopped) }
}

/// Number of paths allowed for caustics in addition to [`MAX_PATHS_TO_A_CAUSTIC_PHOTON`] per photon. `share`
/// is the fraction of the light that caustics contribute.
fn paths_worth(share: f64) -> u64 {
    let full = (share / FULL_CAUSTIC_SHARE).min(1.0);
    MIN_PATHS_TO_CAUSTICS.max((full * MAX_PATHS_TO_CAUSTICS) as u64)
}

/// Traces paths until `count` photons are stored or no further path is allowed. `further(photons, paths)`
/// returns the number of further paths allowed.
fn trace_while(
    packed: &PackedScene,
    importons: Option<&ImportonGrid>,
    (seed, purpose): (u32, Purpose),
    count: usize,
    further: &dyn Fn(usize, u64) -> Result<u64, Fault>,
) -> Result<PhotonPass, PhotonError> {
    let keeps_photons = match purpose {
        Purpose::Indirect => packed.keeps_photons(),
        Purpose::Caustics => packed.keeps_photons() || packed.has_lobes_under_punctual_lights(),
    };
    if !keeps_photons {
        let photons = Photons { list: Vec::new(), grid: packed.photon_grid(), power_unit: 1.0 };
        return Ok(PhotonPass { photons, paths: 0, guiding: None });
    }
    let aimed = importons.map(|importons| packed.sources().aimed_at(importons.targets()));
    let towards = importons.zip(aimed.as_ref());
    let tracer = tracer(packed, (seed, purpose), towards).map_err(PhotonError::Unsound)?;
    let guide = importons.map(|importons| guide(&tracer, packed, importons, count));
    let (guide, guiding) = guide.transpose().map_err(PhotonError::Unsound)?.flatten().unzip();
    let tracer = tracer.guided(guide.as_ref());
    let mut list: Vec<StoredPhoton> = Vec::with_capacity(count);
    let mut paths = 0_u64;
    let mut spacing = None;
    while list.len() < count {
        let further = further(list.len(), paths).map_err(PhotonError::Unsound)?;
        if further == 0 {
            break;
        }
        let tasks = next_tasks(count - list.len(), list.len(), paths).min(further.div_ceil(PATHS_PER_TASK));
        let round: Result<Vec<Traced>, Fault> = (0..tasks)
            .into_par_iter()
            .map(|task| {
                let (_, mut memory) = packed.view();
                tracer.trace(&mut memory, paths + task * PATHS_PER_TASK)
            })
            .collect();
        let round = round.map_err(PhotonError::Unsound)?;
        // Photons of caustics are not merged, which would blur them.
        if purpose == Purpose::Indirect && spacing.is_none() {
            spacing = Some(Spacing::new(&round, count));
        }
        for traced in round {
            let traced = match spacing {
                Some(spacing) => spacing.merged(traced),
                None => traced,
            };
            let missing = count - list.len();
            if missing > 0 {
                paths += traced.paths_until(missing);
                list.extend_from_slice(traced.photons.get(..missing).unwrap_or(&traced.photons));
            }
        }
    }
    let power_unit = (tracer.path_unit / paths.max(1) as f32).max(f32::MIN_POSITIVE);
    let photons = Photons { list, grid: tracer.grid, power_unit };
    Ok(PhotonPass { photons, paths, guiding })
}

/// Creates the tracer of a map. Its paths start at those sources whose photons are most useful. `towards`
/// holds importons and the sources that are aimed at them.
fn tracer<'s>(
    packed: &'s PackedScene,
    (seed, purpose): (u32, Purpose),
    towards: Option<(&ImportonGrid, &'s Sources)>,
) -> Result<Tracer<'s>, Fault> {
    if purpose == Purpose::Caustics {
        let sources = packed.caustic_sources().unwrap_or(packed.sources());
        return Ok(Tracer::new(packed, sources, seed, purpose));
    }
    let tracer = tracer_of_more_photons(packed, seed)?;
    let Some((importons, aimed)) = towards else { return Ok(tracer) };
    more_useful([tracer, Tracer::new(packed, aimed, seed, purpose)], packed, importons)
}

/// Number of tasks of the next round, estimated from the number of photons per path so far. It is at most 64,
/// so that progress is reported. It does not affect which paths are traced.
fn next_tasks(missing: usize, stored: usize, paths: u64) -> u64 {
    let photons_per_path = if stored > 0 { stored as f64 / paths as f64 } else { 4.0 };
    let needed = (missing as f64 / photons_per_path) as u64;
    needed.div_ceil(PATHS_PER_TASK).clamp(1, 64)
}
