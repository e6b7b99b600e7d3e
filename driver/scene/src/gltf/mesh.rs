//! Converts meshes to triangles in world space, for every node and instance.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use photoncard_picture::allocation;

use super::accessor::Source;
use super::limits::MAX_TRIANGLES;
use super::material;
use super::not_finite::NotFinite;
use super::pose::Pose;
use super::primitive::Primitive;
use super::room::Room;
use super::topology::Topology;
use super::vertex::VertexReader;
use crate::error::SceneError;
use crate::{Scene, Triangle};

pub(super) struct MeshPlacer<'a> {
    source: &'a Source<'a>,
    prepared: BTreeMap<usize, Rc<Vec<Primitive<'a>>>>,
    /// Number of counted instances of each mesh.
    placed: BTreeMap<usize, u64>,
    /// Number of triangles and primitives of all counted instances, including triangles of zero area.
    work: u64,
    /// Indices of meshes with attributes that are not finite.
    pub(super) not_finite: NotFinite<BTreeSet<usize>>,
    /// Indices of meshes with a primitive whose last vertices form no whole triangle.
    pub(super) incomplete: BTreeSet<usize>,
}

impl<'a> MeshPlacer<'a> {
    pub(super) fn new(source: &'a Source<'a>) -> Self {
        Self {
            source,
            prepared: BTreeMap::new(),
            placed: BTreeMap::new(),
            work: 0,
            not_finite: NotFinite::default(),
            incomplete: BTreeSet::new(),
        }
    }

    /// Counts the triangles and primitives of `instances` instances of mesh `index`. Returns an error if
    /// there are more than [`MAX_TRIANGLES`] in all.
    pub(super) fn count(
        &mut self,
        index: usize,
        instances: u64,
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        let primitives = self.primitives(index, scene)?;
        let of_one = primitives
            .iter()
            .fold(0_u64, |sum, primitive| sum.saturating_add(primitive.triangles).saturating_add(1));
        self.work = self.work.saturating_add(of_one.saturating_mul(instances));
        if self.work > MAX_TRIANGLES as u64 {
            let file = self.source.document.path.clone();
            return Err(SceneError::TooManyTriangles { file, limit: MAX_TRIANGLES });
        }
        *self.placed.entry(index).or_default() += instances;
        Ok(())
    }

    /// Checks that a card's memory can hold all counted triangles.
    pub(super) fn check_room(&self, room: &mut Room) -> Result<(), SceneError> {
        let triangles = self.placed().map(|(primitive, times)| primitive.triangles * times).sum();
        // Shared vertices are counted only if an upper bound of the triangles' size exceeds the memory.
        if room.fits_any(triangles) {
            return Ok(());
        }
        let mut bytes = 0_u64;
        for (primitive, times) in self.placed() {
            let once = primitive.bytes_of_a_card();
            let once = once.map_err(|error| {
                SceneError::memory(&self.source.document.path, "counting its corners", error)
            })?;
            bytes = bytes.saturating_add(once.saturating_mul(times));
        }
        room.triangles(triangles, bytes)
    }

    /// Counted primitives, each with its number of instances.
    fn placed(&self) -> impl Iterator<Item = (&Primitive<'a>, u64)> {
        self.placed.iter().flat_map(|(mesh, &times)| {
            let primitives = self.prepared.get(mesh).into_iter().flat_map(|primitives| primitives.iter());
            primitives.map(move |primitive| (primitive, times))
        })
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

    /// Returns whether mesh `index` has a primitive of triangles.
    pub(super) fn has_triangles(&mut self, index: usize, scene: &mut Scene) -> Result<bool, SceneError> {
        Ok(!self.primitives(index, scene)?.is_empty())
    }

    /// Primitives of mesh `index` that consist of triangles.
    pub(super) fn primitives(
        &mut self,
        index: usize,
        scene: &mut Scene,
    ) -> Result<Rc<Vec<Primitive<'a>>>, SceneError> {
        if let Some(primitives) = self.prepared.get(&index) {
            return Ok(Rc::clone(primitives));
        }
        let primitives = Rc::new(self.prepare(index, scene)?);
        if primitives.iter().any(|primitive| primitive.has_incomplete) {
            self.incomplete.insert(index);
        }
        self.prepared.insert(index, Rc::clone(&primitives));
        Ok(primitives)
    }

    fn prepare(&self, mesh: usize, scene: &mut Scene) -> Result<Vec<Primitive<'a>>, SceneError> {
        let mut prepared = Vec::new();
        for (index, primitive) in self.source.document.root.meshes[mesh].primitives.iter().enumerate() {
            let Some(topology) = Topology::of_rendered(primitive) else { continue };
            // The default material follows the materials of the file.
            let default = self.source.document.root.materials.len();
            let material = primitive.material.map_or(default, |material| material.value());
            if material >= scene.materials.len() {
                scene.materials.push(material::default_material());
            }
            let mut used_sets = [false; 2];
            for texture in scene.materials[material].textures() {
                used_sets[scene.textures[texture as usize].set as usize] = true;
            }
            let tangent_texture = scene.materials[material].tangent_texture();
            let tangent_set = tangent_texture.map(|texture| scene.textures[texture as usize].set as usize);
            let sets = (used_sets, tangent_set);
            prepared.push(Primitive::new(self.source, mesh, index, topology, material as u32, sets)?);
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
        let reader = VertexReader { source: self.source, mesh, primitive, not_finite: NotFinite::default() };
        let source = self.source;
        let no_memory = |error| SceneError::memory(&source.document.path, "placing its triangles", error);
        let tangents = reader.tangents()?;
        for triangle in 0..primitive.triangles {
            let corners = reader.corners(triangle, pose)?;
            let mut placed = Triangle::new(reader.places(&corners)?, primitive.material);
            if placed.area() <= 0.0 {
                scene.skipped_triangles += 1;
                continue;
            }
            if let Some(mut attributes) = reader.attributes(&corners, &placed)? {
                if let Some(tangents) = tangents {
                    let normals = attributes.normals_of(&placed);
                    let found = reader.placed_tangents(tangents, triangle, &corners, normals);
                    attributes.tangents = scene.tangents.len() as u32;
                    allocation::push(&mut scene.tangents, found).map_err(no_memory)?;
                }
                placed.attributes = scene.attributes.len() as u32;
                allocation::push(&mut scene.attributes, attributes).map_err(no_memory)?;
            }
            allocation::push(&mut scene.triangles, placed).map_err(no_memory)?;
        }
        let NotFinite { normals, colours, tangents } = &reader.not_finite;
        self.not_finite.normals.extend(normals.get().then_some(mesh));
        self.not_finite.colours.extend(colours.get().then_some(mesh));
        self.not_finite.tangents.extend(tangents.get().then_some(mesh));
        Ok(())
    }
}
