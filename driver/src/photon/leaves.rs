//! The photon map in lines: leaves that fill a line each, split where a search is least likely to need both sides, and inner
//! nodes packed into treelets of a line.
//!
//! A plane is chosen by the voxel volume heuristic (Wald, Günther, Slusallek 2004, *Balancing considered harmful*): the
//! chance that a search reaches a part of space grows with its volume, blown up by the search's radius. Numbers of photons
//! are kept to whole leaves, so that lines are full.

use std::collections::VecDeque;

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::PHOTON_STACK;
use photoncard_shared::layout::{
    GRID_BITS, LEAF_PHOTONS, PHOTON_CONTENT_BYTES, PhotonChild, PhotonLeaf, PhotonNode, PhotonTreelet,
    TREELET_NODES,
};

/// A photon's grid point, and what else it carries.
pub(crate) type Placed = ([u32; 3], [u8; PHOTON_CONTENT_BYTES]);
type LineBytes = [u8; LINE_BYTES];

/// Below this number of photons a subtree is built by one thread.
const SEQUENTIAL: usize = 4096;
/// Intervals of a side between which planes are tried.
const INTERVALS: usize = 32;
/// Bits of a leaf that photons and contents share, about.
const LEAF_BITS: u32 = 8 * LINE_BYTES as u32 - 80;

/// The lines of both sections.
#[derive(Debug, Default)]
pub(crate) struct PhotonLines {
    pub(crate) treelets: Vec<LineBytes>,
    pub(crate) leaves: Vec<LineBytes>,
}

/// The tree before it is packed.
enum Tree {
    Leaf(Box<LineBytes>),
    Node(Box<TreeNode>),
}

struct TreeNode {
    axis: u8,
    plane: u32,
    children: [Tree; 2],
    /// Whether a treelet begins here.
    is_root: bool,
}

impl PhotonLines {
    /// Of photons in any order, for searches of about `radius` cells: the same lines for the same photons in the same
    /// order, whatever the threads.
    pub(crate) fn new(photons: &mut [Placed], radius: f64) -> Self {
        let mut lines = Self::default();
        if photons.is_empty() {
            return lines;
        }
        let mut tree = build(photons, radius, 0);
        mark_treelets(&mut tree);
        lines.pack(tree);
        lines
    }

    /// Numbers treelets in the order of their parents, and the leaves of a treelet one after the other.
    fn pack(&mut self, tree: Tree) {
        let root = match tree {
            Tree::Leaf(line) => return self.leaves.push(*line),
            Tree::Node(root) => root,
        };
        let mut waiting = VecDeque::from([*root]);
        while let Some(root) = waiting.pop_front() {
            let first_leaf = self.leaves.len() as u32;
            let first_treelet = (self.treelets.len() + 1 + waiting.len()) as u32;
            let mut nodes = Vec::with_capacity(TREELET_NODES);
            self.gather(root, &mut nodes, first_treelet - waiting.len() as u32, &mut waiting);
            let line = PhotonTreelet::encode(&nodes, first_leaf, first_treelet);
            // `mark_treelets` has cut the tree so that every treelet fits.
            self.treelets.push(line.unwrap_or_else(|| unreachable!("a treelet of {} nodes", nodes.len())));
        }
    }

    /// Adds a node and what follows it in its treelet; returns its index there. `next_treelet` is the number of the first
    /// treelet that waits.
    fn gather(
        &mut self,
        node: TreeNode,
        nodes: &mut Vec<PhotonNode>,
        next_treelet: u32,
        waiting: &mut VecDeque<TreeNode>,
    ) -> u8 {
        let index = nodes.len();
        let TreeNode { axis, plane, children, .. } = node;
        nodes.push(PhotonNode { axis, plane, children: [PhotonChild::Node(0); 2] });
        for (side, child) in children.into_iter().enumerate() {
            let child = match child {
                Tree::Leaf(line) => {
                    self.leaves.push(*line);
                    PhotonChild::Leaf(self.leaves.len() as u32 - 1)
                }
                Tree::Node(node) if node.is_root => {
                    waiting.push_back(*node);
                    PhotonChild::Treelet(next_treelet + waiting.len() as u32 - 1)
                }
                Tree::Node(node) => PhotonChild::Node(self.gather(*node, nodes, next_treelet, waiting)),
            };
            nodes[index].children[side] = child;
        }
        index as u8
    }
}

/// Cuts the tree into treelets from the leaves up. Returns the nodes of the treelet that the subtree's root is in.
fn mark_treelets(tree: &mut Tree) -> usize {
    let Tree::Node(node) = tree else { return 0 };
    let mut open = [0; 2];
    for (open, child) in open.iter_mut().zip(&mut node.children) {
        *open = mark_treelets(child);
    }
    while 1 + open.iter().sum::<usize>() > TREELET_NODES {
        let larger = usize::from(open[1] > open[0]);
        if let Tree::Node(child) = &mut node.children[larger] {
            child.is_root = true;
        }
        open[larger] = 0;
    }
    1 + open.iter().sum::<usize>()
}

