//! Watertight ray-triangle intersection (Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*).
//!
//! A ray through an edge that two triangles share hits at least one of the two. The triangle is sheared so
//! that the ray runs along +z. The signs of three edge functions then decide whether the ray hits it. If an
//! edge function is zero in `f32`, all three are computed again in `f64`, in which their products are exact.

use glam::Vec3;
use photoncard_shared::layout::{BvhLeaf, LEAF_TRIANGLES, Triangle, TriangleId, VERTEX_LANES};

use super::Ray;
use crate::simd::{HALF_LANES, Isa, LANES};
use crate::vector::{max, min};

const _: () = assert!(LEAF_TRIANGLES == HALF_LANES && VERTEX_LANES <= LANES);

/// Ray prepared for tests of triangles: its origin, the permutation of the axes, and the shear.
#[derive(Clone, Copy, Debug)]
pub struct RayFrame {
    /// Permutation of the axes that puts the direction's greatest component last.
    axes: [usize; 3],
    /// Origin of the ray on the permuted axes, metres.
    origin: [f32; 3],
    shear: [f32; 3],
}

/// Intersection of a ray and a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// Distance along the ray, metres.
    pub distance: f32,
    /// Barycentric coordinates: the weights of the three corners, whose sum is 1.
    pub barycentric: [f32; 3],
}

/// Intersection, with the triangle that was hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance and barycentric coordinates.
    pub intersection: Intersection,
    /// The triangle, in world space.
    pub triangle: Triangle,
    /// Index of the triangle, and of its instance.
    pub id: TriangleId,
}

#[inline(always)]
fn component([x, y, z]: [f32; 3], axis: usize) -> f32 {
    match axis {
        0 => x,
        1 => y,
        _ => z,
    }
}

