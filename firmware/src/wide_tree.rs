//! Traversal of a tree whose nodes have up to sixteen children: the bounding volume hierarchy, or a photon
//! map with leaves.
//!
//! A visit of a node computes the distances to the boxes of all children at once. Children within the search
//! distance are pushed onto a stack, with the nearest on top.

use heapless::Vec;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Child, Links, NODE_CHILDREN, WideNode};
use photoncard_shared::message::{Fault, FaultCode};

use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::simd::{Isa, LANES};

const _: () = assert!(NODE_CHILDREN == LANES);

/// Distance bits of a child that is to be skipped.
pub(crate) const BEYOND: u32 = u32::MAX;

/// Stack entry of a leaf or node. The upper 32 bits are its distance bits: the `f32` bits of a lower bound of
/// its distance, or other bits from the caller. The lower 32 bits are its index and the flag `LEAF`.
#[derive(Clone, Copy)]
struct Deferred(u64);

/// Flag in the lower 32 bits of a [`Deferred`] that marks a leaf.
const LEAF: u32 = 1 << 31;

/// Index of a leaf that no card image has. It marks the end of a group on the stack, below the group's nodes
/// and leaves ([`Descent::begin_group`]).
pub(crate) const END_OF_GROUP: u32 = !LEAF;

impl Deferred {
    #[inline(always)]
    fn distance(self) -> u32 {
        (self.0 >> 32) as u32
    }

    #[inline(always)]
    fn child(self) -> Child {
        let child = self.0 as u32;
        if child & LEAF != 0 { Child::Leaf(child & !LEAF) } else { Child::Node(child) }
    }
}

/// Stack of the nodes and leaves to be visited, each a [`Deferred`] entry. The capacity `ENTRIES` is the
/// maximum that the tree needs plus [`LANES`], because all lanes of a node are written at once.
pub(crate) type Stack<const ENTRIES: usize> = Vec<u64, ENTRIES>;

/// Order in which a node's children are visited.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// Nearest first. Hits or photons found in one child shrink the search distance for the others.
    NearestFirst,
    /// Unsorted, for searches whose distance limit does not shrink. Sorting would cost more than it saves.
    Any,
}

/// Saved state of the traversal around a group, while the group is traversed.
pub(crate) struct Outside {
    /// Number of stack entries.
    entries: usize,
    visits_left: u64,
}

/// Traversal of one tree, with its stack.
pub(crate) struct Descent<'s, const ENTRIES: usize> {
    scene: &'s SceneImage,
    nodes: SectionKind,
    leaves: SectionKind,
    /// Stack of the traversal. It is borrowed because it is too large to be moved.
    stack: &'s mut Stack<ENTRIES>,
    visits_left: u64,
}

impl<'s, const ENTRIES: usize> Descent<'s, ENTRIES> {
    /// Creates a traversal that starts at the root of a tree, given by its two sections. Empties `stack`.
    #[inline(always)]
    pub(crate) fn new(
        scene: &'s SceneImage,
        nodes: SectionKind,
        leaves: SectionKind,
        stack: &'s mut Stack<ENTRIES>,
    ) -> Self {
        Self::with_root(scene, [nodes, leaves], stack, 0)
    }

    /// Does [`Self::new`] with `bits` instead of 0 as the root's distance bits.
    #[inline(always)]
    pub(crate) fn with_root(
        scene: &'s SceneImage,
        [nodes, leaves]: [SectionKind; 2],
        stack: &'s mut Stack<ENTRIES>,
        bits: u32,
    ) -> Self {
        // The root is node 0, and an empty stack has room for it.
        stack.clear();
        let _ = stack.push(u64::from(bits) << 32);
        // A tree visits each record once: more visits mean a cycle in an unsound card image.
        let parts = [nodes, leaves].map(|kind| u64::from(scene.header.section(kind).records));
        Self { scene, nodes, leaves, stack, visits_left: parts.into_iter().sum() }
    }

    /// Begins the traversal of a group's tree at the node `root`, whose distance bits are `bits`. After the
    /// last node or leaf of the group, [`Self::pop`] returns the leaf [`END_OF_GROUP`]. Returns the state
    /// that [`Self::end_group`] restores.
    ///
    /// # Errors
    /// [`FaultCode::Depth`] if the stack overflows.
    #[inline(always)]
    pub(crate) fn begin_group(&mut self, root: u32, bits: u32) -> Result<Outside, Fault> {
        let depth = Fault { code: FaultCode::Depth, detail: root };
        // A root with the bit LEAF occurs in unsound card images only.
        let parts = [u64::from(LEAF | END_OF_GROUP), u64::from(bits) << 32 | u64::from(root & !LEAF)];
        let outside = Outside { entries: self.stack.len(), visits_left: self.visits_left };
        self.stack.extend_from_slice(&parts).map_err(|_| depth)?;
        let parts = [self.nodes, self.leaves].map(|kind| u64::from(self.scene.header.section(kind).records));
        self.visits_left = parts.into_iter().sum();
        Ok(outside)
    }

    /// Ends the traversal of a group's tree, and restores the state of the traversal around it. Returns false
    /// if the stack holds parts of the group yet.
    #[inline(always)]
    pub(crate) fn end_group(&mut self, Outside { entries, visits_left }: Outside) -> bool {
        self.visits_left = visits_left;
        self.stack.len() == entries
    }

