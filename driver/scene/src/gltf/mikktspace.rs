//! Tangents by `MikkTSpace` (Mikkelsen 2008, *Simulation of wrinkled surfaces revisited*), as bakers of
//! normal maps compute them.
//!
//! Time is quadratic, and the stack depth linear, in the number of triangles that share a vertex. If more
//! than [`FAN`] triangles share a vertex, they are therefore treated as if they had no neighbours. In a flat
//! fan this gives the same tangents.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, Ops, TangentSpace, generate_tangents};
use glam::{Vec2, Vec3, Vec4};

/// Maximum number of triangles that share a vertex at which tangents are averaged.
const FAN: u32 = 128;

/// Memory that [`tangents`] takes per triangle, including argument and result, bytes.
pub(super) const BYTES_OF_A_TRIANGLE: u64 = 1600;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    pub(super) position: Vec3,
    /// Unit normal.
    pub(super) normal: Vec3,
    /// Texture coordinates; v counts downwards.
    pub(super) coordinates: Vec2,
}

impl Corner {
    /// Key that is equal for corners with equal positions, normals and coordinates. -0 equals 0.
    fn vertex(&self) -> [u32; 8] {
        let Self { position: p, normal: n, coordinates: c } = self;
        [p.x, p.y, p.z, n.x, n.y, n.z, c.x, c.y].map(|value| (value + 0.0).to_bits())
    }
}

/// Computes the tangents of triangles' corners: unit vectors along which u increases, with glTF's sign of the
/// bitangent in w. They are zero where the coordinates do not vary.
pub(super) fn tangents(triangles: &[[Corner; 3]]) -> Vec<[Vec4; 3]> {
    let mut fans: HashMap<[u32; 8], u32> = HashMap::with_capacity(triangles.len());
    for corner in triangles.as_flattened() {
        *fans.entry(corner.vertex()).or_default() += 1;
    }
    let is_shared = |(_, corners): &(usize, &[Corner; 3])| {
        let [a, b, c] = corners.map(|corner| corner.position);
        // A triangle with coinciding corners does not affect its neighbours.
        a != b && b != c && c != a && corners.iter().all(|corner| fans[&corner.vertex()] <= FAN)
    };
    let faces = triangles.iter().enumerate().filter(is_shared).map(|(index, _)| index).collect();
    drop(fans);
    let own = triangles.iter().map(own_tangents).collect();
    let mut mesh = Mesh { triangles, faces, tangents: own };
    // The error type has no variants: the call cannot fail.
    let _ = generate_tangents(&mut mesh);
    mesh.tangents
}

/// Tangents of a triangle, computed without its neighbours.
fn own_tangents(corners: &[Corner; 3]) -> [Vec4; 3] {
    let [a, b, c] = corners;
    let [[s, t], [q, r]] = [b, c].map(|corner| (corner.coordinates - a.coordinates).to_array());
    let area = s * r - t * q;
    // glTF's bitangent points upwards in the texture, against v: its sign is opposite to the area's.
    let sign = if area < 0.0 { 1.0 } else { -1.0 };
    let along = ((b.position - a.position) * r - (c.position - a.position) * t) * -sign;
    corners.map(|Corner { normal, .. }| {
        let tangent = (along - normal * normal.dot(along)).normalize_or_zero();
        tangent.extend(sign)
    })
}

/// Input and output of the crate `bevy_mikktspace`.
struct Mesh<'t> {
    triangles: &'t [[Corner; 3]],
    /// Indices of the triangles that the crate reads.
    faces: Vec<usize>,
    tangents: Vec<[Vec4; 3]>,
}

impl Mesh<'_> {
    fn corner(&self, face: usize, corner: usize) -> &Corner {
        &self.triangles[self.faces[face]][corner]
    }
}

/// Adds zero to components, because the crate would distinguish -0 and 0 as different vertices.
impl Geometry<Libm> for Mesh<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        (self.corner(face, corner).position + 0.0).to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        (self.corner(face, corner).normal + 0.0).to_array()
    }

    /// Returns coordinates with `-v`, because v increases upwards in the algorithm.
    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let Vec2 { x, y } = self.corner(face, corner).coordinates;
        [x + 0.0, 0.0 - y]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        if let Some(space) = space {
            self.tangents[self.faces[face]][corner] = space.tangent_encoded().into();
        }
    }
}

