//! The photon map in lines: inner nodes in treelets, photons in leaves that fill a line each.
//!
//! Nothing is lost against [`super::Photon`]: positions lie on a grid in either layout, so that a leaf can tell them by a
//! few bits each from its own corner.

use super::photon_grid::{GRID_BITS, GRID_MASK};
use crate::address::LINE_BYTES;

/// A part of the inner tree, one line.
///
/// | bytes | what |
/// |---|---|
/// | 5 i .. 5 i + 3 | node i: its plane, bits 0-19 the grid coordinate, 20-21 the axis |
/// | 5 i + 3, 5 i + 4 | its children below and above the plane: 0 to 23 a node here, 64 + e and 128 + e leaf and treelet e |
/// | 120..124 | index of leaf 0 |
/// | 124..128 | index of treelet 0 |
///
/// The root of the treelet is node 0. Photons on the plane may be on either side.
#[derive(Clone, Copy)]
pub struct PhotonTreelet<'a>(pub &'a [u8; LINE_BYTES]);

/// Nodes that a treelet may have; its exits are at most one more.
pub const TREELET_NODES: usize = 24;
const NODE_BYTES: usize = 5;
const LEAF_EXIT: u8 = 0x40;
const TREELET_EXIT: u8 = 0x80;
const EXIT_MASK: u8 = 0x3f;
const FIRST_LEAF: usize = NODE_BYTES * TREELET_NODES;
const _: () = assert!(FIRST_LEAF + 8 == LINE_BYTES);

/// An inner node of the photon map: a plane, and what is on either side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PhotonNode {
    /// The axis across the plane: 0, 1 or 2.
    pub axis: u8,
    /// Grid coordinate of the plane.
    pub plane: u32,
    /// Below and above it.
    pub children: [PhotonChild; 2],
}

/// What is on a side of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotonChild {
    /// Another node of the treelet.
    Node(u8),
    /// A leaf, by its index in the image.
    Leaf(u32),
    /// A treelet, by its index in the image.
    Treelet(u32),
}

impl PhotonTreelet<'_> {
    /// Bytes of a node.
    pub const NODE_BYTES: u32 = NODE_BYTES as u32;

    /// Node `index`; `None` if there cannot be one.
    #[inline(always)]
    pub fn node(&self, index: u8) -> Option<PhotonNode> {
        let (nodes, _) = self.0.as_chunks::<NODE_BYTES>();
        let &[a, b, c, below, above] = nodes.get(..TREELET_NODES)?.get(index as usize)?;
        let plane = u32::from_le_bytes([a, b, c, 0]);
        Some(PhotonNode {
            axis: (plane >> GRID_BITS & 3) as u8,
            plane: plane & GRID_MASK,
            children: [self.child(below), self.child(above)],
        })
    }

    #[inline(always)]
    fn child(&self, code: u8) -> PhotonChild {
        let exit = u32::from(code & EXIT_MASK);
        if code & TREELET_EXIT != 0 {
            PhotonChild::Treelet(super::read_u32(self.0, FIRST_LEAF + 4).wrapping_add(exit))
        } else if code & LEAF_EXIT != 0 {
            PhotonChild::Leaf(super::read_u32(self.0, FIRST_LEAF).wrapping_add(exit))
        } else {
            PhotonChild::Node(code)
        }
    }

    /// The line of some nodes whose leaves and treelets are numbered from the given first ones on; `None` if there are
    /// too many, or a child is out of reach.
    pub fn encode(nodes: &[PhotonNode], first_leaf: u32, first_treelet: u32) -> Option<[u8; LINE_BYTES]> {
        let mut line = [0; LINE_BYTES];
        let exit = |index: u32, first: u32| {
            let exit = u8::try_from(index.checked_sub(first)?).ok()?;
            (exit <= EXIT_MASK).then_some(exit)
        };
        let (slots, _) = line.as_chunks_mut::<NODE_BYTES>();
        let slots = slots.get_mut(..TREELET_NODES)?;
        if nodes.len() > slots.len() {
            return None;
        }
        for (slot, node) in slots.iter_mut().zip(nodes) {
            let [a, b, c, _] = (node.plane & GRID_MASK | u32::from(node.axis) << GRID_BITS).to_le_bytes();
            let code = |child: PhotonChild| match child {
                PhotonChild::Node(index) => (usize::from(index) < nodes.len()).then_some(index),
                PhotonChild::Leaf(index) => exit(index, first_leaf).map(|exit| LEAF_EXIT | exit),
                PhotonChild::Treelet(index) => exit(index, first_treelet).map(|exit| TREELET_EXIT | exit),
            };
            let [below, above] = node.children.map(code);
            *slot = [a, b, c, below?, above?];
        }
        super::write_u32(&mut line, FIRST_LEAF, first_leaf);
        super::write_u32(&mut line, FIRST_LEAF + 4, first_treelet);
        Some(line)
    }
}

