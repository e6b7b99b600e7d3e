//! Radius of a typical gather, for which the trees of photons are built.

use rayon::prelude::*;

use crate::photon::{Photons, StoredPhoton};

/// Number of photons around which [`typical_radius`] searches.
const SAMPLED_PHOTONS: usize = 64;
/// Minimum number of photons in the subset that [`typical_radius`] searches, unless there are fewer photons.
const SAMPLED_NEIGHBORS: usize = 1 << 16;
/// Minimum number of neighbours within the subset if its photons are more than `MIN_STEP` indices apart.
const MIN_NEIGHBORS: usize = 4;
/// Maximum step between the indices of the subset's photons at which `MIN_NEIGHBORS` does not apply.
const MIN_STEP: usize = 32;

/// Radius of a typical search for `neighbors` photons, in cells of the photon grid. There is no tree to
/// search yet. The radius is therefore estimated in a subset of the photons, for a proportionally smaller
/// number of neighbours.
pub(super) fn typical_radius(photons: &Photons, neighbors: u32) -> f64 {
    let all = photons.stored();
    let neighbors = neighbors as usize;
    let step = (all.len() / SAMPLED_NEIGHBORS).min((neighbors / MIN_NEIGHBORS).max(MIN_STEP)).max(1);
    let rank = (neighbors / step).max(1);
    let squared_distance = |point: [u32; 3], other: StoredPhoton| {
        let mut sum = 0;
        // This is a loop, because compilers may leave `map` as a call.
        for (axis, coordinate) in point.into_iter().enumerate() {
            let side = u64::from(coordinate.abs_diff(other.coordinate(axis)));
            sum += side * side;
        }
        sum
    };
    let mut radii: Vec<u64> = all
        .par_iter()
        .step_by((all.len() / SAMPLED_PHOTONS).max(1))
        .map(|photon| {
            let (point, others) = (photon.point(), all.iter().step_by(step));
            let mut distances: Vec<u64> = others.map(|other| squared_distance(point, *other)).collect();
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
