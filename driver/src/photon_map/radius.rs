//! The radius of a typical gather, which the trees above photons are built for.

use rayon::prelude::*;

use crate::photon::{Photons, StoredPhoton};

/// Photons around which [`typical_radius`] looks.
const SAMPLED_PHOTONS: usize = 64;
/// Photons among which it looks, if they are enough.
const SAMPLED_NEIGHBORS: usize = 1 << 16;
/// Smallest number of neighbours that it looks for, if the photons are not too many for that.
const MIN_NEIGHBORS: usize = 4;
/// A part of this share of the photons is as good as all, however few neighbours are looked for.
const MIN_STEP: usize = 32;

/// The radius of a typical search for so many neighbours, cells of the photons' grid. It is estimated before there is any
/// tree to search: in a part of the photons for as small a part of the neighbours.
pub(super) fn typical_radius(photons: &Photons, neighbors: u32) -> f64 {
    let all = photons.stored();
    let neighbors = neighbors as usize;
    let step = (all.len() / SAMPLED_NEIGHBORS).min((neighbors / MIN_NEIGHBORS).max(MIN_STEP)).max(1);
    let rank = (neighbors / step).max(1);
    let squared_distance = |a: StoredPhoton, b: StoredPhoton| {
        let sides = [0, 1, 2].map(|axis| u64::from(a.coordinate(axis).abs_diff(b.coordinate(axis))));
        sides.into_iter().map(|side| side * side).sum::<u64>()
    };
    let mut radii: Vec<u64> = all
        .par_iter()
        .step_by((all.len() / SAMPLED_PHOTONS).max(1))
        .map(|photon| {
            let others = all.iter().step_by(step);
            let mut distances: Vec<u64> = others.map(|other| squared_distance(*photon, *other)).collect();
            let farthest = distances.len() - 1;
            *distances.select_nth_unstable(rank.min(farthest)).1
        })
        .collect();
    let middle = radii.len() / 2;
    if radii.is_empty() {
        return 0.0;
    }
    let typical = *radii.select_nth_unstable(middle).1;
    (typical as f64 * neighbors as f64 / (rank * step) as f64).sqrt()
}
