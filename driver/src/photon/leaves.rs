//! The photon map in lines: leaves that fill a line each, split where a search is least likely to need both sides, and
//! inner nodes of up to sixteen children, a line each.
//!
//! A plane is chosen by the voxel volume heuristic (Wald, Günther, Slusallek 2004, *Balancing considered harmful*): the
//! chance that a search reaches a part of space grows with its volume, blown up by the search's radius. Numbers of photons
//! are kept to whole leaves, so that lines are full. The binary tree is then folded into wide nodes so that a search
//! reads the fewest of them, by the same measure.

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::PHOTON_STACK;
use photoncard_shared::layout::{
    GridBox, LEAF_PHOTONS, PHOTON_CONTENT_BYTES, PhotonLeaf, PhotonNode, leaf_capacity,
};

use crate::fold::{Folded, Tree};

/// A photon's grid point, and what else it carries.
pub(crate) type Placed = ([u32; 3], [u8; PHOTON_CONTENT_BYTES]);
type LineBytes = [u8; LINE_BYTES];

/// Below this number of photons a subtree is built by one thread.
const SEQUENTIAL: usize = 4096;
/// Intervals of a side between which planes are tried.
const INTERVALS: usize = 32;
/// Photons from which on a part of space is expected to end in leaves of one surface.
const MANY: usize = 64;
/// Levels of a binary tree from which on it is halved.
const MOST_SKEWED: usize = 40;

/// The lines of both sections.
#[derive(Debug, Default)]
pub(crate) struct PhotonLines {
    pub(crate) nodes: Vec<LineBytes>,
    pub(crate) leaves: Vec<LineBytes>,
}

/// A part of the tree: a leaf's line.
type PhotonTree = Tree<Box<LineBytes>, Extent>;

impl PhotonLines {
    /// Of photons in any order, for searches of about `radius` cells: the same lines for the same photons in the same
    /// order, whatever the threads.
    pub(crate) fn new(photons: &mut [Placed], radius: f64) -> Self {
        if photons.is_empty() {
            return Self::default();
        }
        let mut folded = Folded::new(build(photons, radius, 0));
        if folded.stack > PHOTON_STACK {
            // Halves of halves are not the best of trees, but no deeper than their number asks for.
            folded = Folded::new(build(photons, radius, MOST_SKEWED));
        }
        let nodes = folded.nodes.into_iter().map(|node| {
            let boxes: Vec<GridBox> = node.children.iter().map(|extent| extent.0).collect();
            PhotonNode::encode(&boxes, node.links)
                .unwrap_or_else(|| unreachable!("a node of {} children", boxes.len()))
        });
        Self { nodes: nodes.collect(), leaves: folded.leaves.into_iter().map(|line| *line).collect() }
    }
}

fn build(photons: &mut [Placed], radius: f64, depth: usize) -> PhotonTree {
    let extent = Extent::new(photons);
    if photons.len() <= LEAF_PHOTONS
        && let Some(line) = PhotonLeaf::encode(photons)
    {
        return Tree::leaf(Box::new(line), extent, 0.0);
    }
    let (axis, count) = if depth < MOST_SKEWED {
        extent.split(photons, radius)
    } else {
        (extent.longest(), photons.len() / 2)
    };
    let (below, ..) = photons.select_nth_unstable_by_key(count, |(point, content)| {
        let [x, y, z] = *point;
        (point[axis], x, y, z, *content)
    });
    let middle = below.len();
    let (below, above) = photons.split_at_mut(middle);
    let children = if below.len().max(above.len()) > SEQUENTIAL {
        let (below, above) =
            rayon::join(|| build(below, radius, depth + 1), || build(above, radius, depth + 1));
        [below, above]
    } else {
        [build(below, radius, depth + 1), build(above, radius, depth + 1)]
    };
    Tree::node(children, extent, extent.chance(radius) as f32, None)
}

/// The box of some photons.
#[derive(Clone, Copy)]
struct Extent(GridBox);

impl Extent {
    fn new(photons: &[Placed]) -> Self {
        let mut extent = GridBox { lower: [u32::MAX; 3], upper: [0; 3] };
        for (point, _) in photons {
            let sides = extent.lower.iter_mut().zip(&mut extent.upper);
            for ((lower, upper), &coordinate) in sides.zip(point) {
                *lower = coordinate.min(*lower);
                *upper = coordinate.max(*upper);
            }
        }
        Self(extent)
    }

    fn side(&self, axis: usize) -> u32 {
        self.0.upper[axis] - self.0.lower[axis]
    }

    fn longest(&self) -> usize {
        // The first of equal sides.
        (0..3).rev().max_by_key(|&axis| self.side(axis)).unwrap_or(0)
    }

    /// A measure of the chance that a search reaches it.
    fn chance(&self, radius: f64) -> f64 {
        chance([0, 1, 2].map(|axis| f64::from(self.side(axis))), radius)
    }

    /// Photons of a leaf somewhere in here, about.
    fn leaf_photons(&self, photons: usize) -> usize {
        let axes = (0..3).filter(|&axis| self.side(axis) > 0).count();
        // Photons lie on surfaces; many on several, few on one, that may well be oblique.
        leaf_capacity(if photons > MANY { axes.min(2) } else { axes })
    }

