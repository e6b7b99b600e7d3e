//! Inner nodes of the photon map: the boxes of sixteen children in one line.
//!
//! The boxes are quantised to 8 bits per axis on a grid of the node. Rounding is conservative: a child's box
//! contains all its photons. The bounds of all children's boxes on one axis are contiguous, so that one
//! vector instruction reads them.

use super::photon_grid::GRID_MASK;
use super::wide_node::{Links, NODE_CHILDREN, WideNode, write_links, write_sides};
use super::{read_u32, write_u32};
use crate::address::LINE_BYTES;

/// An inner node of a photon map, one line. It is a [`WideNode`] with the further fields below. The bounds of
/// the children's boxes are in the node's units, relative to the node's corner.
///
/// | bytes | contents |
/// |---|---|
/// | 0..12 | x, y, z of the corner: bits 0-23 grid coordinate, 24-31 exponent of the unit on this axis |
/// | 22..24 | photon map: upper 16 bits of [`Self::photon_share`] |
/// | 22..24 | caustic map: one bit per child, set if the normals of all its photons are of one class |
/// | 24..32 | caustic map: four bits per child, class of its normals ([`normal_class`](super::normal_class)) |
#[derive(Clone, Copy)]
pub struct PhotonNode<'a>(pub &'a [u8; LINE_BYTES]);

const COORDINATE_BITS: u32 = 24;
/// Offset of the photon share in a node, bytes.
const SHARE: usize = 22;
/// Offset, bytes, of the bit mask of children of one normal class in a node of a caustic map.
const OF_ONE_CLASS: usize = 22;
/// Offset, bytes, of the children's normal classes in a node of a caustic map.
const CLASSES: usize = 24;
/// Maximum of [`NodeCoordinates::exponent`], for a box as large as the grid.
const MAX_EXPONENT: u32 = 13;

/// An axis-aligned box on the [`super::PhotonGrid`]. Both corners belong to the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridBox {
    /// Minimum corner, grid coordinates.
    pub lower: [u32; 3],
    /// Maximum corner, grid coordinates.
    pub upper: [u32; 3],
}

/// Children's boxes on one axis: child `i` extends from `corner + (lower[i] << exponent)` to
/// `corner + (upper[i] << exponent)`.
#[derive(Clone, Copy)]
pub struct NodeCoordinates<'a> {
    /// Grid coordinate of the node's corner.
    pub corner: u32,
    /// Base-2 logarithm of the unit of `lower` and `upper`, in grid cells.
    pub exponent: u32,
    /// Lower bound of each child's box; elements past the last child are meaningless.
    pub lower: &'a [u8; NODE_CHILDREN],
    /// Upper bound of each child's box; elements past the last child are meaningless.
    pub upper: &'a [u8; NODE_CHILDREN],
}

impl<'a> PhotonNode<'a> {
    /// Returns `r^2 / k`, m^2, for a radius `r` that the host has estimated for this node. A search for the k
    /// nearest photons reduces its radius to `r` at the first node with leaves that it visits. Most of these
    /// searches find k photons within `r`. The value is 0 in a node without leaves, and where the host has no
    /// estimate.
    #[inline(always)]
    pub fn photon_share(&self) -> f32 {
        let [low, high] = [SHARE, SHARE + 1].map(|at| u32::from(WideNode(self.0).byte(at)));
        f32::from_bits(low << 16 | high << 24)
    }

    /// Stores [`Self::photon_share`] in a node's line, rounded up to a mantissa of 7 bits.
    pub fn set_photon_share(line: &mut [u8; LINE_BYTES], share: f32) {
        let [_, _, low, high] = share.to_bits().saturating_add(0xffff).to_le_bytes();
        [line[SHARE], line[SHARE + 1]] = [low, high];
    }

    /// Returns a bit mask of children, for a node of a caustic map. A child is in the mask if all its normals
    /// are of one class ([`normal_class`](super::normal_class)) and this class is not in the bit mask
    /// `classes`.
    #[inline(always)]
    pub fn children_without(&self, classes: u16) -> u16 {
        let node = WideNode(self.0);
        let of_one = u16::from_le_bytes([node.byte(OF_ONE_CLASS), node.byte(OF_ONE_CLASS + 1)]);
        let codes = u64::from(read_u32(self.0, CLASSES)) | u64::from(read_u32(self.0, CLASSES + 4)) << 32;
        let mut without = 0;
        for child in 0..NODE_CHILDREN {
            let class = codes >> (4 * child) & 15;
            without |= (!classes >> class & 1) << child;
        }
        of_one & without
    }

    /// Stores, in a node of a caustic map, the class ([`normal_class`](super::normal_class)) of each child
    /// whose normals are all of one class. `children` yields one bit mask of classes per child. For a child
    /// of several classes no class is stored, and [`Self::children_without`] never returns it.
    pub fn set_classes(line: &mut [u8; LINE_BYTES], children: impl IntoIterator<Item = u16>) {
        let (mut of_one, mut codes) = (0_u16, 0_u64);
        for (child, classes) in children.into_iter().enumerate().take(NODE_CHILDREN) {
            if classes.is_power_of_two() {
                of_one |= 1 << child;
                codes |= u64::from(classes.trailing_zeros()) << (4 * child);
            }
        }
        write_u32(line, CLASSES, codes as u32);
        write_u32(line, CLASSES + 4, (codes >> 32) as u32);
        [line[OF_ONE_CLASS], line[OF_ONE_CLASS + 1]] = of_one.to_le_bytes();
    }

