//! Distances between neighbouring photons of one surface and one light.

use std::collections::BinaryHeap;

use glam::Vec3;
use rayon::prelude::*;

use crate::photon::StoredPhoton;

/// Minimum cosine between the directions of photons of one light.
const MIN_DIRECTION_COSINE: f32 = 0.8;
/// Minimum cosine between the normals of photons of one surface.
const MIN_NORMAL_COSINE: f32 = photoncard_firmware::photon::MIN_NORMAL_COSINE;
/// Number of photons in a leaf of [`Places`].
pub(super) const LEAF: usize = 12;
/// Maximum `r / d` at which a photon takes over the neighbour distance `d` of another photon of its leaf,
/// surface and light. `r` is the distance between the two photons.
const SHARED_SHARE: f32 = 0.3;

/// Position of a photon, cells of the photon grid, and the unit vectors by which neighbours are compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) direction: Vec3,
}

impl Place {
    fn is_like(&self, other: &Self) -> bool {
        self.direction.dot(other.direction) >= MIN_DIRECTION_COSINE
            && self.normal.dot(other.normal) >= MIN_NORMAL_COSINE
    }
}

/// Bounding box of some positions.
#[derive(Clone, Copy)]
struct Bounds {
    lower: Vec3,
    upper: Vec3,
}

impl Bounds {
    const EMPTY: Self = Self { lower: Vec3::INFINITY, upper: Vec3::NEG_INFINITY };

    fn of(places: &[Place]) -> Self {
        places.iter().fold(Self::EMPTY, |bounds, place| Self {
            lower: bounds.lower.min(place.position),
            upper: bounds.upper.max(place.position),
        })
    }

    fn around(bounds: &[Self]) -> Self {
        bounds.iter().fold(Self::EMPTY, |around, bounds| Self {
            lower: around.lower.min(bounds.lower),
            upper: around.upper.max(bounds.upper),
        })
    }

    fn distance_squared(&self, position: Vec3) -> f32 {
        (position - position.clamp(self.lower, self.upper)).length_squared()
    }
}

/// Sorts photons into the order of the kd-tree [`Places`]. Photons are split across the longest side of their
/// box into two runs of whole leaves, and runs are split again down to single leaves. Only the last leaf may
/// have fewer than [`LEAF`] photons.
pub(super) fn arrange(photons: &mut [StoredPhoton]) {
    let leaves = photons.len().div_ceil(LEAF);
    if leaves < 2 {
        // The order of a leaf must not depend on how larger parts were halved.
        photons.sort_unstable();
        return;
    }
    let middle = LEAF * leaves.next_power_of_two() / 2;
    let side = |axis: &usize| {
        let coordinates = || photons.iter().map(|photon| photon.coordinate(*axis));
        coordinates().max().unwrap_or(0) - coordinates().min().unwrap_or(0)
    };
    let axis = (0..3).max_by_key(side).unwrap_or(0);
    photons.select_nth_unstable_by_key(middle, |photon| (photon.coordinate(axis), *photon));
    let (below, above) = photons.split_at_mut(middle);
    rayon::join(|| arrange(below), || arrange(above));
}

/// Photon positions in a binary tree of boxes.
pub(super) struct Places {
    places: Vec<Place>,
    /// Boxes of runs of [`LEAF`] positions, then boxes of pairs of these, and so on up to the root.
    levels: Vec<Vec<Bounds>>,
}

impl Places {
    /// Builds the tree of positions in the order of [`arrange`].
    pub(super) fn new(places: Vec<Place>) -> Self {
        let mut levels: Vec<Vec<Bounds>> = vec![places.chunks(LEAF).map(Bounds::of).collect()];
        while let Some(below) = levels.last().filter(|below| below.len() > 1) {
            levels.push(below.chunks(2).map(Bounds::around).collect());
        }
        Self { places, levels }
    }

    /// Returns true if two photons are of one surface and light.
    pub(super) fn are_alike(&self, first: usize, second: usize) -> bool {
        self.places[first].is_like(&self.places[second])
    }

    /// Returns, for each photon, the distance to its `number`-th nearest neighbour on its surface and of its
    /// light, cells. The result is `limit` if there are fewer neighbours within `limit`. A photon can reuse
    /// the distance of a nearby photon ([`SHARED_SHARE`]).
    pub(super) fn distances(&self, number: usize, limit: f32) -> Vec<f32> {
        let leaves = self.places.par_chunks(LEAF).enumerate();
        leaves.flat_map_iter(|(leaf, places)| self.distances_of_leaf(leaf, places, number, limit)).collect()
    }

