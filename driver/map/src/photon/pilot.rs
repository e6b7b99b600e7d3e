//! Pilot passes: photon paths with other seeds than those of the photon map. They determine the sources and
//! the guide of the map's paths.

use std::collections::BTreeMap;

use photoncard_firmware::sampler::hash;
use photoncard_shared::layout::{GRID_BITS, Photon};
use photoncard_shared::message::Fault;
use rayon::prelude::*;
use serde::Serialize;

use super::emit::{PathRandom, emission_point};
use super::guide::{Guide, Sample, Warped};
use super::importons::ImportonGrid;
use super::stored::StoredPhoton;
use super::tracer::{PATHS_PER_TASK, Purpose, Traced, Tracer};
use crate::light::Sources;
use crate::pack::PackedScene;

/// Statistics of the guiding of photon paths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Guiding {
    /// Number of paths that the pilot traced in addition to those of the photons.
    pub pilot_paths: u64,
    /// Number of cells into which the space of emissions is divided.
    pub cells: usize,
    /// Expected use of a guided path for the picture, divided by that of an unguided path with the same aim.
    pub gain: f64,
}

/// Number of tasks, of [`PATHS_PER_TASK`] paths each, of a pilot that compares aimed with unaimed paths.
const AIM_TASKS: u64 = 4;
/// Number of tasks, of [`PATHS_PER_TASK`] paths each, of a pilot that measures the share of caustics.
const SHARE_TASKS: u64 = 8;
/// Number of lower bits of a grid coordinate that one cell of [`CellPowers`] comprises. The longest side of
/// the grid then has 32 to 64 cells.
const CELL_BITS: u32 = GRID_BITS - 6;
/// Factor by which the effective number of photons of aimed paths must exceed that of unaimed paths for paths
/// to be aimed. With 2, noise does not decide in rooms, where both numbers are about equal.
const MIN_GAIN_BY_AIM: f64 = 2.0;
/// Number from which the seed of a pilot round is made: the map's seed XOR `hash(GUIDE_SEED + round)`.
const GUIDE_SEED: u32 = 0x7feb_352d;
/// Number of pilot rounds for a guide. Each round is guided by all before it, because paths through a small
/// window are rare in the first round.
const GUIDE_ROUNDS: u32 = 4;
/// Number of photons of the map per path of a pilot round.
const PHOTONS_PER_GUIDE_PATH: u64 = 8;
/// Minimum number of tasks of a pilot round, and number of tasks of each pilot of [`more_useful`].
const MIN_GUIDE_TASKS: u64 = 32;
/// Maximum number of tasks of a pilot round.
const MAX_GUIDE_TASKS: u64 = 128;

/// Returns the tracer of the photon map. Its paths are aimed if their effective number of photons is more
/// than [`MIN_GAIN_BY_AIM`] times that of unaimed paths.
pub(super) fn tracer_of_more_photons(packed: &PackedScene, seed: u32) -> Result<Tracer<'_>, Fault> {
    let unaimed = Tracer::new(packed, packed.sources(), seed, Purpose::Indirect);
    let Some(sources) = packed.aimed_sources() else { return Ok(unaimed) };
    let aimed = Tracer::new(packed, sources, seed, Purpose::Indirect);
    // The pilot's paths have another seed, so that the choice does not depend on the photons of the map.
    let pilot = |tracer: &Tracer| effective_photons(&tracer.with_seed(!seed), packed);
    let [of_unaimed, of_aimed] = [pilot(&unaimed)?, pilot(&aimed)?];
    Ok(if of_aimed > MIN_GAIN_BY_AIM * of_unaimed { aimed } else { unaimed })
}

/// Effective number of the photons that the first paths store, from their powers.
fn effective_photons(tracer: &Tracer, packed: &PackedScene) -> Result<f64, Fault> {
    Ok(effective_number(first_photons(tracer, packed, AIM_TASKS)?.into_iter().map(StoredPhoton::power)))
}

/// Photons stored by the paths of the first `tasks` tasks.
fn first_photons(tracer: &Tracer, packed: &PackedScene, tasks: u64) -> Result<Vec<StoredPhoton>, Fault> {
    let tasks: Result<Vec<Traced>, Fault> = (0..tasks)
        .into_par_iter()
        .map(|task| tracer.trace(&mut packed.view().1, task * PATHS_PER_TASK))
        .collect();
    Ok(tasks?.into_iter().flat_map(|traced| traced.photons).collect())
}

