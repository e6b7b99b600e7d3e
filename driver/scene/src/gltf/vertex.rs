//! Vertices of a primitive: indices, world positions and other attributes.

use std::borrow::Cow;
use std::cell::Cell;

use glam::{DVec3, Vec2, Vec3};

use super::accessor::Source;
use super::limits::MAX_COORDINATE;
use super::morph::{Displaced, displaced};
use super::names::mesh_name;
use super::not_finite::NotFinite;
use super::pose::Pose;
use super::primitive::Primitive;
use super::transform::Transform;
use crate::error::SceneError;
use crate::{Triangle, VertexAttributes};

/// Maximum magnitude of a texture coordinate. At this magnitude, steps of `f32` are 1/16 of the image.
const MAX_TEXTURE_COORDINATE: f32 = 1e6;

/// Maximum distance between a unit vertex normal and the triangle's unit normal at which they count as equal:
/// 0.1 degrees.
const FLAT_DISTANCE: f64 = 0.001_745;

/// Corners of a triangle with their transforms.
pub(super) struct Corners<'p> {
    pub(super) vertices: [u64; 3],
    /// Indices of the corners in the file's triangle: 0, 1, 2, or 0, 2, 1 with a mirroring transform.
    pub(super) order: [usize; 3],
    pub(super) transforms: [Cow<'p, Transform>; 3],
    /// Weights of morph targets.
    pub(super) weights: &'p [f32],
}

pub(super) struct VertexReader<'r, 'a> {
    pub(super) source: &'r Source<'a>,
    pub(super) mesh: usize,
    pub(super) primitive: &'r Primitive<'a>,
    /// True for each kind of attribute of which a value was not finite.
    pub(super) not_finite: NotFinite<Cell<bool>>,
}

impl VertexReader<'_, '_> {
    fn fault(&self, attribute: &str, vertex: u64, reason: String) -> SceneError {
        let Self { source, mesh, primitive, .. } = self;
        let item = format!("meshes[{mesh}].primitives[{}].attributes.{attribute}", primitive.index);
        SceneError::Vertex {
            location: source.document.location(item),
            mesh: mesh_name(&source.document.root, *mesh),
            primitive: primitive.index,
            vertex,
            reason,
        }
    }

    pub(super) fn indices(&self, triangle: u64) -> Result<[u64; 3], SceneError> {
        let primitive = self.primitive;
        let places = primitive.corners(triangle);
        let Some(indices) = &primitive.indices else { return Ok(places) };
        let corners = places.map(|place| indices.unsigned(place));
        let vertices = primitive.positions.count;
        match corners.iter().position(|&index| index >= vertices) {
            None => Ok(corners),
            Some(corner) => Err(SceneError::IndexOutOfRange {
                location: self
                    .source
                    .document
                    .location(format!("meshes[{}].primitives[{}].indices", self.mesh, primitive.index)),
                mesh: mesh_name(&self.source.document.root, self.mesh),
                primitive: primitive.index,
                position: places[corner],
                index: corners[corner],
                vertices,
            }),
        }
    }

    /// Corners of a triangle in a pose.
    pub(super) fn corners<'p>(&self, triangle: u64, pose: &'p Pose<'_>) -> Result<Corners<'p>, SceneError> {
        let [a, b, c] = self.indices(triangle)?;
        let transforms = [self.transform(pose, a)?, self.transform(pose, b)?, self.transform(pose, c)?];
        let weights = pose.weights;
        let mut corners = Corners { vertices: [a, b, c], order: [0, 1, 2], transforms, weights };
        // A mirroring transform swaps front and back; reversing the order of vertices restores them.
        if corners.transforms[0].is_mirror {
            corners.vertices.swap(1, 2);
            corners.order.swap(1, 2);
            corners.transforms.swap(1, 2);
        }
        Ok(corners)
    }

    pub(super) fn places(&self, corners: &Corners<'_>) -> Result<[Vec3; 3], SceneError> {
        let mut places = [Vec3::ZERO; 3];
        for ((place, vertex), transform) in places.iter_mut().zip(corners.vertices).zip(&corners.transforms) {
            *place = self.place(vertex, transform, corners.weights)?;
        }
        Ok(places)
    }

    fn transform<'p>(&self, pose: &'p Pose<'_>, vertex: u64) -> Result<Cow<'p, Transform>, SceneError> {
        pose.of(self.primitive, vertex).map_err(|reason| self.fault("JOINTS_0", vertex, reason))
    }

