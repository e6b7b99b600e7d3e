//! Inner nodes of the bounding volume hierarchy: the boxes of sixteen children in one line.
//!
//! The boxes are quantised to 8 bits per axis on a grid of the node. The grid's unit on each axis is a power
//! of two (Ylitie, Karras, Laine 2017, *Efficient incoherent ray traversal on GPUs through compressed wide
//! BVHs*). A child's box exceeds its contents by at least [`MARGIN`] units, more than the ray caster's
//! rounding error.

use super::wide_node::{Links, NODE_CHILDREN, WideNode, write_links, write_sides};
use super::{read_vector, write_f32};
use crate::address::LINE_BYTES;

/// An inner node of the bounding volume hierarchy, one line. It is a [`WideNode`] with the further fields
/// below. The bounds of the children's boxes are in the node's units, relative to the node's corner.
///
/// | bytes | contents |
/// |---|---|
/// | 0..12 | x, y, z of the corner, metres |
/// | 22..25 | units on x, y, z: biased exponents of `f32` |
#[derive(Clone, Copy)]
pub struct BvhNode<'a>(pub &'a [u8; LINE_BYTES]);

const UNITS: usize = 22;
/// Minimum distance between a face of a stored box and the contents of the box, in the node's units.
const MARGIN: f64 = 1.0 / 4096.0;
/// Minimum biased exponent of a unit; this unit is 2^-95 m. All units are therefore far above the subnormal
/// numbers, and products with them are exact.
const MIN_UNIT: u8 = 32;
const EXPONENT_SHIFT: u32 = 23;

/// An axis-aligned bounding box, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeBox {
    /// Minimum corner, metres.
    pub lower: [f32; 3],
    /// Maximum corner, metres.
    pub upper: [f32; 3],
}

/// Children's boxes on one axis: child `i` extends from `corner + unit * lower[i]` to `corner + unit *
/// upper[i]`.
#[derive(Clone, Copy)]
pub struct BvhAxis<'a> {
    /// Coordinate of the minimum corner of the node's 8-bit grid, metres.
    pub corner: f32,
    /// Unit of the node's 8-bit grid, metres: a power of two.
    pub unit: f32,
    /// Lower bound of each child's box; elements past the last child are meaningless.
    pub lower: &'a [u8; NODE_CHILDREN],
    /// Upper bound of each child's box; elements past the last child are meaningless.
    pub upper: &'a [u8; NODE_CHILDREN],
}

impl<'a> BvhNode<'a> {
    /// Boxes of all children, by axis.
    #[inline(always)]
    pub fn axes(&self) -> [BvhAxis<'a>; 3] {
        let node = WideNode(self.0);
        let [x, y, z] = read_vector(self.0, 0);
        let axis = |axis: usize, corner: f32| {
            let [lower, upper] = node.sides(axis);
            let unit = f32::from_bits(u32::from(node.byte(UNITS + axis)) << EXPONENT_SHIFT);
            BvhAxis { corner, unit, lower, upper }
        };
        [axis(0, x), axis(1, y), axis(2, z)]
    }

    /// Box of child `child`, metres; `None` if absent.
    pub fn bounds(&self, child: usize) -> Option<NodeBox> {
        let [x, y, z] = self.axes().map(|axis| axis.sides(child));
        let sides = [x?, y?, z?];
        let side = |which: fn([f64; 2]) -> f64| sides.map(|sides| which(sides) as f32);
        Some(NodeBox { lower: side(|[lower, _]| lower), upper: side(|[_, upper]| upper) })
    }

    /// Encodes a node. Returns `None` if there are no children, more than [`NODE_CHILDREN`], or a box that is
    /// not finite.
    pub fn encode(children: &[NodeBox], links: Links) -> Option<[u8; LINE_BYTES]> {
        let around = children.iter().copied().reduce(NodeBox::union)?;
        let mut line = [0; LINE_BYTES];
        write_links(&mut line, children.len(), links)?;
        for axis in 0..3 {
            let [lower, upper] = around.sides(axis)?;
            let grid = Grid::around(lower, upper)?;
            write_f32(&mut line, 4 * axis, grid.corner);
            *line.get_mut(UNITS + axis)? = grid.exponent;
            for (child, bounds) in children.iter().enumerate() {
                let [lower, upper] = bounds.sides(axis)?;
                write_sides(&mut line, axis, child, [grid.below(lower)?, grid.above(upper)?])?;
            }
        }
        Some(line)
    }
}

/// One axis of a node's 8-bit grid, with lines at `corner + i unit`. The unit has the biased exponent
/// `exponent`.
struct Grid {
    corner: f32,
    exponent: u8,
}

impl Grid {
    /// Returns the finest grid that covers the interval from `lower` to `upper`, metres. `None` if an end is
    /// not finite or no grid covers the interval.
    fn around(lower: f32, upper: f32) -> Option<Self> {
        if !lower.is_finite() || !upper.is_finite() {
            return None;
        }
        let span = (f64::from(upper) - f64::from(lower)) / 255.0;
        let least = ((span as f32).to_bits() >> EXPONENT_SHIFT) as u8;
        (least.max(MIN_UNIT)..u8::MAX).find_map(|exponent| {
            let mut grid = Self { corner: lower, exponent };
            grid.corner = (f64::from(lower) - MARGIN * grid.unit()) as f32;
            if grid.below(lower).is_none() {
                grid.corner = grid.corner.next_down();
            }
            grid.below(lower).and(grid.above(upper)).map(|_| grid)
        })
    }

