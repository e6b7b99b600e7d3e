//! The left-balanced kd-tree (Jensen 2001, ch. 6): the tree of its photons without gaps, in the order of a heap.

use photoncard_firmware::sampler::hash;
use photoncard_shared::layout::{FULL_DISC, Photon, PhotonGrid, Record, Rgbe, power_of_two_above};
use rayon::prelude::*;

use super::Arrival;

/// Below this number of photons a subtree is built by one thread.
const SEQUENTIAL: usize = 4096;

/// A photon map in the order of its tree.
pub struct PhotonMap {
    photons: Vec<Photon>,
    grid: PhotonGrid,
    power_unit: f32,
}

/// A photon being sorted.
#[derive(Clone, Copy)]
struct Node {
    position: [f32; 3],
    /// Index of the arrival.
    arrival: u32,
    axis: u8,
}

impl PhotonMap {
    /// Builds the tree: the same for the same arrivals, whatever the threads. Positions are put on the grid, so that every
    /// layout of the map can tell them exactly.
    ///
    /// # Panics
    /// If there are 2^32 arrivals or more; `--photons` does not allow so many.
    pub fn new(arrivals: &[Arrival], grid: PhotonGrid) -> Self {
        assert!(u32::try_from(arrivals.len()).is_ok(), "more photons than 32 bits tell apart");
        let on_grid = |place| grid.position(grid.nearest(place));
        let mut nodes: Vec<Node> = (0_u32..)
            .zip(arrivals)
            .map(|(arrival, a)| Node { position: on_grid(a.position), arrival, axis: 0 })
            .collect();
        balance(&mut nodes);
        let strongest = arrivals.iter().flat_map(|arrival| arrival.power).fold(0.0, f32::max);
        let power_unit = power_of_two_above(strongest as f64);
        let order = heap_order(nodes.len());
        let photons =
            order.par_iter().map(|&place| record(&nodes[place as usize], arrivals, power_unit)).collect();
        Self { photons, grid, power_unit }
    }

    /// The grid that positions are on.
    pub fn grid(&self) -> PhotonGrid {
        self.grid
    }

    /// Watts that a photon power of 1 stands for.
    pub fn power_unit(&self) -> f32 {
        self.power_unit
    }

    /// Photons, the children of `i` at `2 i + 1` and `2 i + 2`.
    pub fn photons(&self) -> &[Photon] {
        &self.photons
    }

    /// The records of the card image.
    pub fn records(&self) -> impl ExactSizeIterator<Item = [u8; Photon::BYTES]> {
        self.photons.iter().map(Photon::to_bytes)
    }
}

fn record(node: &Node, arrivals: &[Arrival], power_unit: f32) -> Photon {
    let arrival = &arrivals[node.arrival as usize];
    Photon {
        position: node.position,
        power: Rgbe::encode(arrival.power.map(|p| p / power_unit), hash(node.arrival)),
        direction: arrival.direction,
        axis: node.axis,
        normal: arrival.normal,
        disc: FULL_DISC,
        direct: arrival.direct,
    }
}

/// Nodes in the left subtree of a left-balanced tree of `count` nodes, at least one.
fn left_nodes(count: usize) -> usize {
    let last_level = 1 << count.ilog2();
    let in_last_level = count - (last_level - 1);
    (last_level / 2).saturating_sub(1) + in_last_level.min(last_level / 2)
}

/// Sorts nodes so that every subtree is a run, its left subtree first, its root next: from left to right. Each is
/// split along the longest side of its bounding box.
fn balance(nodes: &mut [Node]) {
    if nodes.len() < 2 {
        return;
    }
    let axis = longest_side(nodes);
    let middle = left_nodes(nodes.len());
    let place = |node: &Node| node.position[axis];
    let (left, root, right) = nodes
        .select_nth_unstable_by(middle, |a, b| place(a).total_cmp(&place(b)).then(a.arrival.cmp(&b.arrival)));
    root.axis = axis as u8;
    if left.len() > SEQUENTIAL {
        rayon::join(|| balance(left), || balance(right));
    } else {
        balance(left);
        balance(right);
    }
}

fn longest_side(nodes: &[Node]) -> usize {
    let mut lower = [f32::INFINITY; 3];
    let mut upper = [f32::NEG_INFINITY; 3];
    for node in nodes {
        for axis in 0..3 {
            lower[axis] = lower[axis].min(node.position[axis]);
            upper[axis] = upper[axis].max(node.position[axis]);
        }
    }
    let side = |axis: &usize| upper[*axis] - lower[*axis];
    (0..3).max_by(|a, b| side(a).total_cmp(&side(b))).unwrap_or(0)
}

/// For every node in heap order, its place from left to right.
fn heap_order(count: usize) -> Vec<u32> {
    let mut runs: Vec<(u32, u32)> = vec![(0, 0); count];
    let mut order = vec![0; count];
    if let Some(root) = runs.first_mut() {
        *root = (0, count as u32);
    }
    for node in 0..count {
        let (first, length) = runs[node];
        let left = left_nodes(length as usize) as u32;
        order[node] = first + left;
        let halves = [(first, left), (first + left + 1, length - left - 1)];
        for (child, half) in (2 * node + 1..).zip(halves) {
            if let Some(run) = runs.get_mut(child) {
                *run = half;
            }
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrivals(count: u32) -> Vec<Arrival> {
        let coordinate = |i: u32, salt: u32| {
            let bits = photoncard_firmware::sampler::hash(i.wrapping_mul(3).wrapping_add(salt));
            (bits >> 8) as f32 / 16_777_216.0
        };
        (0..count)
            .map(|i| Arrival {
                position: [coordinate(i, 0), coordinate(i, 1), 0.1 * coordinate(i, 2)],
                power: [1.0, 0.5, 0.25],
                direction: [0, 0],
                normal: 0,
                direct: false,
            })
            .collect()
    }

    fn check(photons: &[Photon], node: usize, lower: [f32; 3], upper: [f32; 3]) -> usize {
        let Some(photon) = photons.get(node) else { return 0 };
        for axis in 0..3 {
            assert!((lower[axis]..=upper[axis]).contains(&photon.position[axis]));
        }
        let axis = photon.axis as usize;
        let (mut below, mut above) = (upper, lower);
        below[axis] = photon.position[axis];
        above[axis] = photon.position[axis];
        1 + check(photons, 2 * node + 1, lower, below) + check(photons, 2 * node + 2, above, upper)
    }

    #[test]
    fn every_subtree_lies_on_its_side_of_every_plane() {
        for count in [1, 2, 3, 6, 7, 8, 100, 1000, 20_000] {
            let map = PhotonMap::new(&arrivals(count), PhotonGrid::around([0.0; 3], [1.0; 3]));
            let all = check(map.photons(), 0, [f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
            assert_eq!(all, count as usize);
        }
    }

    #[test]
    fn left_subtrees_fill_the_last_level_from_the_left() {
        let expected = [0, 1, 1, 2, 3, 3, 3, 4, 5, 6, 7, 7];
        for (count, left) in (1..).zip(expected) {
            assert_eq!(left_nodes(count), left, "{count}");
        }
    }
}
