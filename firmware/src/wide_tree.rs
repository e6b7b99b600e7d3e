//! A descent in a tree of wide nodes: the hierarchy of a scene, or a photon map in leaves.
//!
//! A visit of a node tells the distances to the boxes of all its children at once. Those that are near enough wait on a stack,
//! the nearest on top.

use heapless::Vec;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Child, Links, NODE_CHILDREN, WideNode};
use photoncard_shared::message::{Fault, FaultCode};

use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::simd::{Isa, LANES};

const _: () = assert!(NODE_CHILDREN == LANES);

/// The distance, as bits, of a child that is not to be visited.
pub(crate) const BEYOND: u32 = u32::MAX;

/// A part of the tree put off: the bits of a lower bound of the distance to it above, which part it is below.
#[derive(Clone, Copy)]
struct Deferred(u64);

/// Marks a leaf in the lower half of a [`Deferred`].
const LEAF: u32 = 1 << 31;

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

/// Parts put off, the next on top: a tree's entries, and [`LANES`] more, as all children of a node are written at once.
pub(crate) type Stack<const ENTRIES: usize> = Vec<u64, ENTRIES>;

/// Which of the children of a node is to be visited next.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// The nearest: what is found there spares others a visit.
    NearestFirst,
    /// Any: where the first that is found ends the descent, to sort them costs more than it spares.
    Any,
}

/// A descent.
pub(crate) struct Descent<'s, const ENTRIES: usize> {
    scene: &'s SceneImage,
    nodes: SectionKind,
    leaves: SectionKind,
    /// By reference: a stack is large to be moved.
    stack: &'s mut Stack<ENTRIES>,
    visits_left: u64,
}

impl<'s, const ENTRIES: usize> Descent<'s, ENTRIES> {
    /// From the root of the tree in two sections, with an empty stack.
    #[inline(always)]
    pub(crate) fn new(
        scene: &'s SceneImage,
        nodes: SectionKind,
        leaves: SectionKind,
        stack: &'s mut Stack<ENTRIES>,
    ) -> Self {
        // There is room for the root, node 0 at no distance.
        let _ = stack.push(0);
        // A tree's part is visited once: more visits tell of a cycle in an unsound image.
        let parts = [nodes, leaves].map(|kind| u64::from(scene.header.section(kind).records));
        Self { scene, nodes, leaves, stack, visits_left: parts.into_iter().sum() }
    }

    /// The next part to visit, none of which is farther than `limit`, a distance's bits.
    #[inline(always)]
    pub(crate) fn next(&mut self, limit: u32) -> Result<Option<Child>, Fault> {
        while let Some(part) = self.stack.pop().map(Deferred) {
            // What lies below may be nearer: it was put off before this.
            if part.distance() <= limit {
                let depth = Fault { code: FaultCode::Depth, detail: part.0 as u32 };
                self.visits_left = self.visits_left.checked_sub(1).ok_or(depth)?;
                return Ok(Some(part.child()));
            }
        }
        Ok(None)
    }

    /// The line of a leaf.
    #[inline(always)]
    pub(crate) fn leaf<'m>(
        &self,
        memory: &'m mut impl MemoryPort,
        index: u32,
    ) -> Result<&'m [u8; LINE_BYTES], Fault> {
        self.scene.line(memory, self.leaves, index, 0..LINE_BYTES as u32)
    }

    /// Visits a node: puts off the children that are near enough, to be visited in an order, and has their lines brought
    /// near. `distances` tells of a node's line the bits of lower bounds of the distances to its children, or [`BEYOND`].
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

    /// Puts some of the parts onto the stack; `None` if there is no room for all.
    #[inline(always)]
    fn push(&mut self, isa: impl Isa, parts: &[u64; LANES], mask: u32) -> Option<()> {
        let bottom = self.stack.len();
        self.stack.resize(bottom + LANES, 0).ok()?;
        isa.pack_long(mask, parts, self.stack.get_mut(bottom..)?.first_chunk_mut()?);
        self.stack.truncate(bottom + mask.count_ones() as usize);
        Some(())
    }
}

/// What to put off of each child of a node.
#[inline(always)]
fn parts(isa: impl Isa, node: WideNode, distances: &[u32; LANES]) -> [u64; LANES] {
    let Links { leaves, first_leaf, first_node } = node.links();
    // They wrap, and leaves are taken for nodes, in unsound images only.
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

/// Sorts a few, the greatest first.
#[inline(always)]
fn sort(parts: &mut [u64]) {
    for sorted in 1..parts.len() {
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