impl RayFrame {
    /// Computes the permutation and the shear from a ray's direction.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let magnitude = ray.direction.abs();
        let last = if magnitude.x > magnitude.y && magnitude.x > magnitude.z {
            0
        } else if magnitude.y > magnitude.z {
            1
        } else {
            2
        };
        let axes = [(last + 1) % 3, (last + 2) % 3, last];
        let [x, y, z] = axes;
        let on_axes = |v: Vec3| {
            let v = v.to_array();
            [component(v, x), component(v, y), component(v, z)]
        };
        let [x, y, z] = on_axes(ray.direction);
        Self { axes, origin: on_axes(ray.origin), shear: [x / z, y / z, 1.0 / z] }
    }

    /// Shears a corner, given on the permuted axes. Returns the sheared x and y relative to the ray's origin,
    /// and the depth: the corner's z minus the origin's z, not yet divided by the direction's z.
    #[inline(always)]
    fn shear(&self, [x, y, z]: [f32; 3]) -> ([f32; 2], f32) {
        let [origin_x, origin_y, origin_z] = self.origin;
        let [shear_x, shear_y, _] = self.shear;
        let depth = z - origin_z;
        ([x - origin_x - shear_x * depth, y - origin_y - shear_y * depth], depth)
    }

    /// Shears the triangles of a leaf. `corners` must be the leaf's [`BvhLeaf::all_corners`].
    #[inline(always)]
    pub(super) fn leaf<'a>(&self, isa: impl Isa, leaf: BvhLeaf, corners: &'a Corners) -> ShearedLeaf<'a> {
        let [x, y, z] = self.axes;
        let [x, y, z] = [leaf.coordinates(x), leaf.coordinates(y), leaf.coordinates(z)];
        let (mut across, mut up, mut depth) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for lane in 0..isa.lanes(leaf.vertices() as usize).min(VERTEX_LANES) {
            let at = |coordinates: &[f32; VERTEX_LANES]| coordinates.get(lane).copied().unwrap_or(0.0);
            let ([u, v], w) = self.shear([at(&x), at(&y), at(&z)]);
            if let (Some(across), Some(up), Some(depth)) =
                (across.get_mut(lane), up.get_mut(lane), depth.get_mut(lane))
            {
                (*across, *up, *depth) = (u, v, w);
            }
        }
        let [a, b, c] = corners;
        let [a, b, c] =
            [permute(isa, &across, &up, a), permute(isa, &across, &up, b), permute(isa, &across, &up, c)];
        let mut misses = [0; LANES];
        let mut edge_lanes = [[0.0; LEAF_TRIANGLES]; 3];
        let [us, vs, ws] = &mut edge_lanes;
        for lane in 0..isa.lanes(leaf.triangles() as usize).min(LEAF_TRIANGLES) {
            let at = |[x, y]: &[[f32; LEAF_TRIANGLES]; 2]| {
                [x.get(lane).copied().unwrap_or(0.0), y.get(lane).copied().unwrap_or(0.0)]
            };
            let [u, v, w] = edges(at(&a), at(&b), at(&c));
            // A product of zero means that an edge function may be zero only by rounding. The triangle may
            // then be hit.
            let is_missed = (min(min(u, v), w) < 0.0) & (max(max(u, v), w) > 0.0) & (u * v * w != 0.0);
            if let (Some(miss), Some(us), Some(vs), Some(ws)) =
                (misses.get_mut(lane), us.get_mut(lane), vs.get_mut(lane), ws.get_mut(lane))
            {
                (*miss, *us, *vs, *ws) = (u32::from(is_missed), u, v, w);
            }
        }
        let may_meet = isa.below(&misses, 1) & !(u32::MAX << leaf.triangles());
        ShearedLeaf { may_meet, across, up, depth, corners, edges: edge_lanes }
    }

    /// Intersects the ray with either side of a triangle, at a distance in (0, `max_distance`], metres.
    #[inline(always)]
    pub fn intersect(&self, vertices: &[[f32; 3]; 3], max_distance: f32) -> Option<Intersection> {
        let [x, y, z] = self.axes;
        let on_axes = |vertex| [component(vertex, x), component(vertex, y), component(vertex, z)];
        let [a, b, c] = *vertices;
        self.intersect_on_axes([on_axes(a), on_axes(b), on_axes(c)], max_distance)
    }

    /// Does [`Self::intersect`] for triangle `slot` of a leaf.
    #[inline(always)]
    pub(super) fn intersect_slot(
        &self,
        leaf: &ShearedLeaf,
        slot: usize,
        max_distance: f32,
    ) -> Option<Intersection> {
        let lane = |lanes: &[f32; LEAF_TRIANGLES]| lanes.get(slot).copied().unwrap_or(0.0);
        let [u, v, w] = &leaf.edges;
        let [a, b, c] = leaf.corners;
        let corners = [leaf.vertex(a, slot), leaf.vertex(b, slot), leaf.vertex(c, slot)];
        self.intersect_sheared([lane(u), lane(v), lane(w)], corners, max_distance)
    }

    #[inline(always)]
    fn intersect_on_axes(&self, [a, b, c]: [[f32; 3]; 3], max_distance: f32) -> Option<Intersection> {
        let corners = [self.shear(a), self.shear(b), self.shear(c)];
        let [(a, _), (b, _), (c, _)] = corners;
        self.intersect_sheared(edges(a, b, c), corners, max_distance)
    }

    /// Computes the intersection from edge functions and sheared corners.
    #[inline(always)]
    fn intersect_sheared(
        &self,
        mut edges: [f32; 3],
        [(a, a_depth), (b, b_depth), (c, c_depth)]: [([f32; 2], f32); 3],
        max_distance: f32,
    ) -> Option<Intersection> {
        if edges.contains(&0.0) {
            edges = [cross_exact(c, b), cross_exact(a, c), cross_exact(b, a)];
        }
        let [u, v, w] = edges;
        let negative = u < 0.0 || v < 0.0 || w < 0.0;
        let positive = u > 0.0 || v > 0.0 || w > 0.0;
        let determinant = u + v + w;
        if negative && positive || determinant == 0.0 {
            return None;
        }
        let [.., scale] = self.shear;
        let inverse = 1.0 / determinant;
        let distance = (u * a_depth + v * b_depth + w * c_depth) * scale * inverse;
        let inside = distance > 0.0 && distance <= max_distance;
        inside.then_some(Intersection { distance, barycentric: [u * inverse, v * inverse, w * inverse] })
    }
}

/// Indices, in a leaf's list of vertices, of the first, second and third corners of all its triangles.
pub(super) type Corners = [[u32; LEAF_TRIANGLES]; 3];

