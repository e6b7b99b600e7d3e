//! Ray against the boxes of a node: where it enters each of them, all at once.
//!
//! A side of a box is at `corner + unit * side`. The distance to its plane is `(corner - origin) / d + side * (unit / d)`,
//! in which a node has the first part and the factor of the second in common.
//!
//! Rounding never loses a box that holds what the ray meets: the first part is made less for near sides, and greater for
//! far ones, by more than it and the triangle test round, and boxes are larger than what they hold by more than the second part and
//! the sum round (as Ize 2013, *Robust BVH ray traversal*, does with far distances).

use photoncard_shared::layout::{BvhAxis, BvhNode, NODE_CHILDREN};

use super::Ray;
use crate::simd::{Isa, LANES};
use crate::vector::{max, min};
use crate::wide_tree::BEYOND;

/// A ray made ready for many boxes.
pub(super) struct Slabs {
    axes: [SlabAxis; 3],
}

/// One axis of it.
struct SlabAxis {
    origin: f32,
    /// One over the direction.
    inverse: f32,
}

/// How much is left for rounding, in proportion.
const MARGIN: f32 = 8.0 * f32::EPSILON;

/// A component of a direction that is less than this would overflow products: one that small is as good.
const MIN_COMPONENT: f32 = 1e-20;

impl Slabs {
    #[inline(always)]
    pub(super) fn new(ray: &Ray) -> Self {
        let [x, y, z] = ray.direction.to_array();
        let [a, b, c] = ray.origin.to_array();
        Self { axes: [SlabAxis::new(a, x), SlabAxis::new(b, y), SlabAxis::new(c, z)] }
    }

    /// The bits of where the ray enters each child's box: [`BEYOND`] if it does not, or beyond `until`.
    #[inline(always)]
    pub(super) fn enter(&self, isa: impl Isa, node: BvhNode, children: usize, until: f32) -> [u32; LANES] {
        let [x, y, z] = node.axes();
        let [a, b, c] = &self.axes;
        let [x, y, z] = [a.planes(&x), b.planes(&y), c.planes(&z)];
        let mut distances = [BEYOND; LANES];
        for lane in 0..isa.lanes(children) {
            // What is no number, on the left, counts for nothing.
            let near = max(x.near(lane), max(y.near(lane), max(z.near(lane), 0.0)));
            let far = min(x.far(lane), min(y.far(lane), min(z.far(lane), until)));
            if let Some(distance) = distances.get_mut(lane) {
                *distance = if near <= far { near.to_bits() } else { BEYOND };
            }
        }
        distances
    }
}

impl SlabAxis {
    #[inline(always)]
    fn new(origin: f32, direction: f32) -> Self {
        let inverse = 1.0 / if direction.abs() < MIN_COMPONENT { MIN_COMPONENT } else { direction };
        Self { origin, inverse }
    }

    /// The planes of the sides of a node's boxes.
    #[inline(always)]
    fn planes<'a>(&self, axis: &BvhAxis<'a>) -> Planes<'a> {
        let corner = (axis.corner - self.origin) * self.inverse;
        let margin = corner.abs() * MARGIN;
        let (near, far) =
            if self.inverse < 0.0 { (axis.upper, axis.lower) } else { (axis.lower, axis.upper) };
        Planes { near, far, first: corner - margin, last: corner + margin, unit: axis.unit * self.inverse }
    }
}

/// Planes on one axis, by their distance along the ray.
struct Planes<'a> {
    near: &'a [u8; NODE_CHILDREN],
    far: &'a [u8; NODE_CHILDREN],
    /// The least that the distance of the node's corner may be, and the greatest.
    first: f32,
    last: f32,
    unit: f32,
}

impl Planes<'_> {
    #[inline(always)]
    fn near(&self, child: usize) -> f32 {
        side(self.near, child) * self.unit + self.first
    }

    #[inline(always)]
    fn far(&self, child: usize) -> f32 {
        side(self.far, child) * self.unit + self.last
    }
}

#[inline(always)]
fn side(sides: &[u8; NODE_CHILDREN], child: usize) -> f32 {
    f32::from(sides.get(child).copied().unwrap_or(0))
}