/// Some photons, one line.
///
/// | bits | what |
/// |---|---|
/// | 0..60 | the leaf's corner on the grid: x, y, z, 20 bits each |
/// | 60..64 | number of photons |
/// | 64..79 | bits of a coordinate: x, y, z, 5 bits each |
/// | 80.. | photons: coordinates from the corner on, x, y, z; where they take more than 57 bits, at every 64th |
/// | to 1024 | contents, 8 bytes each, the first photon's at the end of the line |
///
/// Contents are the last 8 bytes of [`super::Photon`], without an axis.
#[derive(Clone, Copy)]
pub struct PhotonLeaf<'a> {
    line: &'a [u8; LINE_BYTES],
    corner: [u32; 3],
    widths: [u32; 3],
    stride: u32,
    photons: u32,
}

/// Bytes of what a photon carries besides its position.
pub const PHOTON_CONTENT_BYTES: usize = 8;
/// Photons that a leaf may have.
pub const LEAF_PHOTONS: usize = 14;
const FIRST_POSITION: u32 = 80;
const LINE_BITS: u32 = 8 * LINE_BYTES as u32;
const CONTENT_BITS: u32 = 8 * PHOTON_CONTENT_BYTES as u32;

/// Bits from one photon's coordinates to the next: what one shifted word of 64 bits can hold.
#[inline(always)]
const fn stride(widths: [u32; 3]) -> u32 {
    let [x, y, z] = widths;
    let all = x + y + z;
    if all > 57 { 64 } else { all }
}

impl<'a> PhotonLeaf<'a> {
    /// Reads a leaf's header.
    #[inline(always)]
    pub fn read(line: &'a [u8; LINE_BYTES]) -> Self {
        let low = word(line, 0);
        let high = word(line, 8);
        let corner = [low, low >> GRID_BITS, low >> (2 * GRID_BITS)].map(|c| c as u32 & GRID_MASK);
        // More than the grid's bits are in unsound images only.
        let widths = [high, high >> 5, high >> 10].map(|w| (w as u32 & 31).min(GRID_BITS));
        let photons = ((low >> 60) as u32).min(LEAF_PHOTONS as u32);
        Self { line, corner, widths, stride: stride(widths), photons }
    }

    /// Number of photons.
    #[inline(always)]
    pub fn photons(&self) -> u32 {
        self.photons
    }

    /// The grid point of photon `index`.
    #[inline(always)]
    pub fn point(&self, index: u32) -> [u32; 3] {
        let bit = FIRST_POSITION + index * self.stride;
        let byte = (bit / 8).min(LINE_BYTES as u32 - 8);
        let bits = word(self.line, byte as usize) >> ((bit - 8 * byte) & 63);
        let [x, y, z] = self.widths;
        let field = |shift: u32, width: u32| (bits >> shift) as u32 & ((1 << width) - 1);
        let [a, b, c] = self.corner;
        [a + field(0, x), b + field(x, y), c + field(x + y, z)]
    }

    /// What photon `index` carries.
    #[inline(always)]
    pub fn content(&self, index: u32) -> [u8; PHOTON_CONTENT_BYTES] {
        let (contents, _) = self.line.as_chunks();
        let last = contents.len() - 1;
        contents.get(last.wrapping_sub(index as usize)).copied().unwrap_or_default()
    }

    /// The line of some photons; `None` if it cannot hold them, or there is none.
    pub fn encode(photons: &[([u32; 3], [u8; PHOTON_CONTENT_BYTES])]) -> Option<[u8; LINE_BYTES]> {
        let (corner, widths) = extent(photons)?;
        let stride = stride(widths);
        let bits = FIRST_POSITION + photons.len() as u32 * (stride + CONTENT_BITS);
        if photons.len() > LEAF_PHOTONS || bits > LINE_BITS {
            return None;
        }
        let mut line = [0; LINE_BYTES];
        let [a, b, c] = corner.map(u64::from);
        let [x, y, z] = widths;
        put(&mut line, 0, a | b << GRID_BITS | c << (2 * GRID_BITS) | (photons.len() as u64) << 60);
        put(&mut line, 64, u64::from(x | y << 5 | z << 10));
        let contents = line.as_chunks_mut().0.iter_mut().rev();
        for (slot, (_, content)) in contents.zip(photons) {
            *slot = *content;
        }
        for (index, (point, _)) in (0..).zip(photons) {
            let [p, q, r] = [0, 1, 2].map(|axis: usize| {
                let [point, corner] = [point, &corner].map(|of| of.get(axis).copied().unwrap_or(0));
                u64::from(point - corner)
            });
            put(&mut line, FIRST_POSITION + index * stride, p | q << x | r << (x + y));
        }
        Some(line)
    }
}