    /// Returns the distances of [`Self::distances`] for the photons of one leaf.
    fn distances_of_leaf(&self, leaf: usize, places: &[Place], number: usize, limit: f32) -> Vec<f32> {
        let mut found: Vec<(&Place, f32)> = Vec::new();
        let mut distances = Vec::with_capacity(places.len());
        for (index, own) in (leaf * LEAF..).zip(places) {
            let near = found.iter().find(|(other, distance)| {
                own.is_like(other) && own.position.distance(other.position) <= SHARED_SHARE * distance
            });
            let distance = near.map(|(_, distance)| *distance).unwrap_or_else(|| {
                let distance = self.distance_of_neighbor(index, number, limit);
                found.push((own, distance));
                distance
            });
            distances.push(distance);
        }
        distances
    }

    /// Returns the distance from one photon to its `number`-th nearest neighbour on its surface and of its
    /// light; `limit` if there are fewer neighbours within `limit`.
    fn distance_of_neighbor(&self, index: usize, number: usize, limit: f32) -> f32 {
        let nearest = self.nearest(index, number, limit);
        nearest.get(number - 1).map_or(limit, |(squared, _)| squared.sqrt())
    }

    /// Finds the nearest photons on a photon's surface and of its light: at most `number`, and nearer than
    /// `limit` cells. Returns their squared distances, ascending, and their indices.
    pub(super) fn nearest(&self, index: usize, number: usize, limit: f32) -> Vec<(f32, usize)> {
        let own = &self.places[index];
        let mut limit = limit * limit;
        // Heap of the smallest squared distances found, with the photons' indices. The greatest is on top.
        // The bits of positive floats are ordered as the floats.
        let mut nearest = BinaryHeap::with_capacity(number);
        // Stack of boxes to visit: the squared distance, level and index of each.
        let mut waiting = vec![(0.0, self.levels.len() - 1, 0)];
        while let Some((distance, level, node)) = waiting.pop() {
            if distance >= limit {
                continue;
            }
            if level > 0 {
                let below = self.levels[level - 1].iter().enumerate().skip(2 * node).take(2);
                let parts =
                    below.map(|(part, bounds)| (bounds.distance_squared(own.position), level - 1, part));
                let first = waiting.len();
                waiting.extend(parts);
                // The nearer box is put on top of the stack.
                waiting[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
                continue;
            }
            for (other, place) in (node * LEAF..).zip(self.places[node * LEAF..].iter().take(LEAF)) {
                let squared = place.position.distance_squared(own.position);
                if squared < limit && other != index && own.is_like(place) {
                    let found = (squared.to_bits(), other);
                    if nearest.len() < number {
                        nearest.push(found);
                    } else if let Some(mut greatest) = nearest.peek_mut() {
                        *greatest = found;
                    }
                    if nearest.len() == number {
                        limit = nearest.peek().map_or(limit, |&(greatest, _)| f32::from_bits(greatest));
                    }
                }
            }
        }
        nearest
            .into_sorted_vec()
            .into_iter()
            .map(|(squared, other)| (f32::from_bits(squared), other))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;

    use super::*;

    #[test]
    fn neighbor_distances_equal_those_of_an_exhaustive_search() {
        let number = |index: u32| (hash(index) >> 8) as f32 / 16_777_216.0;
        let places: Vec<Place> = (0..2000)
            .map(|index| Place {
                position: Vec3::new(number(4 * index), number(4 * index + 1), number(4 * index + 2)) * 1000.0,
                normal: Vec3::Y,
                direction: if number(4 * index + 3) < 0.3 { Vec3::Y } else { Vec3::X },
            })
            .collect();
        let tree = Places::new(places.clone());
        for index in (0..places.len()).step_by(37) {
            let own = &places[index];
            let others =
                places.iter().enumerate().filter(|(other, place)| *other != index && own.is_like(place));
            let mut distances: Vec<f32> =
                others.map(|(_, place)| place.position.distance(own.position)).collect();
            distances.sort_by(f32::total_cmp);
            for number in [1, 5, 16] {
                assert!((tree.distance_of_neighbor(index, number, 1e6) - distances[number - 1]).abs() < 1e-2);
            }
            let limit = 0.5 * distances[4];
            assert!((tree.distance_of_neighbor(index, 5, limit) / limit - 1.0).abs() < 1e-6);
        }
        for (index, distance) in tree.distances(16, 1e6).into_iter().enumerate() {
            let own = tree.distance_of_neighbor(index, 16, 1e6);
            assert!((distance / own - 1.0).abs() <= SHARED_SHARE / (1.0 - SHARED_SHARE), "{distance} {own}");
        }
    }
}
