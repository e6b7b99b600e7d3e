//! Triangles, and what their corners carry beyond a place.

use glam::{Vec2, Vec3};

/// [`Triangle::attributes`] of a triangle whose corners carry nothing but their places.
pub const NO_ATTRIBUTES: u32 = u32::MAX;

/// A triangle in world space, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// The three corners.
    pub vertices: [Vec3; 3],
    /// Index into [`Scene::materials`](super::Scene::materials).
    pub material: u32,
    /// Index into [`Scene::attributes`](super::Scene::attributes), or [`NO_ATTRIBUTES`].
    pub attributes: u32,
}

impl Triangle {
    /// A triangle without attributes.
    pub fn new(vertices: [Vec3; 3], material: u32) -> Self {
        Self { vertices, material, attributes: NO_ATTRIBUTES }
    }

    /// The cross product of two edges: its direction is the geometric normal's, its length twice the area in m^2.
    pub fn scaled_normal(&self) -> Vec3 {
        let [a, b, c] = self.vertices;
        (b - a).cross(c - a)
    }

    /// The area in m^2.
    pub fn area(&self) -> f32 {
        0.5 * self.scaled_normal().length()
    }
}

/// What the corners of a triangle carry beyond their places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attributes {
    /// Unit shading normals of the corners in world space, on the front's side. `None`: the triangle is flat, also
    /// where all three equal the geometric normal.
    pub normals: Option<[Vec3; 3]>,
    /// Texture coordinates of the corners, sets 0 and 1 (`TEXCOORD_0` and `TEXCOORD_1`), untransformed; v counts from
    /// the image's top.
    pub coordinates: [[Vec2; 3]; 2],
    /// Linear RGBA of the corners, white without `COLOR_0`. It multiplies the base colour (or the diffuse albedo) and
    /// alpha.
    pub colours: [[f32; 4]; 3],
}

impl Attributes {
    /// Flat, at the origin of every texture, white: what a triangle without attributes has.
    pub const NONE: Self = Self { normals: None, coordinates: [[Vec2::ZERO; 3]; 2], colours: [[1.0; 4]; 3] };
}
