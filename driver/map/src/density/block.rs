//! Blocks of sixteen triangles, and their intersection with a ray.

use glam::Vec3;
use photoncard_firmware::simd::{Isa, Kernel, LANES};
use photoncard_shared::layout::TriangleId;

use super::lanes::{LaneVector, at, cross, dot, greatest, least, minus, set};
use super::sides::Sides;

/// Sixteen triangles. The corners of an unused lane coincide, so that no ray or chord hits it.
#[derive(Default)]
pub(super) struct Block {
    pub(super) corners: [LaneVector; 3],
    /// Lower and upper corner of the box around the triangles.
    bounds: [Vec3; 2],
    pub(super) triangles: [Option<TriangleId>; LANES],
    /// Front and back of each triangle in the space of its group. [`Sides::placed`] converts them to the
    /// scene.
    pub(super) sides: [Sides; LANES],
    /// Bit mask of the triangles whose back faces the inside of a solid.
    pub(super) are_solid: u32,
}

impl Block {
    /// Sets the triangle of one lane. The triangles of all lower lanes must be set before.
    pub(super) fn set(&mut self, lane: usize, (triangle, sides): (TriangleId, Sides), corners: &[Vec3; 3]) {
        let [a, b, c] = *corners;
        let own = [a.min(b).min(c), a.max(b).max(c)];
        let [lower, upper] = if lane == 0 { own } else { self.bounds };
        self.bounds = [lower.min(own[0]), upper.max(own[1])];
        for (lanes, corner) in self.corners.iter_mut().zip(corners) {
            set(lanes, lane, *corner);
        }
        (self.triangles[lane], self.sides[lane]) = (Some(triangle), sides);
        self.are_solid |= u32::from(sides.is_solid) << lane;
    }

    /// Returns front and back of the triangle in `lane`, with its normals in the scene.
    #[inline(always)]
    pub(super) fn sides_of(&self, lane: usize, triangle: TriangleId) -> Sides {
        self.sides[lane].placed(triangle, self.corners.each_ref().map(|corner| Vec3::from(at(corner, lane))))
    }

    /// Returns whether the box around the triangles overlaps the box from `lower` to `upper`.
    fn overlaps(&self, [lower, upper]: [Vec3; 2]) -> bool {
        self.bounds[0].cmple(upper).all() && self.bounds[1].cmpge(lower).all()
    }

    /// Returns whether a triangle of the block has exactly these corners.
    pub(super) fn holds(&self, corners: &[Vec3; 3]) -> bool {
        let [a, b, c] = &self.corners;
        let [p, q, r] = corners.map(|corner| corner.to_array());
        // Most triangles differ in this coordinate; without branches, few instructions compare it.
        let mut alike = 0;
        for (lane, x) in a[0].iter().enumerate() {
            alike |= u32::from(*x == p[0]) << lane;
        }
        alike != 0 && (0..LANES).any(|lane| at(a, lane) == p && at(b, lane) == q && at(c, lane) == r)
    }
}

/// Returns the normals of the three planes through `point` and an edge of triangle `lane`. Also returns six
/// times the signed volume of the tetrahedron of the point and the triangle.
///
/// If two triangles share an edge, their two planes through it have exactly opposite normals. Thus no ray
/// passes between the triangles.
#[inline(always)]
fn seen_from(point: [f32; 3], block: &Block, lane: usize) -> ([[f32; 3]; 3], f32) {
    let corner = |corner: usize| minus(at(&block.corners[corner], lane), point);
    let [a, b, c] = [corner(0), corner(1), corner(2)];
    let planes = [cross(b, c), cross(c, a), cross(a, b)];
    (planes, dot(a, planes[0]))
}

/// Kernel that finds the nearest triangle along a ray. Coordinates are relative to a ball's centre, in units
/// of its radius.
pub(super) struct FirstOnWay<'a> {
    pub(super) blocks: &'a [Block],
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// Distance within which no triangle is missed, in units of the direction's length.
    pub(super) reach: f32,
}

/// Margin for rounding errors of a ray's end, in a ball's coordinates.
const MARGIN: f32 = 1e-3;

impl Kernel for FirstOnWay<'_> {
    /// Distance of the nearest triangle, in units of the direction's length, and the triangle's corners.
    type Output = Option<(f32, [Vec3; 3])>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let (origin, direction) = (self.origin.to_array(), self.direction.to_array());
        let mut first = (f32::INFINITY, [Vec3::ZERO; 3]);
        let end = self.origin + self.direction * self.reach;
        let way = [self.origin.min(end) - MARGIN, self.origin.max(end) + MARGIN];
        for block in self.blocks {
            if !block.overlaps(way) {
                continue;
            }
            let mut distances = [0.0; LANES];
            for (lane, target) in distances.iter_mut().enumerate() {
                let ([u, v, w], volume) = seen_from(origin, block, lane);
                let [u, v, w] = [dot(u, direction), dot(v, direction), dot(w, direction)];
                let determinant = u + v + w;
                let is_met = (least(least(u, v), w) >= 0.0) | (greatest(greatest(u, v), w) <= 0.0);
                let distance = volume / determinant;
                *target =
                    if is_met & (determinant != 0.0) & (distance > 0.0) { distance } else { f32::INFINITY };
            }
            // The bits of positive floats ascend with the value.
            let mut bits = [0; LANES];
            for (bits, distance) in bits.iter_mut().zip(&distances) {
                *bits = distance.to_bits();
            }
            let mut nearer = isa.below(&bits, first.0.to_bits());
            while nearer != 0 {
                let lane = nearer.trailing_zeros() as usize % LANES;
                nearer &= nearer - 1;
                if distances[lane] < first.0 {
                    let corners = block.corners.each_ref().map(|corner| Vec3::from(at(corner, lane)));
                    first = (distances[lane], corners);
                }
            }
        }
        first.0.is_finite().then_some(first)
    }
}
