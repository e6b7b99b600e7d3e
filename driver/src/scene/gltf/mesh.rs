//! Meshes: triangles placed into the world by each node that shows them.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::Vec3;

use super::accessor::Source;
use super::limits::MAX_TRIANGLES;
use super::material;
use super::pose::Pose;
use super::primitive::{Primitive, Topology};
use super::vertex::VertexReader;
use crate::error::SceneError;
use crate::scene::{Scene, Triangle};

/// Places meshes into a scene.
pub(super) struct MeshPlacer<'a> {
    source: &'a Source<'a>,
    prepared: BTreeMap<usize, Rc<Vec<Primitive<'a>>>>,
    /// Triangles and primitives placed so far, those of zero area too.
    work: usize,
}

impl<'a> MeshPlacer<'a> {
    pub(super) fn new(source: &'a Source<'a>) -> Self {
        Self { source, prepared: BTreeMap::new(), work: 0 }
    }

    /// Adds the triangles of mesh `index` to `scene` in world space.
    pub(super) fn place(
        &mut self,
        index: usize,
        pose: &Pose<'_>,
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        let primitives = self.primitives(index, scene)?;
        primitives.iter().try_for_each(|primitive| self.place_primitive(index, primitive, pose, scene))
    }

    /// Whether mesh `index` has a primitive of triangles.
    pub(super) fn has_triangles(&mut self, index: usize, scene: &mut Scene) -> Result<bool, SceneError> {
        Ok(!self.primitives(index, scene)?.is_empty())
    }

    /// The primitives of triangles of mesh `index`.
    fn primitives(&mut self, index: usize, scene: &mut Scene) -> Result<Rc<Vec<Primitive<'a>>>, SceneError> {
        if let Some(primitives) = self.prepared.get(&index) {
            return Ok(Rc::clone(primitives));
        }
        let primitives = Rc::new(self.prepare(index, scene)?);
        self.prepared.insert(index, Rc::clone(&primitives));
        Ok(primitives)
    }

    fn prepare(&self, mesh: usize, scene: &mut Scene) -> Result<Vec<Primitive<'a>>, SceneError> {
        let mut prepared = Vec::new();
        for (index, primitive) in self.source.document.root.meshes[mesh].primitives.iter().enumerate() {
            let Some(topology) = Topology::of(primitive) else { continue };
            // The default material comes after those of the file.
            let default = self.source.document.root.materials.len();
            let material = primitive.material.map_or(default, |material| material.value());
            if material >= scene.materials.len() {
                scene.materials.push(material::default_material());
            }
            let mut used_sets = [false; 2];
            for texture in scene.materials[material].textures() {
                used_sets[scene.textures[texture as usize].set as usize] = true;
            }
            prepared.push(Primitive::new(self.source, mesh, index, topology, material as u32, used_sets)?);
        }
        Ok(prepared)
    }

    fn place_primitive(
        &mut self,
        mesh: usize,
        primitive: &Primitive<'a>,
        pose: &Pose<'_>,
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        let count = primitive.triangles;
        let work = usize::try_from(count).ok().and_then(|count| self.work.checked_add(count)?.checked_add(1));
        self.work = work.filter(|work| *work <= MAX_TRIANGLES).ok_or_else(|| {
            SceneError::TooManyTriangles { file: self.source.document.path.clone(), limit: MAX_TRIANGLES }
        })?;
        let reader = VertexReader { source: self.source, mesh, primitive };
        for triangle in 0..count {
            let mut corners = reader.indices(triangle)?;
            let [a, b, c] = corners;
            let mut transforms =
                [reader.transform(pose, a)?, reader.transform(pose, b)?, reader.transform(pose, c)?];
            // A mirror turns the front to the back; turning the order of the corners restores it.
            if transforms[0].is_mirror {
                corners.swap(1, 2);
                transforms.swap(1, 2);
            }
            let mut vertices = [Vec3::ZERO; 3];
            for ((vertex, corner), transform) in vertices.iter_mut().zip(corners).zip(&transforms) {
                *vertex = reader.place(corner, transform)?;
            }
            let mut placed = Triangle::new(vertices, primitive.material);
            if placed.area() > 0.0 {
                if let Some(attributes) = reader.attributes(corners, &transforms, &placed)? {
                    placed.attributes = scene.attributes.len() as u32;
                    scene.attributes.push(attributes);
                }
                scene.triangles.push(placed);
            } else {
                scene.skipped_triangles += 1;
            }
        }
        Ok(())
    }
}
