//! Blocks of sixteen triangles, and their intersection with a ray.

use glam::Vec3;
use photoncard_firmware::simd::{Isa, Kernel, LANES};

use super::lanes::{LaneVector, at, cross, dot, greatest, least, minus};
use super::sides::Sides;

/// Sixteen triangles. The corners of an unused lane coincide, so that no ray or chord hits it.
#[derive(Default)]
pub(super) struct Block {
    pub(super) corners: [LaneVector; 3],
    /// Indices of the triangles in the card image.
    pub(super) indices: [u32; LANES],
    pub(super) sides: [Sides; LANES],
    /// Bit mask of the triangles whose back faces the inside of a solid.
    pub(super) are_solid: u32,
}

impl Block {
    /// Returns whether a triangle of the block has exactly these corners.
    pub(super) fn holds(&self, corners: &[Vec3; 3]) -> bool {
        let [a, b, c] = &self.corners;
        let [p, q, r] = corners.map(|corner| corner.to_array());
        (0..LANES).any(|lane| a[0][lane] == p[0] && at(a, lane) == p && at(b, lane) == q && at(c, lane) == r)
    }
}

/// Returns the normals of the three planes through `point` and an edge of triangle `lane`. Also returns six
/// times the signed volume of the tetrahedron of the point and the triangle.
///
/// The two triangles of a shared edge have exactly opposite normals for it, so that no ray passes between
/// them.
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
}

impl Kernel for FirstOnWay<'_> {
    /// Distance of the nearest triangle, in units of the direction's length, and the triangle's corners.
    type Output = Option<(f32, [Vec3; 3])>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let (origin, direction) = (self.origin.to_array(), self.direction.to_array());
        let mut first = (f32::INFINITY, [Vec3::ZERO; 3]);
        for block in self.blocks {
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
