//! Line layout of the photon map: leaves with photons, below inner nodes with up to sixteen children. Each
//! leaf and each inner node is one line of card memory.
//!
//! Splitting planes are chosen by the voxel volume heuristic (Wald, Günther, Slusallek 2004, *Balancing
//! considered harmful*), so that a search rarely visits both sides. The heuristic assumes that a search
//! visits a box with a probability proportional to the volume of the box enlarged by the search radius.
//! Splits are rounded to whole leaves, so that lines are full. The binary tree is then folded into wide nodes
//! with the fewest expected visits, by the same probabilities.
//!
//! In a caustic map, photons are first grouped by classes of similar normals and similar disc areas, and then
//! split in space. A search thus skips the groups of other surfaces, and no large disc enlarges the box of
//! small ones.

use std::num::NonZeroU8;

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::PHOTON_STACK;
use photoncard_shared::layout::{GRID_BITS, GridBox, LEAF_PHOTONS, PhotonLeaf, PhotonNode, leaf_capacity};
use rayon::prelude::*;

use crate::fold::{Folded, Tree};
use crate::photon::StoredPhoton;

/// Number of photons below which a subtree is built by one thread.
const SEQUENTIAL: usize = 4096;
/// Maximum number of intervals along a side. Their borders are the candidate planes.
const INTERVALS: usize = 32;
const MIN_INTERVALS: usize = 8;
/// Maximum number of photons from which a plane is chosen. Larger sets are sampled.
const SAMPLED: usize = 4096;
/// Number of photons above which a box is assumed to contain several surfaces.
const MANY: usize = 64;
/// Depth of the binary tree at and below which subtrees are split at the median.
const MAX_SKEWED: usize = 40;
/// Maximum coordinate of a grid point.
const LAST_POINT: u32 = (1 << GRID_BITS) - 1;

/// Photons of a leaf, as a range in the tree's order.
#[derive(Clone, Copy)]
struct Run {
    first: u32,
    count: NonZeroU8,
}

/// Tree of photons in the line layout.
pub(super) struct PhotonTree<'a> {
    photons: &'a [StoredPhoton],
    folded: Folded<Run, Extent>,
}

impl<'a> PhotonTree<'a> {
    /// Builds a tree of photons for searches with a radius of about `radius` cells. The tree does not depend
    /// on threads. `None` without photons.
    pub(super) fn new(photons: &'a mut [StoredPhoton], radius: f64) -> Option<Self> {
        Self::of(photons, &Searches { radius, reach: None })
    }

    /// Builds the tree of a caustic map, which is searched for the photons whose discs contain a point. A box
    /// contains all points within the distance `reach` of its photons, and a node stores, for each child, the
    /// classes of the normals below it.
    pub(super) fn of_discs(photons: &'a mut [StoredPhoton], reach: Reach) -> Option<Self> {
        Self::of(photons, &Searches { radius: 0.0, reach: Some(reach) })
    }

    fn of(photons: &'a mut [StoredPhoton], searches: &Searches) -> Option<Self> {
        let mut folded = Folded::new(build_groups(photons, searches, 0)?);
        if folded.stack > PHOTON_STACK {
            // Median splits are slower to search, but have minimum depth.
            folded = Folded::new(build_groups(photons, searches, MAX_SKEWED)?);
        }
        if folded.stack > PHOTON_STACK {
            // The tree above the groups is too deep, so that a tree without groups is built.
            folded = Folded::new(build(photons, 0, searches, MAX_SKEWED)?);
        }
        Some(Self { photons, folded })
    }

    /// Lines of the inner nodes.
    pub(super) fn nodes(&self) -> impl ExactSizeIterator<Item = [u8; LINE_BYTES]> {
        self.folded.nodes.iter().map(|node| {
            let boxes: Vec<GridBox> = node.children.iter().map(|extent| extent.room).collect();
            let mut line = PhotonNode::encode(&boxes, node.links)
                .unwrap_or_else(|| unreachable!("a node of {} children", boxes.len()));
            PhotonNode::set_classes(&mut line, node.children.iter().map(|extent| extent.normals));
            line
        })
    }

    pub(super) fn leaves(&self) -> impl ExactSizeIterator<Item = [u8; LINE_BYTES]> {
        self.folded.leaves.iter().map(|run| {
            let photons = self.photons.iter().skip(run.first as usize).take(run.count.get().into());
            let placed: heapless::Vec<_, LEAF_PHOTONS> =
                photons.map(|photon| (photon.point(), photon.content())).collect();
            PhotonLeaf::encode(&placed).unwrap_or_else(|| unreachable!("a leaf of {} photons", placed.len()))
        })
    }
}