    /// Boxes of all children, by axis.
    #[inline(always)]
    pub fn coordinates(&self) -> [NodeCoordinates<'a>; 3] {
        [self.coordinates_of(0), self.coordinates_of(1), self.coordinates_of(2)]
    }

    #[inline(always)]
    fn coordinates_of(&self, axis: usize) -> NodeCoordinates<'a> {
        let corner = read_u32(self.0, 4 * axis);
        let [lower, upper] = WideNode(self.0).sides(axis);
        NodeCoordinates {
            corner: corner & GRID_MASK,
            exponent: (corner >> COORDINATE_BITS).min(MAX_EXPONENT),
            lower,
            upper,
        }
    }

    /// Encodes a node. Returns `None` if there are no children or more than [`NODE_CHILDREN`].
    pub fn encode(children: &[GridBox], links: Links) -> Option<[u8; LINE_BYTES]> {
        let around = children.iter().copied().reduce(GridBox::union)?;
        let mut line = [0; LINE_BYTES];
        write_links(&mut line, children.len(), links)?;
        for axis in 0..3 {
            let side = |of: &[u32; 3]| of.get(axis).copied().unwrap_or(0);
            let corner = side(&around.lower);
            let exponent =
                (side(&around.upper) - corner).checked_ilog2().map_or(0, |bits| (bits + 1).saturating_sub(8));
            // Rounding up may take the upper side past 255 units.
            let exponent = if (side(&around.upper) - corner).div_ceil(1 << exponent) > 255 {
                exponent + 1
            } else {
                exponent
            };
            write_u32(&mut line, 4 * axis, corner | exponent << COORDINATE_BITS);
            for (child, bounds) in children.iter().enumerate() {
                let lower = ((side(&bounds.lower) - corner) >> exponent) as u8;
                let upper = u8::try_from((side(&bounds.upper) - corner).div_ceil(1 << exponent)).ok()?;
                write_sides(&mut line, axis, child, [lower, upper])?;
            }
        }
        Some(line)
    }
}

impl GridBox {
    /// Box that contains only `point`.
    pub const fn of(point: [u32; 3]) -> Self {
        Self { lower: point, upper: point }
    }

    /// Returns the smallest box that contains both boxes.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let mut union = self;
        for (lower, other) in union.lower.iter_mut().zip(other.lower) {
            *lower = (*lower).min(other);
        }
        for (upper, other) in union.upper.iter_mut().zip(other.upper) {
            *upper = (*upper).max(other);
        }
        union
    }

    /// Returns whether `other` lies within this box.
    pub fn contains(&self, other: &Self) -> bool {
        self.union(*other) == *self
    }
}

impl NodeCoordinates<'_> {
    /// Returns the lower and upper bound of the box of child `child`, grid coordinates.
    pub fn sides(&self, child: usize) -> Option<[u32; 2]> {
        let [lower, upper] = [*self.lower.get(child)?, *self.upper.get(child)?];
        Some([lower, upper].map(|side| self.corner + (u32::from(side) << self.exponent)))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;
    use crate::layout::tests::random;

    const LINKS: Links = Links { leaves: 1, first_leaf: 100, first_node: 200 };

    fn boxes(seed: u64, count: usize, bits: u32) -> Vec<GridBox> {
        let mut next = random(seed);
        let corner: [u32; 3] = core::array::from_fn(|_| next() as u32 & GRID_MASK & !((1 << bits) - 1));
        let mut point = || corner.map(|corner| corner | next() as u32 & ((1 << bits) - 1));
        (0..count).map(|_| GridBox::of(point()).union(GridBox::of(point()))).collect()
    }

    #[test]
    fn a_childs_box_contains_it_with_little_margin() {
        for bits in 0..=20 {
            for count in 1..=NODE_CHILDREN {
                let boxes = boxes(count as u64, count, bits);
                let line = PhotonNode::encode(&boxes, LINKS).expect("fits");
                let node = PhotonNode(&line);
                for (child, given) in boxes.iter().enumerate() {
                    let sides = node.coordinates().map(|axis| axis.sides(child).expect("a child"));
                    let read = GridBox {
                        lower: sides.map(|[lower, _]| lower),
                        upper: sides.map(|[_, upper]| upper),
                    };
                    assert!(read.contains(given), "{read:?} {given:?}");
                    let unit = 1 << bits.saturating_sub(7);
                    let more =
                        |a: [u32; 3], b: [u32; 3]| a.into_iter().zip(b).any(|(a, b)| a.abs_diff(b) >= unit);
                    assert!(
                        !more(read.lower, given.lower) && !more(read.upper, given.upper),
                        "{read:?} {given:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn children_of_one_class_are_without_all_others() {
        let mut line = [0xff; LINE_BYTES];
        PhotonNode::set_classes(&mut line, [1 << 3, 1 << 15, 0b1001, 1, 0].into_iter().chain([1 << 9; 11]));
        let node = PhotonNode(&line);
        assert_eq!(node.children_without(0), !0b1_0100);
        assert_eq!(node.children_without(!0), 0);
        assert_eq!(node.children_without(1 << 3), !0b1_0101);
        assert_eq!(node.children_without(1 << 9), 0b1011);
    }

    #[test]
    fn reading_a_photon_node_of_arbitrary_bytes_does_not_panic() {
        let mut next = random(2);
        for _ in 0..2000 {
            let line: [u8; LINE_BYTES] = core::array::from_fn(|_| next() as u8);
            let node = PhotonNode(&line);
            for child in 0..NODE_CHILDREN {
                core::hint::black_box(node.coordinates().map(|axis| axis.sides(child)));
                core::hint::black_box(node.children_without(child as u16));
            }
        }
    }
}