/// Mathematical functions whose results are equal on every processor.
struct Libm;

impl Ops for Libm {
    fn sqrt(x: f32) -> f32 {
        libm::sqrtf(x)
    }

    fn acos(x: f32) -> f32 {
        libm::acos(f64::from(x)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(position: [f32; 3], coordinates: [f32; 2]) -> Corner {
        Corner { position: position.into(), normal: Vec3::Z, coordinates: coordinates.into() }
    }

    /// Fan of `count` triangles around the origin, with planar texture coordinates. The corners of its rim
    /// are 0, 1 and 2 times `height` above the origin by turns.
    fn fan(count: u32, height: f32) -> Vec<[Corner; 3]> {
        let rim = |step: u32| {
            let (y, x) = (std::f32::consts::TAU * (step % count) as f32 / count as f32).sin_cos();
            corner([x, y, height * (step % 3) as f32], [x, -y])
        };
        (0..count).map(|step| [corner([0.0; 3], [0.0; 2]), rim(step), rim(step + 1)]).collect()
    }

    #[test]
    fn tangents_point_along_u_and_bitangents_against_v() {
        for (coordinates, tangent) in [
            ([[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]], [1.0, 0.0, 0.0, 1.0]),
            // u runs along -x: mirrored.
            ([[1.0, 1.0], [0.0, 1.0], [1.0, 0.0]], [-1.0, 0.0, 0.0, -1.0]),
            // u runs along y.
            ([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]], [0.0, 1.0, 0.0, 1.0]),
        ] {
            let [a, b, c] = coordinates;
            let triangle = [corner([0.0; 3], a), corner([1.0, 0.0, 0.0], b), corner([0.0, 1.0, 0.0], c)];
            assert_eq!(tangents(&[triangle]), [[Vec4::from(tangent); 3]], "{coordinates:?}");
            assert_eq!(own_tangents(&triangle), [Vec4::from(tangent); 3], "{coordinates:?}");
        }
    }

    #[test]
    fn neighbours_share_the_mean_of_their_tangents_by_angle() {
        // Two triangles with a common edge along y, u along x in the plane and along x and z on the slope.
        let [low, high] = [corner([0.0; 3], [0.0, 0.0]), corner([0.0, 1.0, 0.0], [0.0, -1.0])];
        let left = corner([-1.0, 0.0, 0.0], [-1.0, 0.0]);
        let right = corner([0.6, 0.0, 0.8], [1.0, 0.0]);
        let normal = Vec3::new(-0.4, 0.0, 0.8).normalize();
        let triangles = [[low, high, left], [low, right, high]];
        let triangles = triangles.map(|corners| corners.map(|corner| Corner { normal, ..corner }));
        let [[shared, ..], [other, ..]] = tangents(&triangles)[..] else { panic!("two triangles") };
        assert_eq!(shared, other);
        assert!(shared.truncate().distance(Vec3::new(0.8, 0.0, 0.4).normalize()) < 1e-6, "{shared}");
        assert_eq!(shared.w, 1.0);
    }

    #[test]
    fn coordinates_that_do_not_vary_have_no_tangent() {
        let triangle = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|place| corner(place, [0.5; 2]));
        assert_eq!(tangents(&[triangle])[0].map(Vec4::truncate), [Vec3::ZERO; 3]);
    }

    /// The fans have the tangents of triangles without neighbours, because averaging would exceed the stack
    /// and the time of a test.
    #[test]
    fn wide_fans_have_their_own_tangents() {
        let mut wide = fan(200_000, 0.0);
        wide.extend_from_within(..100_000);
        assert!(
            tangents(&wide)
                .iter()
                .flatten()
                .all(|tangent| tangent.distance(Vec4::new(1.0, 0.0, 0.0, 1.0)) < 1e-2)
        );
        // Up to `FAN` triangles the tangents at a vertex are averaged.
        let apex =
            |count: u32| tangents(&fan(count, 0.5)).iter().map(|corners| corners[0]).collect::<Vec<_>>();
        let is_one = |tangents: &[Vec4]| tangents.iter().all(|tangent| *tangent == tangents[0]);
        assert!(is_one(&apex(FAN)) && !is_one(&apex(FAN + 1)));
    }
}
