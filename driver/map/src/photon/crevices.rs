//! Merges photons of one path that lie close together. A path that is caught between two near surfaces hits
//! them many times, and a gather there would find only the photons of this path. One photon with their power
//! replaces them, so that the gather also finds photons of other paths.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::stored::StoredPhoton;
use super::tracer::Traced;

/// Number of photons whose neighbours are searched to measure the density.
const SAMPLED: usize = 32;
/// Rank of the neighbour, from 1, whose distance measures the density.
const NEIGHBOR: usize = 8;
/// Fraction of the sampled photons at which the density is higher than the value used for all photons. It is
/// below 1/2 so that a wide ground does not dominate.
const SHARE: f64 = 0.25;
/// Maximum number of a path's arrivals at one place that contribute power. More arrivals occur only between
/// sheets that nearly touch, whose light is invisible.
const MAX_ARRIVALS: u32 = 4;
/// Minimum cosine between the normals of photons of one surface.
const MIN_COSINE: f32 = 0.8;

/// Distance on a surface within which a path keeps only one photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spacing {
    /// Squared distance, square grid cells.
    squared: f64,
}

impl Spacing {
    /// Derives the distance from the first paths: the side of the square that each photon occupies in a map
    /// with `count` photons.
    pub(super) fn new(first: &[Traced], count: usize) -> Self {
        let photons = || first.iter().flat_map(|traced| &traced.photons);
        let found = photons().count();
        let sampled: Vec<StoredPhoton> = photons().step_by(found.div_ceil(SAMPLED).max(1)).copied().collect();
        let mut areas: Vec<f64> = sampled.into_par_iter().map(|photon| area(first, photon)).collect();
        areas.sort_by(f64::total_cmp);
        let place = (SHARE * areas.len() as f64) as usize;
        let squared = areas.get(place).map_or(0.0, |area| area * found as f64 / count as f64);
        Self { squared }
    }

    /// Merges photons of each path that lie within the distance on surfaces with similar normals.
    pub(super) fn merged(self, traced: Traced) -> Traced {
        let Traced { photons: all, ends } = traced;
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
        Traced { photons, ends: merged_ends }
    }

    /// Returns whether two photons of a path lie close together on one surface, and neither came straight
    /// from a light.
    fn is_one(self, kept: StoredPhoton, photon: StoredPhoton) -> bool {
        kept.distance_squared(photon) as f64 <= self.squared
            && !kept.is_direct()
            && !photon.is_direct()
            && kept.normal().dot(photon.normal()) >= MIN_COSINE
    }
}

/// Area per photon, square grid cells, from the nearest neighbours of `photon`.
fn area(paths: &[Traced], photon: StoredPhoton) -> f64 {
    // The nearest photon is `photon` itself.
    let mut nearest = [u64::MAX; NEIGHBOR + 1];
    let mut found = 0;
    for photons in paths.iter().map(|traced| &traced.photons) {
        found += photons.len();
        for &other in photons {
            let squared = photon.distance_squared(other);
            if squared < nearest[NEIGHBOR] {
                nearest[NEIGHBOR] = squared;
                nearest.sort_unstable();
            }
        }
    }
    PI * nearest[NEIGHBOR.min(found - 1)] as f64 / NEIGHBOR as f64
}

#[cfg(test)]
mod tests {
    use photoncard_shared::layout::{FULL_DISC, Photon, PhotonGrid, Rgbe, encode_normal};

    use super::*;

    /// Photon of power 1 on a floor or a wall.
    fn photon(x: f32, normal: [f32; 3], direct: bool) -> StoredPhoton {
        let (normal, power) = (encode_normal(normal), Rgbe::encode([1.0; 3], 0));
        let position = [x, 100.0, 100.0];
        StoredPhoton::new(
            &PhotonGrid::UNIT,
            &Photon { position, power, direction: [0; 2], axis_or_group: 0, normal, disc: FULL_DISC, direct },
        )
    }

    fn merged(photons: Vec<StoredPhoton>, ends: Vec<u32>) -> Traced {
        Spacing { squared: 100.0 }.merged(Traced { photons, ends })
    }

    #[test]
    fn arrivals_of_a_path_at_one_place_merge_to_at_most_four_times_the_power() {
        let [up, aside] = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
        for (arrivals, power) in [(1_u32, 1.0), (3, 3.0), (4, 4.0), (90, 4.0)] {
            let mut photons = vec![photon(500.0, up, true)];
            for arrival in 0..arrivals {
                photons.push(photon(500.0 + (arrival % 7) as f32, up, false));
                photons.push(photon(500.0, aside, false));
            }
            let count = photons.len() as u32;
            let Traced { photons, ends } = merged(photons, vec![count, count]);
            assert_eq!(ends, vec![3, 3]);
            let powers: Vec<f64> = photons.iter().map(|photon| photon.power() / 3.0).collect();
            assert_eq!(powers, [1.0, power, power], "{arrivals} arrivals");
        }
    }

    #[test]
    fn photons_of_other_paths_and_places_are_not_merged() {
        let up = [0.0, 1.0, 0.0];
        let photons: Vec<StoredPhoton> =
            [500.0, 511.0, 522.0, 500.0, 500.0].map(|x| photon(x, up, false)).into();
        let traced = merged(photons.clone(), vec![3, 4, 5]);
        assert_eq!((traced.photons, traced.ends), (photons, vec![3, 4, 5]));
    }

    /// The photons are on a floor, eight grid cells apart.
    #[test]
    fn the_spacing_follows_from_the_number_of_photons_in_the_map() {
        let floor = |side: u32| -> Vec<StoredPhoton> {
            let at = |i: u32| StoredPhoton::at([100 + 8 * (i % side), 100, 100 + 8 * (i / side)], [0; 8]);
            (0..side * side).map(at).collect()
        };
        let photons = floor(60);
        let found = photons.len();
        let first = [Traced { photons, ends: Vec::new() }];
        for count in [found, 16 * found] {
            let side = Spacing::new(&first, count).squared.sqrt();
            let expected = 8.0 * (found as f64 / count as f64).sqrt();
            assert!((side / expected - 1.0).abs() < 0.15, "{side}, not {expected}");
        }
        assert_eq!(Spacing::new(&[], 100), Spacing { squared: 0.0 });
    }
}
