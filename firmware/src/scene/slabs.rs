//! Slab test: intersects a ray with the boxes of all children of a node at once.
//!
//! On each axis, the coordinate of a box's face is `corner + unit * side`, where `side` is a byte. A ray with
//! the direction component `d` reaches the face's plane at the distance
//! `(corner - origin) / d + side * (unit / d)`. The first term and `unit / d` are common to all boxes of a
//! node.
//!
//! The test is conservative under rounding (compare Ize 2013, *Robust BVH ray traversal*). The first term is
//! decreased for near planes and increased for far planes, by more than its rounding error plus that of the
//! triangle test. Stored boxes are enlarged by more than the rounding error of the second term and of the
//! sum.

use photoncard_shared::layout::{BvhAxis, BvhNode, Instance, NODE_CHILDREN, placed_point, placed_vector};

use super::Ray;
use crate::simd::{Isa, LANES};
use crate::vector::{max, max_component, min};
use crate::wide_tree::BEYOND;

/// Ray prepared for slab tests: for each axis, the origin and the reciprocal of the direction.
pub(super) struct Slabs {
    axes: [SlabAxis; 3],
}

struct SlabAxis {
    origin: f32,
    /// Reciprocal of the direction's component on this axis.
    inverse: f32,
    /// True if the reciprocal is negative. The ray then reaches the upper face of a box first.
    is_downwards: bool,
    /// Margin, as a distance along the ray, for rounding errors of the ray's transform to a group's space; 0
    /// in world space.
    slack: f32,
}

/// Relative margin for rounding errors: a fraction of the distance along the ray to the plane of the node's
/// corner.
const MARGIN: f32 = 8.0 * f32::EPSILON;

/// Minimum magnitude of a direction's component. It replaces smaller components, whose reciprocals would
/// overflow.
const MIN_COMPONENT: f32 = 1e-20;

impl Slabs {
    #[inline(always)]
    pub(super) fn new(ray: &Ray) -> Self {
        let [x, y, z] = ray.direction.to_array();
        let [a, b, c] = ray.origin.to_array();
        Self { axes: [SlabAxis::new(a, x), SlabAxis::new(b, y), SlabAxis::new(c, z)] }
    }

    /// Prepares a ray, in world space, for boxes in the space of an instance's group.
    pub(super) fn in_group(ray: &Ray, instance: &Instance) -> Self {
        let rows = &instance.to_group;
        let [origin, direction] =
            [placed_point(rows, ray.origin.to_array()), placed_vector(rows, ray.direction.to_array())];
        let mut slabs = Self::new(&Ray { origin: origin.into(), direction: direction.into(), ..*ray });
        // Upper bound of the distance at which the ray meets the instance. The rounding errors of the ray's
        // origin, of its direction over this distance, and of the triangles' vertices are proportional to the
        // terms of the sums that compute them.
        let far = 2.0 * (instance.reach + max_component(ray.origin.abs()));
        for (axis, [a, b, c, d]) in slabs.axes.iter_mut().zip(rows) {
            let terms = (a.abs() + b.abs() + c.abs()) * (2.0 * far) + d.abs();
            axis.slack = MARGIN * terms * axis.inverse.abs();
        }
        slabs
    }

    /// Distance at which the ray enters each child's box, as `f32` bits; [`BEYOND`] if the ray misses the box
    /// or enters it beyond the distance `until`, metres.
    #[inline(always)]
    pub(super) fn enter(&self, isa: impl Isa, node: BvhNode, children: usize, until: f32) -> [u32; LANES] {
        let [x, y, z] = node.axes();
        let [a, b, c] = &self.axes;
        let [x, y, z] = [a.planes(&x), b.planes(&y), c.planes(&z)];
        let mut distances = [BEYOND; LANES];
        for lane in 0..isa.lanes(children) {
            // `max` and `min` return the right operand if the left one is NaN.
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
        Self { origin, inverse, is_downwards: inverse < 0.0, slack: 0.0 }
    }

    /// Prepares the distances along the ray to the planes of a node's boxes on this axis.
    #[inline(always)]
    fn planes<'a>(&self, axis: &BvhAxis<'a>) -> Planes<'a> {
        let corner = (axis.corner - self.origin) * self.inverse;
        let margin = corner.abs() * MARGIN + self.slack;
        let (near, far) = if self.is_downwards { (axis.upper, axis.lower) } else { (axis.lower, axis.upper) };
        Planes { near, far, first: corner - margin, last: corner + margin, unit: axis.unit * self.inverse }
    }
}

/// Planes of a node's boxes on one axis. The distance along the ray is `near * unit + first` to the near face
/// of a box, and `far * unit + last` to the far face.
struct Planes<'a> {
    near: &'a [u8; NODE_CHILDREN],
    far: &'a [u8; NODE_CHILDREN],
    /// Distance along the ray to the plane of the node's corner, less the margin for rounding. `last` is the
    /// distance plus this margin.
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