/// Triangles of a leaf, sheared by a [`RayFrame`].
pub(super) struct ShearedLeaf<'a> {
    /// Bit mask of the triangles that the ray may hit: a superset of those for which
    /// [`RayFrame::intersect_slot`] returns a hit.
    pub(super) may_meet: u32,
    /// Sheared x coordinates of the vertices.
    across: [f32; LANES],
    up: [f32; LANES],
    /// Depths of the vertices along z, not divided by the ray direction's z.
    depth: [f32; LANES],
    corners: &'a Corners,
    /// Edge functions of the triangles.
    edges: [[f32; LEAF_TRIANGLES]; 3],
}

impl ShearedLeaf<'_> {
    /// Sheared position and depth of a corner of triangle `slot`. `corner` is one of the `Corners` lists.
    #[inline(always)]
    fn vertex(&self, corner: &[u32; LEAF_TRIANGLES], slot: usize) -> ([f32; 2], f32) {
        let index = corner.get(slot).copied().unwrap_or(0) as usize % LANES;
        let at = |lanes: &[f32; LANES]| lanes.get(index).copied().unwrap_or(0.0);
        ([at(&self.across), at(&self.up)], at(&self.depth))
    }
}

/// Sheared x and y of one corner of every triangle. `vertices` has the corners' indices in the leaf's list of
/// vertices.
#[inline(always)]
fn permute(
    isa: impl Isa,
    across: &[f32; LANES],
    up: &[f32; LANES],
    vertices: &[u32; LEAF_TRIANGLES],
) -> [[f32; LEAF_TRIANGLES]; 2] {
    [isa.permute(across, vertices), isa.permute(up, vertices)]
}

/// Edge functions of a sheared triangle at the origin; the first is for the edge opposite to `a`, and so on.
#[inline(always)]
fn edges(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> [f32; 3] {
    [cross(c, b), cross(a, c), cross(b, a)]
}

#[inline(always)]
fn cross([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> f32 {
    ax * by - ay * bx
}

#[cold]
fn cross_exact([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> f32 {
    (ax as f64 * by as f64 - ay as f64 * bx as f64) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::RayKind;

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn meet(origin: [f32; 3], direction: [f32; 3]) -> Option<Intersection> {
        let ray = Ray::new(RayKind::Radiance, origin.into(), Vec3::from(direction).normalize());
        RayFrame::new(&ray).intersect(&TRIANGLE, ray.max_distance)
    }

    #[test]
    fn a_ray_meets_a_triangle_from_both_sides_at_its_distance() {
        let above = meet([0.25, 0.5, 2.0], [0.0, 0.0, -1.0]).unwrap();
        assert_eq!(above.distance, 2.0);
        assert_eq!(above.barycentric, [0.25, 0.25, 0.5]);
        assert_eq!(meet([0.25, 0.5, -3.0], [0.0, 0.0, 1.0]).unwrap().distance, 3.0);
    }

    #[test]
    fn a_ray_misses_beside_behind_and_along_the_plane() {
        assert_eq!(meet([0.75, 0.5, 2.0], [0.0, 0.0, -1.0]), None);
        assert_eq!(meet([0.25, 0.5, 2.0], [0.0, 0.0, 1.0]), None);
        assert_eq!(meet([-1.0, 0.2, 0.0], [1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn no_ray_passes_between_two_triangles() {
        let quad = [[-1.0_f32, -1.0, 0.3], [1.1, -1.0, 0.0], [1.0, 1.3, 0.2], [-1.0, 1.0, -0.1]];
        let halves = [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]];
        for i in 0..20_000 {
            let t = (i as f32 + 100.0) / 20_200.0;
            let target = Vec3::from(quad[0]) * (1.0 - t) + Vec3::from(quad[2]) * t;
            let origin = Vec3::new(0.3, -0.2 + t, 4.0 - t);
            let ray = Ray::new(RayKind::Radiance, origin, (target - origin).normalize());
            let frame = RayFrame::new(&ray);
            assert!(halves.iter().any(|half| frame.intersect(half, f32::INFINITY).is_some()), "{t}");
        }
    }
}