fn build(photons: &mut [Placed], radius: f64, depth: usize) -> Tree {
    if photons.len() <= LEAF_PHOTONS
        && let Some(line) = PhotonLeaf::encode(photons)
    {
        return Tree::Leaf(Box::new(line));
    }
    let extent = Extent::new(photons);
    // What is left of the chip's stack must do for halves.
    let levels = photons.len().ilog2() as usize + 1;
    let (axis, count) = if depth + levels < PHOTON_STACK {
        extent.split(photons, radius)
    } else {
        (extent.longest(), photons.len() / 2)
    };
    let (below, middle, _) = photons.select_nth_unstable_by_key(count, |(point, content)| {
        let [x, y, z] = *point;
        (point[axis], x, y, z, *content)
    });
    let (plane, middle) = (middle.0[axis], below.len());
    let (below, above) = photons.split_at_mut(middle);
    let children = if below.len().max(above.len()) > SEQUENTIAL {
        let (below, above) =
            rayon::join(|| build(below, radius, depth + 1), || build(above, radius, depth + 1));
        [below, above]
    } else {
        [build(below, radius, depth + 1), build(above, radius, depth + 1)]
    };
    Tree::Node(Box::new(TreeNode { axis: axis as u8, plane, children, is_root: false }))
}

/// The box of some photons, on the grid.
#[derive(Clone, Copy)]
struct Extent {
    lower: [u32; 3],
    upper: [u32; 3],
}

impl Extent {
    fn new(photons: &[Placed]) -> Self {
        let mut extent = Self { lower: [u32::MAX; 3], upper: [0; 3] };
        for (point, _) in photons {
            let sides = extent.lower.iter_mut().zip(&mut extent.upper);
            for ((lower, upper), &coordinate) in sides.zip(point) {
                *lower = coordinate.min(*lower);
                *upper = coordinate.max(*upper);
            }
        }
        extent
    }

    fn side(&self, axis: usize) -> u32 {
        self.upper[axis] - self.lower[axis]
    }

    fn longest(&self) -> usize {
        // The first of equal sides.
        (0..3).rev().max_by_key(|&axis| self.side(axis)).unwrap_or(0)
    }

    /// Photons of a leaf somewhere in here, about: every halving on the way to it takes a bit off a coordinate.
    fn leaf_photons(&self, photons: usize) -> usize {
        let bits: u32 = (0..3).map(|axis| GRID_BITS.min(u32::BITS - self.side(axis).leading_zeros())).sum();
        let halvings = (photons / LEAF_PHOTONS).max(1).ilog2();
        let photon_bits = bits.saturating_sub(halvings) + 8 * PHOTON_CONTENT_BYTES as u32;
        ((LEAF_BITS / photon_bits) as usize).clamp(1, LEAF_PHOTONS)
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
        let volume = |sides: [f64; 3]| sides.into_iter().map(|side| side + 2.0 * radius).product::<f64>();
        let mut cheapest = (f64::INFINITY, self.longest(), photons.len() / 2);
        for axis in (0..3).filter(|&axis| self.side(axis) > 0) {
            let mut counts = [0_usize; INTERVALS];
            let interval = |point: u32| {
                (u64::from(point - self.lower[axis]) * INTERVALS as u64 / (u64::from(self.side(axis)) + 1))
                    as usize
            };
            photons.iter().for_each(|(point, _)| counts[interval(point[axis])] += 1);
            let mut below = 0;
            for (plane, count) in (1..INTERVALS).zip(counts) {
                below += count;
                let share = plane as f64 / INTERVALS as f64;
                let part = |share: f64| {
                    volume([0, 1, 2].map(|a| f64::from(self.side(a)) * if a == axis { share } else { 1.0 }))
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

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;

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

    /// Every photon below `child`, each within the box that the planes above leave it.
    fn walk(lines: &PhotonLines, child: PhotonChild, treelet: u32, room: Extent, found: &mut Vec<Placed>) {
        let (treelet, node) = match child {
            PhotonChild::Leaf(leaf) => {
                let leaf = PhotonLeaf::read(&lines.leaves[leaf as usize]);
                for index in 0..leaf.photons() {
                    let point = leaf.point(index);
                    assert!((0..3).all(|a| (room.lower[a]..=room.upper[a]).contains(&point[a])));
                    found.push((point, leaf.content(index)));
                }
                return;
            }
            PhotonChild::Treelet(treelet) => (treelet, 0),
            PhotonChild::Node(node) => (treelet, node),
        };
        let node = PhotonTreelet(&lines.treelets[treelet as usize]).node(node).expect("a node");
        let axis = node.axis as usize;
        let [mut below, mut above] = [room; 2];
        below.upper[axis] = node.plane;
        above.lower[axis] = node.plane;
        for (child, room) in node.children.into_iter().zip([below, above]) {
            walk(lines, child, treelet, room, found);
        }
    }

    #[test]
    fn every_photon_is_in_one_leaf_on_its_side_of_every_plane() {
        for (count, bits) in [(1, 20), (10, 20), (15, 20), (1000, 20), (1000, 2), (30_000, 20), (5000, 0)] {
            let mut sorted = photons(count, bits);
            let lines = PhotonLines::new(&mut sorted.clone(), 1000.0);
            let root = if lines.treelets.is_empty() { PhotonChild::Leaf(0) } else { PhotonChild::Treelet(0) };
            let everything = Extent { lower: [0; 3], upper: [u32::MAX; 3] };
            let mut found = Vec::new();
            walk(&lines, root, 0, everything, &mut found);
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
        let nodes = (lines.leaves.len() - 1) as f64 / lines.treelets.len() as f64;
        assert!(photons > 9.0, "{photons} photons a leaf");
        assert!(nodes > 14.0, "{nodes} nodes a treelet");
    }
}