/// Function that returns the distance from a photon within which searches find it, cells.
type Reach<'r> = &'r (dyn Fn(&StoredPhoton) -> u32 + Sync);

/// Kind of searches that a tree is built for.
struct Searches<'r> {
    /// Radius of a typical search, cells.
    radius: f64,
    /// In a caustic map, the distance by which the box of each photon is enlarged; each group of photons then
    /// has a `radius` of its own. `None` in a photon map.
    reach: Option<Reach<'r>>,
}

/// Group of a caustic photon: the class of its normal, and the class of its disc's area. Areas in a class
/// differ by a factor of at most two.
fn group(photon: &StoredPhoton) -> (u32, u8) {
    (photon.normal_class(), photon.disc() / 2)
}

/// Builds the tree of photons, with a subtree for each group of a caustic map. `None` without photons.
fn build_groups(
    photons: &mut [StoredPhoton],
    searches: &Searches,
    depth: usize,
) -> Option<Tree<Run, Extent>> {
    let Some(reach) = searches.reach else { return build(photons, 0, searches, depth) };
    photons.par_sort_unstable_by_key(|photon| (group(photon), *photon));
    let mut first = 0;
    let mut parts: Vec<Tree<Run, Extent>> = Vec::new();
    for part in photons.chunk_by_mut(|photon, next| group(photon) == group(next)) {
        let radius = part.iter().map(reach).max().unwrap_or(0);
        let count = part.len() as u32;
        parts.push(build(part, first, &Searches { radius: radius.into(), ..*searches }, depth)?);
        first += count;
    }
    join(parts)
}

/// Joins trees of adjacent photons to a binary tree of minimum depth. `None` without trees.
fn join(mut parts: Vec<Tree<Run, Extent>>) -> Option<Tree<Run, Extent>> {
    let above = parts.split_off(parts.len() / 2);
    if parts.is_empty() {
        return above.into_iter().next();
    }
    let parts = [join(parts)?, join(above)?];
    let [below, above] = parts.each_ref().map(Tree::bounds);
    let both = below.union(above);
    // The boxes contain the photons' discs, so that the search radius is 0.
    Some(Tree::node(parts, both, both.chance(0.0) as f32, None))
}

/// Builds the tree of `photons`. The first of them has the index `first` in the order of all photons. `None`
/// without photons.
fn build(
    photons: &mut [StoredPhoton],
    first: u32,
    searches: &Searches,
    depth: usize,
) -> Option<Tree<Run, Extent>> {
    if photons.is_empty() {
        return None;
    }
    let radius = searches.radius;
    let extent = Extent::new(photons);
    let count = u8::try_from(photons.len()).ok().and_then(NonZeroU8::new);
    if let Some(count) = count
        && PhotonLeaf::fits(&extent.room, photons.len())
    {
        let reached = Extent::reached(photons, searches.reach);
        return Some(Tree::leaf(Run { first, count }, reached, 0.0));
    }
    let (axis, middle) = if depth < MAX_SKEWED {
        extent.split(photons, radius)
    } else {
        (extent.longest(), photons.len() / 2)
    };
    photons.select_nth_unstable_by_key(middle, |photon| (photon.coordinate(axis), *photon));
    let (below, above) = photons.split_at_mut(middle);
    let is_large = below.len().max(above.len()) > SEQUENTIAL;
    let mut below = || build(below, first, searches, depth + 1);
    let mut above = || build(above, first + middle as u32, searches, depth + 1);
    let (below, above) = if is_large { rayon::join(below, above) } else { (below(), above()) };
    let parts = [below?, above?];
    let [below, above] = parts.each_ref().map(Tree::bounds);
    Some(Tree::node(parts, below.union(above), extent.chance(radius) as f32, None))
}

/// Bounding box of photons, and in a caustic map the classes of their normals, one bit each.
#[derive(Clone, Copy)]
struct Extent {
    room: GridBox,
    normals: u16,
}

impl Extent {
    fn new(photons: &[StoredPhoton]) -> Self {
        let mut room = GridBox { lower: [u32::MAX; 3], upper: [0; 3] };
        for photon in photons {
            room = room.union(GridBox::of(photon.point()));
        }
        Self { room, normals: 0 }
    }

    /// Box of all grid points that are within the distance `reach` of a photon on each axis, and the classes
    /// of the photons' normals.
    fn reached(photons: &[StoredPhoton], reach: Option<Reach>) -> Self {
        let mut extent = Self { room: GridBox { lower: [u32::MAX; 3], upper: [0; 3] }, normals: 0 };
        for photon in photons {
            let (reach, normals) = reach.map_or((0, 0), |reach| (reach(photon), 1 << photon.normal_class()));
            let lower = photon.point().map(|coordinate| coordinate.saturating_sub(reach));
            let upper = photon.point().map(|coordinate| (coordinate + reach).min(LAST_POINT));
            extent = extent.union(Self { room: GridBox { lower, upper }, normals });
        }
        extent
    }