/// Estimates which fraction of the arriving power, over all bounces, comes from caustics at the places where
/// they occur. It is the mean of this fraction over cells of space, weighted by the power of caustics. It is
/// 1 if no other light arrives.
pub(super) fn caustic_share(packed: &PackedScene, seed: u32) -> Result<f64, Fault> {
    let power_by = |sources: Option<&Sources>, purpose: Purpose| {
        // The pilot's paths have another seed, so that the number of paths does not depend on the photons of
        // the map.
        let tracer = Tracer::new(packed, sources.unwrap_or(packed.sources()), !seed, purpose);
        Ok(CellPowers::new(&tracer, first_photons(&tracer, packed, SHARE_TASKS)?))
    };
    let caustic: CellPowers = power_by(packed.caustic_sources(), Purpose::Caustics)?;
    Ok(caustic.share_of(&power_by(packed.aimed_sources(), Purpose::Indirect)?))
}

/// Photon powers by cell of space, ordered by cell, so that sums do not depend on the machine.
struct CellPowers(BTreeMap<[u32; 3], CellPower>);

/// Power of the photons in a cell, watts, and sum of the squared powers.
#[derive(Clone, Copy, Default)]
struct CellPower {
    power: f64,
    squares: f64,
}

impl CellPowers {
    fn new(tracer: &Tracer, photons: Vec<StoredPhoton>) -> Self {
        let mut cells = BTreeMap::<_, CellPower>::new();
        for photon in photons {
            let power = photon.power() * f64::from(tracer.path_unit);
            let cell = cells.entry(photon.point().map(|coordinate| coordinate >> CELL_BITS)).or_default();
            cell.power += power;
            cell.squares += power * power;
        }
        Self(cells)
    }

    fn power(&self) -> f64 {
        self.0.values().map(|cell| cell.power).sum()
    }

    /// Returns the mean over cells of a cell's power divided by its power in `all`, weighted by the former.
    /// The result is at least the ratio of the two total powers.
    fn share_of(&self, all: &Self) -> f64 {
        let (own, whole) = (self.power(), all.power());
        // Only pairs of different photons count: pairs of a photon with itself would make any light of few
        // photons seem focused.
        let of_cell = |(cell, own): (&[u32; 3], &CellPower)| {
            let around = all.0.get(cell).map_or(0.0, |all| all.power);
            (own.power * own.power - own.squares) / around.max(own.power)
        };
        let here = self.0.iter().map(of_cell).sum::<f64>() / own;
        if own < whole { (own / whole).max(here) } else { 1.0 }
    }
}

/// Effective number of samples with weights w: `(sum w)^2 / sum w^2` (Kish 1965).
fn effective_number(weights: impl Iterator<Item = f64>) -> f64 {
    let [sum, squares] =
        weights.fold([0.0; 2], |[sum, squares], weight| [sum + weight, squares + weight * weight]);
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}

/// Returns the tracer whose guided paths have the smaller [`Guide::spread`], in watts.
pub(super) fn more_useful<'s>(
    tracers: [Tracer<'s>; 2],
    packed: &PackedScene,
    importons: &ImportonGrid,
) -> Result<Tracer<'s>, Fault> {
    let pilot = |tracer: &Tracer| -> Result<f64, Fault> {
        let mut samples = samples(&tracer.with_seed(!tracer.seed), packed, importons, MIN_GUIDE_TASKS)?;
        let spread = Guide::new(&mut samples).map_or(f64::INFINITY, |guide| guide.spread());
        Ok(spread * f64::from(tracer.path_unit))
    };
    let [of_first, of_second] = [pilot(&tracers[0])?, pilot(&tracers[1])?];
    let [first, second] = tracers;
    Ok(if of_second < of_first { second } else { first })
}

/// Builds a guide of a tracer's paths towards importons, for a map of `photons` photons; `None` if no path of
/// the pilot is useful.
pub(super) fn guide(
    tracer: &Tracer,
    packed: &PackedScene,
    importons: &ImportonGrid,
    photons: usize,
) -> Result<Option<(Guide, Guiding)>, Fault> {
    let tasks =
        (photons as u64 / PHOTONS_PER_GUIDE_PATH / PATHS_PER_TASK).clamp(MIN_GUIDE_TASKS, MAX_GUIDE_TASKS);
    let (mut guide, mut all) = (None, Vec::new());
    for round in 0..GUIDE_ROUNDS {
        // The pilot's paths have another seed: a guide that depended on the photons of the map would bias the
        // map.
        let seed = tracer.seed ^ hash(GUIDE_SEED + round);
        let pilot = tracer.with_seed(seed).guided(guide.as_ref());
        all.extend(samples(&pilot, packed, importons, tasks)?);
        guide = Guide::new(&mut all);
    }
    Ok(guide.map(|guide| {
        let pilot_paths = u64::from(GUIDE_ROUNDS) * tasks * PATHS_PER_TASK;
        let guiding = Guiding { pilot_paths, cells: guide.cells(), gain: guide.gain() };
        (guide, guiding)
    }))
}

/// Traces the paths of `tasks` tasks, and measures how the picture uses their photons.
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

/// Traces the paths of one task, and measures how the picture uses their photons.
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