    /// The axis to split on, and how many photons go below the plane: a whole number of leaves, if there is more than one.
    fn split(&self, photons: &[Placed], radius: f64) -> (usize, usize) {
        let (axis, below) = self.cheapest(photons, radius);
        let count = photons.len();
        let leaf = self.leaf_photons(count);
        if count <= leaf + 1 {
            return (axis, count / 2);
        }
        let most = (count - 1) / leaf * leaf;
        (axis, (below + leaf / 2).next_multiple_of(leaf).saturating_sub(leaf).clamp(leaf, most))
    }

    /// The plane of least cost by the voxel volume heuristic: its axis, and the photons below it.
    fn cheapest(&self, photons: &[Placed], radius: f64) -> (usize, usize) {
        let mut cheapest = (f64::INFINITY, self.longest(), photons.len() / 2);
        for axis in (0..3).filter(|&axis| self.side(axis) > 0) {
            let mut counts = [0_usize; INTERVALS];
            let interval = |point: u32| {
                (u64::from(point - self.0.lower[axis]) * INTERVALS as u64 / (u64::from(self.side(axis)) + 1))
                    as usize
            };
            photons.iter().for_each(|(point, _)| counts[interval(point[axis])] += 1);
            let mut below = 0;
            for (plane, count) in (1..INTERVALS).zip(counts) {
                below += count;
                let share = plane as f64 / INTERVALS as f64;
                let part = |share: f64| {
                    let side = |a| f64::from(self.side(a)) * if a == axis { share } else { 1.0 };
                    chance([0, 1, 2].map(side), radius)
                };
                let above = photons.len() - below;
                let cost = part(share) * below as f64 + part(1.0 - share) * above as f64;
                if cost < cheapest.0 && below > 0 && above > 0 {
                    cheapest = (cost, axis, below);
                }
            }
        }
        (cheapest.1, cheapest.2)
    }
}

/// The volume of a box blown up by the radius of searches.
fn chance(sides: [f64; 3], radius: f64) -> f64 {
    sides.into_iter().map(|side| side + 2.0 * radius).product()
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;
    use photoncard_shared::layout::{Child, WideNode};

    use super::*;

    /// Photons on the walls of a box: each carries its number.
    fn photons(count: u32, bits: u32) -> Vec<Placed> {
        (0..count)
            .map(|i| {
                let mut point = [0, 1, 2].map(|k| hash(hash(i).wrapping_add(k)) & ((1 << bits) - 1));
                point[(i % 3) as usize] = 0;
                (point, u64::from(i).to_le_bytes())
            })
            .collect()
    }

    /// Every photon below `child`, each within the boxes that the nodes above give; returns the entries of a stack that
    /// a search may need.
    fn walk(lines: &PhotonLines, child: Child, room: GridBox, found: &mut Vec<Placed>) -> usize {
        let node = match child {
            Child::Leaf(leaf) => {
                let leaf = PhotonLeaf::read(&lines.leaves[leaf as usize]);
                for index in 0..leaf.photons() {
                    let point = leaf.point(index);
                    assert!(room.contains(&GridBox::of(point)));
                    found.push((point, leaf.content(index)));
                }
                return 1;
            }
            Child::Node(node) => &lines.nodes[node as usize],
        };
        let children = WideNode(node).children() as usize;
        let deepest = (0..children).map(|child| {
            let sides = PhotonNode(node).coordinates().map(|axis| axis.sides(child).expect("a child"));
            let room = GridBox { lower: sides.map(|[lower, _]| lower), upper: sides.map(|[_, upper]| upper) };
            walk(lines, WideNode(node).links().child(child as u32), room, found)
        });
        (children - 1 + deepest.max().unwrap_or(0)).max(children)
    }

    #[test]
    fn every_photon_is_in_one_leaf_and_in_the_boxes_of_every_node_above_it() {
        for (count, bits) in [(1, 20), (10, 20), (15, 20), (1000, 20), (1000, 2), (30_000, 20), (5000, 0)] {
            let mut sorted = photons(count, bits);
            let lines = PhotonLines::new(&mut sorted.clone(), 1000.0);
            let everything = GridBox { lower: [0; 3], upper: [u32::MAX; 3] };
            let mut found = Vec::new();
            let stack = walk(&lines, Child::Node(0), everything, &mut found);
            assert!(stack <= PHOTON_STACK, "{stack}");
            found.sort_unstable();
            sorted.sort_unstable();
            assert!(found == sorted, "{count} photons on {bits} bits");
        }
    }

    #[test]
    fn lines_are_mostly_full() {
        let count = 100_000;
        let lines = PhotonLines::new(&mut photons(count, 20), 10_000.0);
        let photons = f64::from(count) / lines.leaves.len() as f64;
        let children = (lines.leaves.len() + lines.nodes.len() - 1) as f64 / lines.nodes.len() as f64;
        println!("{photons} photons a leaf, {children} children a node");
        assert!(photons > 9.0, "{photons} photons a leaf");
        assert!(children > 10.0, "{children} children a node");
    }
}