    fn union(self, other: Self) -> Self {
        Self { room: self.room.union(other.room), normals: self.normals | other.normals }
    }

    fn side(&self, axis: usize) -> u32 {
        self.room.upper[axis] - self.room.lower[axis]
    }

    fn longest(&self) -> usize {
        // Of several equal sides the first is chosen.
        (0..3).rev().max_by_key(|&axis| self.side(axis)).unwrap_or(0)
    }

    /// Relative probability that a search visits the box.
    fn chance(&self, radius: f64) -> f64 {
        chance([0, 1, 2].map(|axis| f64::from(self.side(axis))), radius)
    }

    /// Approximate number of photons per leaf in the box.
    fn leaf_photons(&self, photons: usize) -> usize {
        let axes = (0..3).filter(|&axis| self.side(axis) > 0).count();
        // In a box of many photons, a leaf is assumed to lie in a plane along two axes. Few photons lie on
        // one surface, which may be oblique to the axes.
        leaf_capacity(if photons > MANY { axes.min(2) } else { axes })
    }

    /// Returns the axis of a split, and the number of photons below its plane. The photons below the plane
    /// fill whole leaves if there is more than one leaf.
    fn split(&self, photons: &[StoredPhoton], radius: f64) -> (usize, usize) {
        let (axis, below) = self.cheapest(photons, radius);
        let count = photons.len();
        let leaf = self.leaf_photons(count);
        if count <= leaf + 1 {
            return (axis, count / 2);
        }
        let most = (count - 1) / leaf * leaf;
        (axis, (below + leaf / 2).next_multiple_of(leaf).saturating_sub(leaf).clamp(leaf, most))
    }

    /// Plane of minimum cost by the voxel volume heuristic: its axis, and the number of photons below it.
    fn cheapest(&self, photons: &[StoredPhoton], radius: f64) -> (usize, usize) {
        let mut cheapest = (f64::INFINITY, self.longest(), photons.len() / 2);
        let intervals = (photons.len() / 4).clamp(MIN_INTERVALS, INTERVALS);
        let step = (photons.len() / SAMPLED).max(1);
        let sampled = photons.len().div_ceil(step);
        for axis in (0..3).filter(|&axis| self.side(axis) > 0) {
            let side = f64::from(self.side(axis));
            // Number of intervals per grid cell, times 2^32.
            let scale = ((intervals as u64) << 32) / (u64::from(self.side(axis)) + 1);
            let mut counts = [0_usize; INTERVALS];
            for photon in photons.iter().step_by(step) {
                let cells = u64::from(photon.coordinate(axis) - self.room.lower[axis]);
                counts[((cells * scale) >> 32) as usize] += 1;
            }
            let across: f64 =
                (0..3).filter(|&a| a != axis).map(|a| f64::from(self.side(a)) + 2.0 * radius).product();
            let mut below = 0;
            for (plane, count) in (1..intervals).zip(counts) {
                below += count;
                let above = sampled - below;
                let share = plane as f64 / intervals as f64;
                let part = |share: f64| across * (share * side + 2.0 * radius);
                let cost = part(share) * below as f64 + part(1.0 - share) * above as f64;
                if cost < cheapest.0 && below > 0 && above > 0 {
                    cheapest = (cost, axis, below * step);
                }
            }
        }
        (cheapest.1, cheapest.2.min(photons.len() - 1))
    }
}

