//! Meshes: triangle lists of positions, placed into the world by each node that shows them.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::{DMat4, Vec3};
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::MAX_TRIANGLES;
use super::accessor::{Elements, Source};
use super::material;
use super::notices::{Notices, is_triangles, mesh_name};
use crate::error::SceneError;
use crate::scene::{Scene, Triangle};

/// The largest coordinate in metres: products of three stay far inside what single precision holds.
const MAX_COORDINATE: f32 = 1e8;

/// The cosine of the angle, about 2 degrees, up to which a vertex normal counts as the triangle's.
const FLAT_COSINE: f32 = 0.9994;

/// A triangle list whose accessors are in bounds.
struct Primitive<'a> {
    index: usize,
    positions: Elements<'a>,
    indices: Option<Elements<'a>>,
    normals: Option<Elements<'a>>,
    material: Option<usize>,
}

/// Places meshes into a scene.
pub(super) struct MeshPlacer<'a> {
    source: Source<'a>,
    prepared: BTreeMap<usize, Rc<Vec<Primitive<'a>>>>,
    /// Triangles and primitives looked at so far, those of zero area too.
    work: usize,
}

impl<'a> MeshPlacer<'a> {
    pub(super) fn new(source: Source<'a>) -> Self {
        Self { source, prepared: BTreeMap::new(), work: 0 }
    }

    /// Adds the triangles of mesh `index` to `scene` in world space.
    pub(super) fn place(
        &mut self,
        index: usize,
        world: &DMat4,
        scene: &mut Scene,
        notices: &mut Notices,
    ) -> Result<(), SceneError> {
        let primitives = if let Some(primitives) = self.prepared.get(&index) {
            Rc::clone(primitives)
        } else {
            let primitives = Rc::new(self.prepare(index)?);
            self.prepared.insert(index, Rc::clone(&primitives));
            primitives
        };
        for primitive in primitives.iter() {
            self.place_primitive(index, primitive, world, scene, notices)?;
        }
        Ok(())
    }