    fn unit(&self) -> f64 {
        f64::from(f32::from_bits(u32::from(self.exponent) << EXPONENT_SHIFT))
    }

    fn units(&self, place: f32) -> f64 {
        (f64::from(place) - f64::from(self.corner)) / self.unit()
    }

    /// Returns the greatest grid line that is at least [`MARGIN`] units below the coordinate `place`; `None`
    /// if there is none.
    fn below(&self, place: f32) -> Option<u8> {
        let units = self.units(place) - MARGIN;
        // The conversion rounds down.
        (0.0..=255.0).contains(&units).then_some(units as u8)
    }

    /// Returns the least grid line that is at least [`MARGIN`] units above the coordinate `place`; `None` if
    /// there is none.
    fn above(&self, place: f32) -> Option<u8> {
        let units = self.units(place) + MARGIN;
        let line = units as u64;
        u8::try_from(if (line as f64) < units { line.checked_add(1)? } else { line }).ok()
    }
}

impl NodeBox {
    /// Returns the smallest box that contains both boxes.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let mut union = self;
        for (lower, other) in union.lower.iter_mut().zip(other.lower) {
            *lower = lower.min(other);
        }
        for (upper, other) in union.upper.iter_mut().zip(other.upper) {
            *upper = upper.max(other);
        }
        union
    }

    fn sides(&self, axis: usize) -> Option<[f32; 2]> {
        Some([*self.lower.get(axis)?, *self.upper.get(axis)?])
    }
}

impl BvhAxis<'_> {
    /// Returns the lower and upper bound of the box of child `child`, metres.
    pub fn sides(&self, child: usize) -> Option<[f64; 2]> {
        let [lower, upper] = [*self.lower.get(child)?, *self.upper.get(child)?];
        Some([lower, upper].map(|side| f64::from(self.corner) + f64::from(side) * f64::from(self.unit)))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;
    use crate::layout::tests::random;

    const LINKS: Links = Links { leaves: 1, first_leaf: 100, first_node: 200 };

    /// Boxes of about `size` around `center`. Some are flat, others are points.
    fn boxes(seed: u64, center: f32, size: f32) -> Vec<NodeBox> {
        let mut next = random(seed);
        let count = 1 + next() as usize % NODE_CHILDREN;
        let mut point = || {
            let mut coordinate = || center + ((next() >> 40) as f32 / 16_777_216.0 - 0.5) * size;
            let corner = [coordinate(), coordinate(), center];
            NodeBox { lower: corner, upper: corner }
        };
        (0..count).map(|child| if child % 4 == 3 { point() } else { point().union(point()) }).collect()
    }

    #[test]
    fn a_childs_box_contains_it_with_little_margin() {
        for size in [0.0, 1e-30, 1e-6, 1.0, 77.7, 1e6, 1e30] {
            for center in [0.0, 1e-3, -1.0, 1000.0, -1e7, 1e30] {
                for seed in 1..40 {
                    let boxes = boxes(seed, center, size);
                    let line = BvhNode::encode(&boxes, LINKS).expect("fits");
                    for (child, given) in boxes.iter().enumerate() {
                        for (axis, coded) in BvhNode(&line).axes().iter().enumerate() {
                            let [lower, upper] = coded.sides(child).expect("a child");
                            let margin = MARGIN * f64::from(coded.unit);
                            let [below, above] =
                                [f64::from(given.lower[axis]) - lower, upper - f64::from(given.upper[axis])];
                            assert!(below >= margin && above >= margin, "{below} {above} of {coded:?}");
                            let most = (1.0 + 2.0 * MARGIN) * f64::from(coded.unit);
                            assert!(below <= most && above <= most, "{below} {above} of {coded:?}");
                        }
                    }
                    check_units(&line, &boxes);
                }
            }
        }
    }

    /// Checks that a unit is at most twice the smallest possible, plus the spacing of `f32` at the corner.
    fn check_units(line: &[u8; LINE_BYTES], boxes: &[NodeBox]) {
        let around = boxes.iter().copied().reduce(NodeBox::union).expect("a child");
        for (axis, coded) in BvhNode(line).axes().iter().enumerate() {
            let [lower, upper] = around.sides(axis).expect("an axis");
            let finest = (f64::from(upper) - f64::from(lower)) / 254.0;
            let told = f64::from(lower) - f64::from(lower.next_down());
            assert!(f64::from(coded.unit) <= 2.0 * finest + told.max(1e-28), "{coded:?}");
        }
    }

    #[test]
    fn boxes_that_are_not_finite_are_refused() {
        let nowhere = NodeBox { lower: [f32::NAN; 3], upper: [1.0; 3] };
        let everywhere = NodeBox { lower: [f32::NEG_INFINITY; 3], upper: [f32::INFINITY; 3] };
        assert!(BvhNode::encode(&[nowhere], LINKS).is_none());
        assert!(BvhNode::encode(&[everywhere], LINKS).is_none());
        assert!(BvhNode::encode(&[], LINKS).is_none());
    }

    impl core::fmt::Debug for BvhAxis<'_> {
        fn fmt(&self, formatter: &mut core::fmt::Formatter) -> core::fmt::Result {
            write!(formatter, "corner {:e}, unit {:e}", self.corner, self.unit)
        }
    }
}