/// Volume of a box enlarged by the search radius.
fn chance(sides: [f64; 3], radius: f64) -> f64 {
    sides.into_iter().map(|side| side + 2.0 * radius).product()
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;
    use photoncard_shared::layout::{Child, PHOTON_CONTENT_BYTES, Photon, WideNode};

    use super::*;

    /// Grid point and content of a photon.
    type Placed = ([u32; 3], [u8; PHOTON_CONTENT_BYTES]);

    /// Lines of the sections of nodes and leaves.
    struct PhotonLines {
        nodes: Vec<[u8; LINE_BYTES]>,
        leaves: Vec<[u8; LINE_BYTES]>,
    }

    impl PhotonLines {
        fn new(photons: &[Placed], radius: f64) -> Self {
            let mut stored: Vec<_> =
                photons.iter().map(|(point, content)| StoredPhoton::at(*point, *content)).collect();
            let tree = PhotonTree::new(&mut stored, radius).expect("there are photons");
            Self { nodes: tree.nodes().collect(), leaves: tree.leaves().collect() }
        }
    }

    /// Photons on the walls of a box. The content of each photon is its number.
    fn photons(count: u32, bits: u32) -> Vec<Placed> {
        (0..count)
            .map(|i| {
                let mut point = [0, 1, 2].map(|k| hash(hash(i).wrapping_add(k)) & ((1 << bits) - 1));
                point[(i % 3) as usize] = 0;
                (point, u64::from(i).to_le_bytes())
            })
            .collect()
    }

    /// Collects all photons below `child`, and checks that each lies within the boxes of all ancestors.
    /// Returns the number of stack entries that a search needs.
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
            let lines = PhotonLines::new(&sorted, 1000.0);
            let everything = GridBox { lower: [0; 3], upper: [u32::MAX; 3] };
            let mut found = Vec::new();
            let stack = walk(&lines, Child::Node(0), everything, &mut found);
            assert!(stack <= PHOTON_STACK, "{stack}");
            found.sort_unstable();
            sorted.sort_unstable();
            assert!(found == sorted, "{count} photons on {bits} bits");
        }
    }

    /// Reach of a photon, cells: 1,000 times the code of its disc.
    fn reach(photon: &StoredPhoton) -> u32 {
        1000 * u32::from(photon.disc())
    }

    /// Checks below `child` of a caustic map that each box contains the [`reach`] of its photons, and that
    /// each node states the class of the normals below each child. Returns the classes, and counts the
    /// photons.
    fn walk_discs(lines: &PhotonLines, child: Child, room: GridBox, count: &mut usize) -> u16 {
        let node = match child {
            Child::Leaf(leaf) => {
                let leaf = PhotonLeaf::read(&lines.leaves[leaf as usize]);
                *count += leaf.photons() as usize;
                return (0..leaf.photons()).fold(0, |classes, index| {
                    let point = leaf.point(index);
                    let photon = StoredPhoton::at(point, leaf.content(index));
                    let lower = point.map(|coordinate| coordinate.saturating_sub(reach(&photon)));
                    let upper = point.map(|coordinate| (coordinate + reach(&photon)).min(LAST_POINT));
                    assert!(room.contains(&GridBox { lower, upper }));
                    classes | 1 << photon.normal_class()
                });
            }
            Child::Node(node) => &lines.nodes[node as usize],
        };
        let children = WideNode(node).children() as usize;
        (0..children).fold(0, |classes, child| {
            let sides = PhotonNode(node).coordinates().map(|axis| axis.sides(child).expect("a child"));
            let room = GridBox { lower: sides.map(|[lower, _]| lower), upper: sides.map(|[_, upper]| upper) };
            let below = walk_discs(lines, WideNode(node).links().child(child as u32), room, count);
            let without = |classes: u16| PhotonNode(node).children_without(classes) >> child & 1;
            assert_eq!((without(below), without(!below)), (0, below.is_power_of_two().into()));
            classes | below
        })
    }

    #[test]
    fn nodes_of_a_caustic_map_state_normals_and_contain_the_discs_of_all_photons_below() {
        for count in [1, 10, 1000, 30_000] {
            let mut stored: Vec<_> = photons(count, 20)
                .into_iter()
                .zip(0_u32..)
                .map(|((point, content), index)| {
                    let content = (u64::from_le_bytes(content)
                        | u64::from(((hash(index) % 15) << 4) + hash(index) / 15 % 15) << 50)
                        .to_le_bytes();
                    StoredPhoton::at(point, Photon::content_with_disc(content, (hash(!index) & 31) as u8))
                })
                .collect();
            let classes = stored.iter().fold(0, |classes, photon| classes | 1 << photon.normal_class());
            let tree = PhotonTree::of_discs(&mut stored, &reach).expect("there are photons");
            assert!(tree.folded.stack <= PHOTON_STACK, "{}", tree.folded.stack);
            let lines = PhotonLines { nodes: tree.nodes().collect(), leaves: tree.leaves().collect() };
            let everything = GridBox { lower: [0; 3], upper: [u32::MAX; 3] };
            let mut found = 0;
            assert_eq!(walk_discs(&lines, Child::Node(0), everything, &mut found), classes);
            assert_eq!(found, count as usize);
        }
    }

    #[test]
    fn lines_are_mostly_full() {
        let count = 100_000;
        let lines = PhotonLines::new(&photons(count, 20), 10_000.0);
        let photons = f64::from(count) / lines.leaves.len() as f64;
        let children = (lines.leaves.len() + lines.nodes.len() - 1) as f64 / lines.nodes.len() as f64;
        println!("{photons} photons a leaf, {children} children a node");
        assert!(photons > 9.0, "{photons} photons a leaf");
        assert!(children > 10.0, "{children} children a node");
    }
}