    fn prepare(&self, mesh: usize) -> Result<Vec<Primitive<'a>>, SceneError> {
        let primitives = self.source.document.root.meshes[mesh].primitives.iter().enumerate();
        let lists = primitives.filter(|(_, primitive)| is_triangles(primitive));
        lists.map(|(index, primitive)| self.prepare_primitive(mesh, index, primitive)).collect()
    }

    fn prepare_primitive(
        &self,
        mesh: usize,
        index: usize,
        primitive: &json::mesh::Primitive,
    ) -> Result<Primitive<'a>, SceneError> {
        let item = format!("meshes[{mesh}].primitives[{index}]");
        let vectors = |semantic: Semantic, name: &str| {
            let accessor = primitive.attributes.get(&Checked::Valid(semantic))?;
            let item = format!("{item}.attributes.{name}");
            Some(Elements::new(&self.source, accessor.value(), &item, Type::Vec3, &[ComponentType::F32]))
        };
        let positions = vectors(Semantic::Positions, "POSITION").ok_or_else(|| {
            let reason = "the primitive has no POSITION";
            self.source.document.invalid(&item, reason, "export the mesh again, with vertex positions")
        })??;
        // Normals only serve a notice, so those that cannot be read are no reason to refuse the scene.
        let normals = vectors(Semantic::Normals, "NORMAL").and_then(Result::ok);
        let kinds = [ComponentType::U8, ComponentType::U16, ComponentType::U32];
        let indices = primitive
            .indices
            .map(|accessor| {
                let item = format!("{item}.indices");
                Elements::new(&self.source, accessor.value(), &item, Type::Scalar, &kinds)
            })
            .transpose()?;
        let count = indices.as_ref().map_or(positions.count, |indices| indices.count);
        if count % 3 != 0 {
            let reason = format!("{count} vertices do not make whole triangles");
            return Err(self.source.document.invalid(&item, reason, "export the mesh again, triangulated"));
        }
        let material = primitive.material.map(|material| material.value());
        Ok(Primitive { index, positions, indices, normals, material })
    }

    fn place_primitive(
        &mut self,
        mesh: usize,
        primitive: &Primitive<'a>,
        world: &DMat4,
        scene: &mut Scene,
        notices: &mut Notices,
    ) -> Result<(), SceneError> {
        let count = primitive.indices.as_ref().map_or(primitive.positions.count, |indices| indices.count) / 3;
        let work = usize::try_from(count).ok().and_then(|count| self.work.checked_add(count)?.checked_add(1));
        self.work = work.filter(|work| *work <= MAX_TRIANGLES).ok_or_else(|| {
            SceneError::TooManyTriangles { file: self.source.document.path.clone(), limit: MAX_TRIANGLES }
        })?;
        let material = self.material(primitive, scene, notices);
        let mirrored = world.determinant() < 0.0;
        let mut is_smooth = notices.smooth.contains(&mesh);
        for triangle in 0..count {
            let corners = self.corners(mesh, primitive, triangle)?;
            let mut vertices = [Vec3::ZERO; 3];
            for (vertex, corner) in vertices.iter_mut().zip(corners) {
                *vertex = self.vertex(mesh, primitive, corner, world)?;
            }
            // A mirror turns the front to the back; turning the order of the corners restores it.
            if mirrored {
                vertices.swap(1, 2);
            }
            let placed = Triangle::new(vertices, material);
            if placed.area() > 0.0 {
                scene.triangles.push(placed);
                is_smooth = is_smooth || primitive.is_smooth(corners);
            } else {
                scene.skipped_triangles += 1;
            }
        }
        if is_smooth {
            notices.smooth.insert(mesh);
        }
        Ok(())
    }

    /// The index of the primitive's material in the scene; the default one comes after those of the file.
    fn material(&self, primitive: &Primitive<'a>, scene: &mut Scene, notices: &mut Notices) -> u32 {
        let default = self.source.document.root.materials.len();
        let index = primitive.material.unwrap_or(default);
        if index >= scene.materials.len() {
            scene.materials.push(material::default_material());
            notices.default_material = true;
        }
        index as u32
    }

    fn name(&self, mesh: usize) -> String {
        mesh_name(&self.source.document.root, mesh)
    }

    /// The three vertex indices of a triangle.
    fn corners(&self, mesh: usize, primitive: &Primitive<'a>, triangle: u64) -> Result<[u64; 3], SceneError> {
        let positions = [3 * triangle, 3 * triangle + 1, 3 * triangle + 2];
        let Some(indices) = &primitive.indices else { return Ok(positions) };
        let corners = positions.map(|position| indices.unsigned(position));
        let vertices = primitive.positions.count;
        match corners.iter().position(|&index| index >= vertices) {
            None => Ok(corners),
            Some(corner) => Err(SceneError::IndexOutOfRange {
                place: self
                    .source
                    .document
                    .place(format!("meshes[{mesh}].primitives[{}].indices", primitive.index)),
                mesh: self.name(mesh),
                primitive: primitive.index,
                position: positions[corner],
                index: corners[corner],
                vertices,
            }),
        }
    }

    /// A vertex in world space.
    fn vertex(
        &self,
        mesh: usize,
        primitive: &Primitive<'a>,
        index: u64,
        world: &DMat4,
    ) -> Result<Vec3, SceneError> {
        let local = Vec3::from(primitive.positions.vec3(index));
        let placed = world.transform_point3(local.as_dvec3()).as_vec3();
        let is_usable = |value: f32| value.abs() <= MAX_COORDINATE;
        if placed.to_array().into_iter().all(is_usable) {
            return Ok(placed);
        }
        let reason = if local.is_finite() {
            format!("lies at {placed} once placed, further than {MAX_COORDINATE} m from the origin")
        } else {
            format!("is {local}: not a finite number")
        };
        let item = format!("meshes[{mesh}].primitives[{}].attributes.POSITION", primitive.index);
        Err(SceneError::Vertex {
            place: self.source.document.place(item),
            mesh: self.name(mesh),
            primitive: primitive.index,
            vertex: index,
            reason,
        })
    }
}

impl Primitive<'_> {
    /// Whether a corner's normal differs noticeably from the triangle's own.
    fn is_smooth(&self, corners: [u64; 3]) -> bool {
        let Some(normals) = &self.normals else { return false };
        let [a, b, c] = corners.map(|corner| Vec3::from(self.positions.vec3(corner)));
        let Some(own) = (b - a).cross(c - a).try_normalize() else { return false };
        corners.into_iter().filter(|corner| *corner < normals.count).any(|corner| {
            let normal = Vec3::from(normals.vec3(corner)).try_normalize();
            normal.is_some_and(|normal| normal.dot(own) < FLAT_COSINE)
        })
    }
}
