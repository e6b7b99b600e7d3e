//! Photons of one path that lie together: a path that is caught in a crevice meets its walls many times, and its photons alone would be
//! all that a gather there finds. One photon with the power of all takes their place, so that a gather finds those of other paths.

use super::stored::StoredPhoton;
use super::tracer::Traced;

/// Number of photons whose neighbours are searched.
const SAMPLED: usize = 32;
/// Neighbour whose distance shows how dense photons are.
const NEIGHBOR: usize = 8;
/// Share of the sampled photons that are at least as dense: a wide ground must not count.
const SHARE: f64 = 0.25;

/// Number of a path's arrivals in one place that bring light: more are those between sheets that nearly touch, whose light nothing sees.
const MAX_ARRIVALS: u32 = 4;
/// Minimum cosine between the normals of photons of one surface.
const MIN_COSINE: f32 = 0.8;

/// Distance on a surface within which a path has one photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spacing {
    /// Square of the distance, grid cells.
    squared: f64,
}

impl Spacing {
    /// Side of the square that a photon has for itself in a map of `count` photons, by some of its first.
    pub(super) fn new(first: &[StoredPhoton], count: usize) -> Self {
        let mut areas: Vec<f64> = first
            .iter()
            .step_by(first.len().div_ceil(SAMPLED).max(1))
            .map(|photon| area(first, photon))
            .collect();
        areas.sort_by(f64::total_cmp);
        let place = (SHARE * areas.len() as f64) as usize;
        let squared = areas.get(place).map_or(0.0, |area| area * first.len() as f64 / count as f64);
        Self { squared }
    }

    /// Traced paths with one photon where several lie within the distance, on surfaces of about one normal.
    pub(super) fn merged(self, traced: Traced) -> Traced {
        let Traced { photons: all, ends, met } = traced;
        let (mut photons, mut merged_ends) = (Vec::with_capacity(all.len()), Vec::with_capacity(ends.len()));
        let mut begin = 0;
        let mut arrivals = Vec::new();
        for end in ends {
            let first = photons.len();
            arrivals.clear();
            for &photon in &all[begin as usize..end as usize] {
                let kept = photons[first..].iter().position(|kept| self.is_one(*kept, photon));
                let Some(kept) = kept else {
                    photons.push(photon);
                    arrivals.push(1);
                    continue;
                };
                arrivals[kept] += 1;
                if arrivals[kept] <= MAX_ARRIVALS {
                    photons[first + kept] = photons[first + kept].with_power_of(photon);
                }
            }
            begin = end;
            merged_ends.push(photons.len() as u32);
        }
        Traced { photons, ends: merged_ends, met }
    }

    /// True for reflected photons that lie together on one surface.
    fn is_one(self, kept: StoredPhoton, photon: StoredPhoton) -> bool {
        kept.distance_squared(photon) <= self.squared
            && !kept.is_direct()
            && !photon.is_direct()
            && kept.normal().dot(photon.normal()) >= MIN_COSINE
    }
}

/// Area of a photon, square cells, by its nearest neighbours.
fn area(photons: &[StoredPhoton], photon: &StoredPhoton) -> f64 {
    let mut distances: Vec<f64> = photons.iter().map(|other| photon.distance_squared(*other)).collect();
    let nearest = NEIGHBOR.min(distances.len() - 1);
    let (_, &mut squared, _) = distances.select_nth_unstable_by(nearest, f64::total_cmp);
    std::f64::consts::PI * squared / NEIGHBOR as f64
}