    /// Returns the next leaf or node whose distance is at most `limit`, given as `f32` bits; `None` at the
    /// end of the traversal.
    ///
    /// # Errors
    /// [`FaultCode::Depth`] if the card image is invalid: the tree has a cycle.
    #[inline(always)]
    pub(crate) fn next(&mut self, limit: u32) -> Result<Option<Child>, Fault> {
        // Entries further down were pushed earlier, and may be nearer: the loop goes on.
        while let Some((distance, child)) = self.pop()? {
            if distance <= limit {
                return Ok(Some(child));
            }
        }
        Ok(None)
    }

    /// Returns the next leaf or node with its distance bits; `None` at the end of the traversal.
    ///
    /// # Errors
    /// As [`Self::next`].
    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Result<Option<(u32, Child)>, Fault> {
        let Some(part) = self.stack.pop().map(Deferred) else { return Ok(None) };
        let depth = Fault { code: FaultCode::Depth, detail: part.0 as u32 };
        self.visits_left = self.visits_left.checked_sub(1).ok_or(depth)?;
        Ok(Some((part.distance(), part.child())))
    }

    /// Reads the line of a leaf.
    #[inline(always)]
    pub(crate) fn leaf<'m>(
        &self,
        memory: &'m mut impl MemoryPort,
        index: u32,
    ) -> Result<&'m [u8; LINE_BYTES], Fault> {
        self.scene.line(memory, self.leaves, index, 0..LINE_BYTES as u32)
    }

    /// Visits a node: pushes its children and prefetches their lines. `distances` maps the node's line to the
    /// distance bits of each child, or [`BEYOND`] for a child to be skipped.
    ///
    /// # Errors
    /// [`FaultCode::Depth`] if the stack overflows; [`FaultCode::Record`] or [`FaultCode::LineRange`] if
    /// there is no such node.
    #[inline(always)]
    pub(crate) fn enter(
        &mut self,
        isa: impl Isa,
        memory: &mut impl MemoryPort,
        index: u32,
        order: Order,
        distances: impl FnOnce(&[u8; LINE_BYTES]) -> [u32; LANES],
    ) -> Result<(), Fault> {
        let line = self.scene.line(memory, self.nodes, index, 0..LINE_BYTES as u32)?;
        let distances = distances(line);
        let node = WideNode(line);
        let mask = isa.below(&distances, BEYOND) & !(u32::MAX << node.children());
        let parts = parts(isa, node, &distances);
        let bottom = self.stack.len();
        let depth = Fault { code: FaultCode::Depth, detail: index };
        self.push(isa, &parts, mask).ok_or(depth)?;
        let entered = self.stack.get_mut(bottom..).unwrap_or_default();
        if order == Order::NearestFirst {
            sort(entered);
        }
        for &mut part in entered {
            let (kind, line) = match Deferred(part).child() {
                Child::Leaf(leaf) => (self.leaves, leaf),
                Child::Node(node) => (self.nodes, node),
            };
            self.scene.prefetch(isa, memory, kind, line);
        }
        Ok(())
    }

    /// Pushes the elements of `parts` whose bits are set in `mask`; returns `None` if the stack overflows.
    #[inline(always)]
    fn push(&mut self, isa: impl Isa, parts: &[u64; LANES], mask: u32) -> Option<()> {
        let bottom = self.stack.len();
        let mut packed = [0; LANES];
        isa.pack_long(mask, parts, &mut packed);
        self.stack.extend_from_slice(&packed).ok()?;
        self.stack.truncate(bottom + mask.count_ones() as usize);
        Some(())
    }
}

/// Stack entry ([`Deferred`]) of each child of a node.
#[inline(always)]
fn parts(isa: impl Isa, node: WideNode, distances: &[u32; LANES]) -> [u64; LANES] {
    let Links { leaves, first_leaf, first_node } = node.links();
    // Indices that wrap or have the bit LEAF occur in unsound card images only.
    let [leaf, node_of] = [first_leaf | LEAF, first_node.wrapping_sub(leaves)];
    let mut parts = [0; LANES];
    for lane in 0..isa.lanes(node.children() as usize) {
        let index = lane as u32;
        let child = index.wrapping_add(if index < leaves { leaf } else { node_of });
        if let (Some(part), Some(&distance)) = (parts.get_mut(lane), distances.get(lane)) {
            *part = u64::from(distance) << 32 | u64::from(child);
        }
    }
    parts
}

/// Sorts stack entries in descending order, by insertion.
#[inline(always)]
fn sort(parts: &mut [u64]) {
    for sorted in 1..parts.len() {
        // Always there: `sorted` is below the length.
        let Some(&part) = parts.get(sorted) else { return };
        let mut hole = sorted;
        while let Some(&before) = hole.checked_sub(1).and_then(|before| parts.get(before)) {
            if before > part {
                break;
            }
            if let Some(target) = parts.get_mut(hole) {
                *target = before;
            }
            hole -= 1;
        }
        if let Some(target) = parts.get_mut(hole) {
            *target = part;
        }
    }
}
