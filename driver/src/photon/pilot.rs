//! Pilots: first paths of other seeds than the map's, by which the sources and the guide of its paths are chosen.

use photoncard_firmware::sampler::hash;
use photoncard_shared::layout::Photon;
use photoncard_shared::message::Fault;
use rayon::prelude::*;
use serde::Serialize;

use super::emit::{PathRandom, emission_point};
use super::guide::{Guide, Sample, Warped};
use super::importons::ImportonGrid;
use super::stored::StoredPhoton;
use super::tracer::{PATHS_PER_TASK, Purpose, Traced, Tracer};
use crate::pack::PackedScene;

/// Guiding of photon paths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Guiding {
    /// Number of paths of the pilot, which are traced besides those of the photons.
    pub pilot_paths: u64,
    /// Number of cells of the space of emissions.
    pub cells: usize,
    /// Expected use of a path over that of a path of the same aim that is not guided.
    pub gain: f64,
}

/// Number of tasks of the pilots for aimed and unaimed paths.
const AIM_TASKS: u64 = 4;
/// Maximum of the spread of guided paths, aimed at importons over not aimed, for which paths are aimed at them: a little above 1, as a pilot
/// of unaimed paths misses rare ones of great use.
const MAX_SPREAD_BY_AIM: f64 = 1.1;
/// Minimum of the pilots' effective numbers of photons, aimed over unaimed, for which paths are aimed: 2, so that noise of the pilots
/// changes nothing in rooms, where both are about equal.
const MIN_GAIN_BY_AIM: f64 = 2.0;
/// Difference of the seeds of a map and of the first round of the pilot for its guide.
const GUIDE_SEED: u32 = 0x7feb_352d;
/// Number of rounds of the pilot for a guide, each guided by the one before: paths through a small window are rare in the first.
const GUIDE_ROUNDS: u32 = 3;
/// Number of photons for each path of a round.
const PHOTONS_PER_GUIDE_PATH: u64 = 8;
/// Minimum number of tasks of a round, and number of those of the pilots for aimed and unaimed paths.
const MIN_GUIDE_TASKS: u64 = 32;
/// Maximum number of tasks of a round.
const MAX_GUIDE_TASKS: u64 = 128;

/// Tracer of the photon map whose paths store more photons: of unaimed paths, or of aimed ones, where far more of these meet a
/// surface.
pub(super) fn tracer_of_more_photons(packed: &PackedScene, seed: u32) -> Result<Tracer<'_>, Fault> {
    let unaimed = Tracer::new(packed, packed.sources(), seed, Purpose::Indirect);
    let Some(sources) = packed.aimed_sources() else { return Ok(unaimed) };
    let aimed = Tracer::new(packed, sources, seed, Purpose::Indirect);
    // Paths of another seed, so that the choice does not depend on the photons of the map.
    let pilot = |tracer: &Tracer| effective_photons(&tracer.with_seed(!seed), packed);
    let [of_unaimed, of_aimed] = [pilot(&unaimed)?, pilot(&aimed)?];
    Ok(if of_aimed > MIN_GAIN_BY_AIM * of_unaimed { aimed } else { unaimed })
}

/// Effective number of the photons that the first paths store, by their powers.
fn effective_photons(tracer: &Tracer, packed: &PackedScene) -> Result<f64, Fault> {
    let tasks: Result<Vec<Traced>, Fault> = (0..AIM_TASKS)
        .into_par_iter()
        .map(|task| tracer.trace(&mut packed.view().1, task * PATHS_PER_TASK))
        .collect();
    Ok(effective_number(tasks?.into_iter().flat_map(|traced| traced.photons).map(StoredPhoton::power)))
}

/// Effective number of samples of weights w: `(sum w)^2 / sum w^2` (Kish 1965).
fn effective_number(weights: impl Iterator<Item = f64>) -> f64 {
    let [sum, squares] =
        weights.fold([0.0; 2], |[sum, squares], weight| [sum + weight, squares + weight * weight]);
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}

/// Of two tracers the second, which is aimed at importons, if its guided paths spread less in their use.
pub(super) fn more_useful<'s>(
    tracers: [Tracer<'s>; 2],
    packed: &PackedScene,
    importons: &ImportonGrid,
) -> Result<Tracer<'s>, Fault> {
    let pilot = |tracer: &Tracer| -> Result<f64, Fault> {
        let samples = samples(&tracer.with_seed(!tracer.seed), packed, importons, MIN_GUIDE_TASKS)?;
        let spread = Guide::new(samples).map_or(f64::INFINITY, |guide| guide.spread());
        Ok(spread * f64::from(tracer.path_unit))
    };
    let [of_first, of_second] = [pilot(&tracers[0])?, pilot(&tracers[1])?];
    let [first, second] = tracers;
    Ok(if of_second < MAX_SPREAD_BY_AIM * of_first { second } else { first })
}

/// Guide of a tracer's paths towards importons, for a number of photons; `None` if no path of the pilot is of use.
pub(super) fn guide(
    tracer: &Tracer,
    packed: &PackedScene,
    importons: &ImportonGrid,
    photons: usize,
) -> Result<Option<(Guide, Guiding)>, Fault> {
    let tasks =
        (photons as u64 / PHOTONS_PER_GUIDE_PATH / PATHS_PER_TASK).clamp(MIN_GUIDE_TASKS, MAX_GUIDE_TASKS);
    let mut guide = None;
    for round in 0..GUIDE_ROUNDS {
        // Paths of another seed: weights that depended on the photons of the map would bias it.
        let seed = tracer.seed ^ hash(GUIDE_SEED + round);
        let pilot = tracer.with_seed(seed).guided(guide.as_ref());
        guide = Guide::new(samples(&pilot, packed, importons, tasks)?);
    }
    Ok(guide.map(|guide| {
        let pilot_paths = u64::from(GUIDE_ROUNDS) * tasks * PATHS_PER_TASK;
        let guiding = Guiding { pilot_paths, cells: guide.cells(), gain: guide.gain() };
        (guide, guiding)
    }))
}

/// Samples of the use of the paths of some tasks.
fn samples(
    pilot: &Tracer,
    packed: &PackedScene,
    importons: &ImportonGrid,
    tasks: u64,
) -> Result<Vec<Sample>, Fault> {
    let samples: Result<Vec<Vec<Sample>>, Fault> = (0..tasks)
        .into_par_iter()
        .map(|task| samples_of_task(pilot, packed, importons, task * PATHS_PER_TASK))
        .collect();
    Ok(samples?.concat())
}

/// Samples of the use of a task's paths.
fn samples_of_task(
    pilot: &Tracer,
    packed: &PackedScene,
    importons: &ImportonGrid,
    first: u64,
) -> Result<Vec<Sample>, Fault> {
    let Traced { photons, ends, .. } = pilot.trace(&mut packed.view().1, first)?;
    let use_of =
        |photon: &StoredPhoton| photon.power() * importons.use_of(&Photon::read(&photon.record(&pilot.grid)));
    let begins = std::iter::once(0).chain(ends.iter().copied());
    let paths = (first..).zip(begins.zip(&ends)).map(|(path, (begin, &end))| {
        let Warped { point, weight } = emission_point(pilot.guide, PathRandom::new(pilot.seed, path));
        let uses = photons[begin as usize..end as usize].iter().map(use_of);
        let uses = uses.map(|guided| guided / f64::from(weight));
        Sample { point, weight, use_of_path: uses.clone().sum(), squares: uses.map(|own| own * own).sum() }
    });
    Ok(paths.collect())
}
