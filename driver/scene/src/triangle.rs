//! Triangles, and the attributes of their corners.

use glam::{Vec2, Vec3, Vec4};

/// Value of [`Triangle::attributes`] for a triangle that has positions only.
pub const NO_ATTRIBUTES: u32 = u32::MAX;

/// Value of [`VertexAttributes::tangents`] for a triangle without tangents.
pub const NO_TANGENTS: u32 = u32::MAX;

/// A triangle in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Positions of the corners, metres.
    pub vertices: [Vec3; 3],
    /// Index into [`Scene::materials`](super::SceneContents::materials).
    pub material: u32,
    /// Index into [`Scene::attributes`](super::SceneContents::attributes), or [`NO_ATTRIBUTES`].
    pub attributes: u32,
    /// Index into [`Scene::objects`](super::SceneContents::objects); without meaning for a triangle of a
    /// group.
    pub object: u32,
}

impl Triangle {
    /// Creates a triangle without attributes.
    pub fn new(vertices: [Vec3; 3], material: u32) -> Self {
        Self { vertices, material, attributes: NO_ATTRIBUTES, object: 0 }
    }

    /// Cross product of two edges: the direction of the geometric normal, with a length of twice the area in
    /// m^2.
    pub fn scaled_normal(&self) -> Vec3 {
        let [a, b, c] = self.vertices;
        (b - a).cross(c - a)
    }

    /// Area, m^2.
    pub fn area(&self) -> f32 {
        0.5 * self.scaled_normal().length()
    }
}

/// Lower and upper corner of the box around triangles, metres; `None` if there are none.
pub(crate) fn bounds_of(triangles: &[Triangle]) -> Option<[Vec3; 2]> {
    let mut vertices = triangles.iter().flat_map(|triangle| triangle.vertices);
    let first = vertices.next()?;
    Some(vertices.fold([first; 2], |[low, high], vertex| [low.min(vertex), high.max(vertex)]))
}

/// Vertex attributes of a triangle's corners beyond their positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexAttributes {
    /// Unit shading normals of the corners in world space, on the front side. `None` if the triangle has no
    /// vertex normals, or if all three equal the geometric normal.
    pub normals: Option<[Vec3; 3]>,
    /// Texture coordinates of the corners, sets 0 and 1 (`TEXCOORD_0` and `TEXCOORD_1`), untransformed; v
    /// counts from the image's top.
    pub coordinates: [[Vec2; 3]; 2],
    /// Linear RGBA of the corners; white without `COLOR_0`. It multiplies the base colour or diffuse albedo,
    /// and alpha.
    pub colours: [[f32; 4]; 3],
    /// Index into [`Scene::tangents`](super::SceneContents::tangents), or [`NO_TANGENTS`].
    pub tangents: u32,
}

/// Tangents of a triangle's corners. (x, y, z) is a unit vector in world space along which u increases,
/// perpendicular to the corner's normal, or zero at a corner without a tangent. w is 1 or -1; the bitangent
/// is `w (normal x tangent)`.
pub type CornerTangents = [Vec4; 3];

impl VertexAttributes {
    /// Attributes of a triangle for which the file states none: flat, white, with zero texture coordinates.
    pub const NONE: Self = Self {
        normals: None,
        coordinates: [[Vec2::ZERO; 3]; 2],
        colours: [[1.0; 4]; 3],
        tangents: NO_TANGENTS,
    };

    /// Unit normals of the corners; the geometric normal of a flat triangle.
    pub(crate) fn normals_of(&self, triangle: &Triangle) -> [Vec3; 3] {
        self.normals.unwrap_or_else(|| [triangle.scaled_normal().normalize_or_zero(); 3])
    }
}
