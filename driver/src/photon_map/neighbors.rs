//! Distances of neighbours among photons of one surface and one light.

use glam::Vec3;
use rayon::prelude::*;

/// Minimum cosine between the directions of photons of one light.
const MIN_DIRECTION_COSINE: f32 = 0.8;
/// Minimum cosine between the normals of photons of one surface.
const MIN_NORMAL_COSINE: f32 = photoncard_firmware::photon::MIN_NORMAL_COSINE;
/// Maximum number of places of a leaf.
const LEAF: usize = 12;
/// Share of a distance within which places of a leaf have it in common.
const SHARED_SHARE: f32 = 0.3;

/// A photon's place, cells of the photon grid, and the unit vectors that neighbours share.
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

/// Places in a tree of boxes.
pub(super) struct Places {
    places: Vec<Place>,
    /// Indices of places in the order of the tree.
    order: Vec<u32>,
    /// The root first, and the first part of a node right after it.
    nodes: Vec<Node>,
}

/// A node of the tree: places `first..last` of the order.
struct Node {
    lower: Vec3,
    upper: Vec3,
    first: u32,
    last: u32,
    /// Index of the second part; 0 for a leaf.
    second: u32,
}

impl Node {
    fn distance_squared(&self, position: Vec3) -> f32 {
        (position - position.clamp(self.lower, self.upper)).length_squared()
    }
}

impl Places {
    pub(super) fn new(places: Vec<Place>) -> Self {
        let order = (0..places.len() as u32).collect();
        let mut tree = Self { places, order, nodes: Vec::new() };
        if !tree.places.is_empty() {
            tree.divide(0, tree.places.len());
        }
        tree
    }

    /// Adds the node of places `first..last` with its parts.
    fn divide(&mut self, first: usize, last: usize) {
        let positions = || self.order[first..last].iter().map(|&index| self.places[index as usize].position);
        let lower = positions().fold(Vec3::INFINITY, Vec3::min);
        let upper = positions().fold(Vec3::NEG_INFINITY, Vec3::max);
        let node = self.nodes.len();
        self.nodes.push(Node { lower, upper, first: first as u32, last: last as u32, second: 0 });
        if last - first <= LEAF {
            return;
        }
        let axis = (upper - lower).max_position();
        let middle = first + (last - first) / 2;
        let Self { places, order, .. } = self;
        order[first..last].select_nth_unstable_by(middle - first, |&a, &b| {
            let [at_a, at_b] = [a, b].map(|index| places[index as usize].position[axis]);
            at_a.total_cmp(&at_b).then(a.cmp(&b))
        });
        self.divide(first, middle);
        self.nodes[node].second = self.nodes.len() as u32;
        self.divide(middle, last);
    }

    /// Distance of the neighbour of a number, from 1 on, of each place among those like it, or of one near it; `limit` if there are fewer
    /// within it. For places that are [`SHARED_SHARE`] of such a distance apart they differ by that share at most.
    pub(super) fn distances(&self, number: usize, limit: f32) -> Vec<f32> {
        let leaves: Vec<&[u32]> =
            self.nodes.iter().filter(|node| node.second == 0).map(|node| self.of(node)).collect();
        let of_leaves: Vec<Vec<f32>> =
            leaves.par_iter().map(|leaf| self.distances_of_leaf(leaf, number, limit)).collect();
        let mut distances = vec![limit; self.places.len()];
        for (leaf, of_leaf) in leaves.into_iter().zip(of_leaves) {
            for (&index, distance) in leaf.iter().zip(of_leaf) {
                distances[index as usize] = distance;
            }
        }
        distances
    }

    /// [`Self::distances`] of the places of a leaf.
    fn distances_of_leaf(&self, leaf: &[u32], number: usize, limit: f32) -> Vec<f32> {
        let mut found: Vec<(&Place, f32)> = Vec::new();
        let distance = |&index: &u32| {
            let own = &self.places[index as usize];
            let near = found.iter().find(|(other, distance)| {
                own.is_like(other) && own.position.distance(other.position) <= SHARED_SHARE * distance
            });
            near.map(|(_, distance)| *distance).unwrap_or_else(|| {
                let distance = self.distance_of_neighbor(index as usize, number, limit);
                found.push((own, distance));
                distance
            })
        };
        leaf.iter().map(distance).collect()
    }

    fn of(&self, node: &Node) -> &[u32] {
        &self.order[node.first as usize..node.last as usize]
    }

    /// Distance of a place's neighbour of a number, from 1 on, among those like it; `limit` if there are fewer within it.
    fn distance_of_neighbor(&self, index: usize, number: usize, limit: f32) -> f32 {
        let own = &self.places[index];
        // The squared distances found so far, in ascending order.
        let mut nearest = vec![limit * limit; number.max(1)];
        let mut waiting = vec![0];
        while let Some(node) = waiting.pop() {
            let second = self.nodes[node].second;
            if self.nodes[node].distance_squared(own.position) >= nearest[number - 1] {
                continue;
            }
            if second > 0 {
                let parts = [node + 1, second as usize];
                let [a, b] = parts.map(|part| self.nodes[part].distance_squared(own.position));
                // The nearer part is the last, and visited first.
                waiting.extend(if a < b { [parts[1], parts[0]] } else { parts });
                continue;
            }
            for &other in self.of(&self.nodes[node]) {
                let place = &self.places[other as usize];
                let squared = place.position.distance_squared(own.position);
                if squared < nearest[number - 1] && other as usize != index && own.is_like(place) {
                    let at = nearest.partition_point(|&nearer| nearer <= squared);
                    nearest.pop();
                    nearest.insert(at, squared);
                }
            }
        }
        nearest[number - 1].sqrt()
    }
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;

    use super::*;

    #[test]
    fn a_neighbor_is_that_of_a_search_of_all() {
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