/// The corner of some grid points, and the bits of each coordinate from there; `None` without points.
fn extent(photons: &[([u32; 3], [u8; PHOTON_CONTENT_BYTES])]) -> Option<([u32; 3], [u32; 3])> {
    let (first, _) = photons.first()?;
    let (mut lower, mut upper) = (*first, *first);
    for (point, _) in photons {
        for ((lower, upper), coordinate) in lower.iter_mut().zip(&mut upper).zip(point) {
            *lower = (*lower).min(*coordinate);
            *upper = (*upper).max(*coordinate);
        }
    }
    let [a, b, c] = lower;
    let [x, y, z] = upper;
    Some((lower, [x - a, y - b, z - c].map(|side| u32::BITS - side.leading_zeros())))
}

/// The 64 bits from a byte on; zero past the end.
#[inline(always)]
fn word(line: &[u8; LINE_BYTES], byte: usize) -> u64 {
    match line.get(byte..).and_then(<[u8]>::first_chunk) {
        Some(bytes) => u64::from_le_bytes(*bytes),
        None => 0,
    }
}

/// Sets bits of the line from a bit on, as [`PhotonLeaf::point`] reads them.
fn put(line: &mut [u8; LINE_BYTES], bit: u32, value: u64) {
    let byte = (bit / 8).min(LINE_BYTES as u32 - 8);
    let shifted = value << ((bit - 8 * byte) & 63);
    if let Some(bytes) = line.get_mut(byte as usize..).and_then(<[u8]>::first_chunk_mut) {
        *bytes = (u64::from_le_bytes(*bytes) | shifted).to_le_bytes();
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    type Placed = ([u32; 3], [u8; PHOTON_CONTENT_BYTES]);

    fn random(seed: u64) -> impl FnMut() -> u64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        }
    }

    fn photons(seed: u64, count: usize, widths: [u32; 3]) -> Vec<Placed> {
        let mut next = random(seed);
        let corner = widths.map(|width| next() as u32 & (GRID_MASK >> 1) & !((1 << width) - 1));
        (0..count)
            .map(|_| {
                let point = [0, 1, 2].map(|axis| corner[axis] + (next() as u32 & ((1 << widths[axis]) - 1)));
                (point, next().to_le_bytes())
            })
            .collect()
    }

    #[test]
    fn a_leaf_gives_back_its_photons_to_the_last_bit() {
        for widths in [[0, 0, 0], [14, 0, 15], [15, 15, 0], [11, 12, 13], [19, 19, 19], [1, 19, 0]] {
            for count in 1..=LEAF_PHOTONS {
                for seed in 0..20 {
                    let photons = photons(seed, count, widths);
                    let Some(line) = PhotonLeaf::encode(&photons) else { continue };
                    let leaf = PhotonLeaf::read(&line);
                    assert_eq!(leaf.photons(), count as u32);
                    for (index, photon) in (0..).zip(&photons) {
                        assert_eq!((leaf.point(index), leaf.content(index)), *photon, "{widths:?} {count}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_line_holds_ten_photons_of_a_wall_and_always_seven() {
        assert!(PhotonLeaf::encode(&photons(3, 10, [15, 0, 15])).is_some());
        assert!(PhotonLeaf::encode(&photons(3, LEAF_PHOTONS, [0, 0, 0])).is_some());
        let corners = [[0; 3], [GRID_MASK; 3]].map(|point| (point, [7; 8]));
        let spread = corners.repeat(4);
        assert!(PhotonLeaf::encode(&spread[..7]).is_some());
        assert!(PhotonLeaf::encode(&spread).is_none());
        assert!(PhotonLeaf::encode(&[]).is_none());
    }

    #[test]
    fn a_treelet_gives_back_its_nodes_and_refuses_what_is_out_of_reach() {
        let node = |axis, children| PhotonNode { axis, plane: GRID_MASK - 5, children };
        let nodes = [
            node(0, [PhotonChild::Node(1), PhotonChild::Treelet(1001)]),
            node(2, [PhotonChild::Leaf(500), PhotonChild::Leaf(501)]),
        ];
        let line = PhotonTreelet::encode(&nodes, 500, 1000).expect("fits");
        let treelet = PhotonTreelet(&line);
        assert_eq!(treelet.node(0), Some(nodes[0]));
        assert_eq!(treelet.node(1), Some(nodes[1]));
        assert_eq!(treelet.node(TREELET_NODES as u8), None);
        assert!(PhotonTreelet::encode(&nodes, 400, 1000).is_none());
        assert!(PhotonTreelet::encode(&nodes, 501, 1000).is_none());
        assert!(PhotonTreelet::encode(&[nodes[1]; 25], 500, 1000).is_none());
    }

    #[test]
    fn whatever_a_line_holds_reading_it_ends() {
        let mut next = random(2);
        for _ in 0..2000 {
            let line: [u8; LINE_BYTES] = core::array::from_fn(|_| next() as u8);
            let leaf = PhotonLeaf::read(&line);
            for index in 0..leaf.photons() {
                core::hint::black_box((leaf.point(index), leaf.content(index)));
            }
            for index in 0..=u8::MAX {
                core::hint::black_box(PhotonTreelet(&line).node(index));
            }
        }
    }
}