    fn place(&self, vertex: u64, transform: &Transform, weights: &[f32]) -> Result<Vec3, SceneError> {
        let stated = Vec3::from(self.primitive.positions.vec3(vertex));
        let local = self.displaced(stated, weights, Displaced::Position, vertex);
        let placed = transform.place(local);
        let is_usable = |value: f32| value.abs() <= MAX_COORDINATE;
        if placed.to_array().into_iter().all(is_usable) {
            return Ok(placed);
        }
        let reason = if local.is_finite() {
            format!("lies at {placed} once placed, further than {MAX_COORDINATE} m from the origin")
        } else {
            format!("is {local}: not a finite number")
        };
        Err(self.fault("POSITION", vertex, reason))
    }

    /// Attribute of a vertex, displaced by the morph targets.
    pub(super) fn displaced(&self, base: Vec3, weights: &[f32], attribute: Displaced, vertex: u64) -> Vec3 {
        displaced(base, &self.primitive.targets, weights, attribute, vertex)
    }

    /// Attributes of a triangle's corners beyond positions; `None` if all have their default value and the
    /// primitive has no texture coordinates.
    pub(super) fn attributes(
        &self,
        corners: &Corners<'_>,
        triangle: &Triangle,
    ) -> Result<Option<VertexAttributes>, SceneError> {
        if !self.primitive.may_have_attributes() {
            return Ok(None);
        }
        let is_mapped = self.primitive.is_mapped();
        let mut coordinates = VertexAttributes::NONE.coordinates;
        for (set, coordinates) in coordinates.iter_mut().enumerate() {
            for (coordinate, vertex) in coordinates.iter_mut().zip(corners.vertices) {
                *coordinate = self.coordinate(set, vertex)?;
            }
        }
        let attributes = VertexAttributes {
            normals: self.normals(corners, triangle),
            coordinates,
            colours: corners.vertices.map(|vertex| self.colour(vertex)),
            ..VertexAttributes::NONE
        };
        Ok(Some(attributes).filter(|attributes| is_mapped || *attributes != VertexAttributes::NONE))
    }

    pub(super) fn coordinate(&self, set: usize, vertex: u64) -> Result<Vec2, SceneError> {
        let Some(elements) = &self.primitive.coordinates[set] else { return Ok(Vec2::ZERO) };
        let coordinate = Vec2::from(elements.floats(vertex, [0.0; 2]));
        if coordinate.abs().to_array().into_iter().all(|value| value <= MAX_TEXTURE_COORDINATE) {
            return Ok(coordinate);
        }
        let reason =
            format!("has the coordinates {coordinate}: not finite, or beyond {MAX_TEXTURE_COORDINATE}");
        Err(self.fault(&format!("TEXCOORD_{set}"), vertex, reason))
    }

    /// Colour of a vertex, clamped to 0 to 1 (glTF 2.0, 3.7.2.1); white without `COLOR_0`.
    fn colour(&self, vertex: u64) -> [f32; 4] {
        let colours = self.primitive.colours.as_ref();
        let colour = colours.map_or([1.0; 4], |colours| colours.floats(vertex, [1.0; 4]));
        if !colour.iter().all(|channel| channel.is_finite()) {
            self.not_finite.colours.set(true);
        }
        // NaN becomes 0.
        colour.map(|channel| if channel > 0.0 { channel.min(1.0) } else { 0.0 })
    }

    /// Vertex normals of the corners; `None` if they equal the triangle's normal. The triangle's normal
    /// replaces a vertex normal that is degenerate or on the back.
    fn normals(&self, corners: &Corners<'_>, triangle: &Triangle) -> Option<[Vec3; 3]> {
        let elements = self.primitive.normals.as_ref()?;
        let [a, b, c] = triangle.vertices.map(Vec3::as_dvec3);
        let own = (b - a).cross(c - a).try_normalize()?;
        let mut normals = [own.as_vec3(); 3];
        let mut is_smooth = false;
        for ((normal, vertex), transform) in normals.iter_mut().zip(corners.vertices).zip(&corners.transforms)
        {
            let stated = Vec3::from(elements.vec3(vertex));
            let local = self.displaced(stated, corners.weights, Displaced::Normal, vertex);
            if !local.is_finite() {
                self.not_finite.normals.set(true);
            }
            let stated = transform.normal(local);
            let Some(stated) = stated.filter(|stated| stated.as_dvec3().dot(own) > 0.0) else { continue };
            is_smooth |= DVec3::distance(stated.as_dvec3(), own) > FLAT_DISTANCE;
            *normal = stated;
        }
        is_smooth.then_some(normals)
    }
}
