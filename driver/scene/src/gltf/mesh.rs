//! Converts meshes to triangles in world space, for every node and instance. A mesh that is placed often
//! becomes a group, and its copies instances of the group.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use glam::{DMat4, DVec3, Vec3};
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;
use photoncard_picture::allocation;

use super::accessor::Source;
use super::limits::{MAX_COORDINATE, MAX_TRIANGLES};
use super::material;
use super::not_finite::NotFinite;
use super::offset::Bounds;
use super::pose::Pose;
use super::primitive::Primitive;
use super::room::Room;
use super::topology::Topology;
use super::transform::Transform;
use super::vertex::VertexReader;
use crate::error::SceneError;
use crate::triangle::bounds_of;
use crate::{Instance, Scene, Triangle};

pub(super) struct MeshPlacer<'a> {
    source: &'a Source<'a>,
    prepared: BTreeMap<usize, Rc<Vec<Primitive<'a>>>>,
    /// Number of counted copies of each mesh.
    placed: BTreeMap<usize, Copies>,
    /// Meshes that are not placed as instances.
    apart: BTreeSet<usize>,
    /// Number of all counted copies.
    counted: u64,
    /// Number of triangles, primitives and copies to be placed; those of a group count once.
    work: u64,
    /// Meshes that are placed as instances of groups, each with the translation of its centre to the origin
    /// of the group's space.
    grouped: BTreeMap<usize, DMat4>,
    /// Groups that were added, by the index of their mesh and whether the group is mirrored. The group is
    /// `None` if all its triangles have zero area.
    groups: BTreeMap<(usize, bool), Option<Group>>,
    /// Indices of meshes with attributes that are not finite.
    pub(super) not_finite: NotFinite<BTreeSet<usize>>,
    /// Indices of meshes with a primitive whose last vertices form no whole triangle.
    pub(super) incomplete: BTreeSet<usize>,
}

/// Number of copies of a mesh, by their transforms.
#[derive(Clone, Copy, Default)]
struct Copies {
    /// Copies that can be instances of the mesh's group, and of its mirrored group.
    instances: [u64; 2],
    others: u64,
}

#[derive(Clone, Copy)]
struct Group {
    /// Index in the scene.
    index: u32,
    /// Lower and upper corner of the group's box, in the group's space.
    bounds: [Vec3; 2],
}

impl Copies {
    fn all(&self) -> u64 {
        self.instances.iter().fold(self.others, |all, count| all.saturating_add(*count))
    }

    /// Number of copies whose triangles need not be stored if the copies are instances of groups.
    fn saved(&self) -> u64 {
        self.instances.iter().fold(0, |saved: u64, count| saved.saturating_add(count.saturating_sub(1)))
    }
}

/// Minimum number of triangles that groups must save for a mesh to be placed as instances. Instances make
/// tracing slower, because rays are transformed to the group's space.
const MIN_SAVED: u64 = 1 << 18;

fn triangles_and_primitives(primitives: &[Primitive<'_>]) -> u64 {
    primitives.iter().fold(0, |sum: u64, primitive| sum.saturating_add(primitive.triangles).saturating_add(1))
}

/// Index of the object that is being placed: the last one of the scene.
fn object_of(scene: &Scene) -> u32 {
    scene.objects.len().saturating_sub(1) as u32
}

impl<'a> MeshPlacer<'a> {
    pub(super) fn new(source: &'a Source<'a>) -> Self {
        Self {
            source,
            prepared: BTreeMap::new(),
            placed: BTreeMap::new(),
            apart: BTreeSet::new(),
            counted: 0,
            work: 0,
            grouped: BTreeMap::new(),
            groups: BTreeMap::new(),
            not_finite: NotFinite::default(),
            incomplete: BTreeSet::new(),
        }
    }

    /// Counts `copies` copies of mesh `index`; `worlds` are their world transforms.
    ///
    /// # Errors
    /// If [`MAX_TRIANGLES`] copies or more are counted; copies and triangles together may not exceed it.
    pub(super) fn count(
        &mut self,
        index: usize,
        copies: u64,
        worlds: impl Iterator<Item = Result<DMat4, SceneError>>,
    ) -> Result<(), SceneError> {
        self.counted = self.counted.saturating_add(copies);
        if self.counted >= MAX_TRIANGLES as u64 {
            return Err(self.too_many());
        }
        let Copies { instances, others } = self.placed.entry(index).or_default();
        for world in worlds {
            let counted = match Instance::mirrors(&world?) {
                Some(mirrors) => &mut instances[usize::from(mirrors)],
                None => &mut *others,
            };
            *counted += 1;
        }
        Ok(())
    }

    /// Keeps mesh `index` from being placed as instances, whose materials are those of their group.
    pub(super) fn keep_apart(&mut self, index: usize) {
        self.apart.insert(index);
    }

    fn too_many(&self) -> SceneError {
        SceneError::TooManyTriangles { file: self.source.document.path.clone(), limit: MAX_TRIANGLES }
    }

    /// Decides which of the counted meshes are placed as instances of groups.
    pub(super) fn choose_groups(&mut self, scene: &Scene) {
        let copied = scene.copied_materials();
        let is_plain = |primitive: &Primitive<'_>| {
            let material = primitive.material as usize;
            primitive.influences.is_empty() && primitive.targets.is_empty() && !copied[material]
        };
        for (&mesh, copies) in &self.placed {
            let Some(primitives) = self.prepared.get(&mesh) else { continue };
            let saved = triangles_and_primitives(primitives).saturating_mul(copies.saved());
            let may_be_grouped = saved >= MIN_SAVED && !self.apart.contains(&mesh);
            if may_be_grouped && primitives.iter().all(is_plain) {
                let bounds = primitives.iter().map(Primitive::bounds).reduce(Bounds::joined);
                let centred = bounds.and_then(|bounds| bounds.centre());
                self.grouped.extend(centred.map(|centre| (mesh, DMat4::from_translation(-centre))));
            }
        }
    }

    /// Checks that the triangles and instances of all counted meshes are at most [`MAX_TRIANGLES`] together,
    /// and that they fit into a card's memory.
    pub(super) fn check_room(&mut self, room: &mut Room) -> Result<(), SceneError> {
        self.work = self.placed.iter().fold(0_u64, |work, (mesh, copies)| {
            let copied = self.copies(*mesh, copies).saturating_mul(self.of_one(*mesh));
            work.saturating_add(copied).saturating_add(copies.all())
        });
        if self.work > MAX_TRIANGLES as u64 {
            return Err(self.too_many());
        }
        let of_groups = self.grouped.keys().filter_map(|mesh| self.placed.get(mesh));
        room.instances(of_groups.map(Copies::all).sum())?;
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

    /// Number of triangles and primitives of a mesh.
    fn of_one(&self, mesh: usize) -> u64 {
        self.prepared.get(&mesh).map_or(0, |primitives| triangles_and_primitives(primitives))
    }

    /// Number of times that the triangles of a mesh are stored.
    fn copies(&self, mesh: usize, copies: &Copies) -> u64 {
        if self.is_grouped(mesh) { copies.all() - copies.saved() } else { copies.all() }
    }

    /// Returns whether mesh `index` is placed as instances of groups.
    pub(super) fn is_grouped(&self, index: usize) -> bool {
        self.grouped.contains_key(&index)
    }

    /// Counted primitives, each with its number of copies.
    fn placed(&self) -> impl Iterator<Item = (&Primitive<'a>, u64)> {
        self.placed.iter().flat_map(|(mesh, copies)| {
            let times = self.copies(*mesh, copies);
            let primitives = self.prepared.get(mesh).into_iter().flat_map(|primitives| primitives.iter());
            primitives.map(move |primitive| (primitive, times))
        })
    }

    /// Adds mesh `index` to `scene` in world space: an instance of its group, or its triangles.
    pub(super) fn place(
        &mut self,
        index: usize,
        pose: &Pose<'_>,
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        match self.grouped.get(&index).copied() {
            Some(centred) if self.place_instance(index, centred, pose.world(), scene)? => Ok(()),
            Some(_) if Instance::mirrors(&pose.world().matrix).is_some() => {
                // This copy was counted as an instance.
                self.work = self.work.saturating_add(self.of_one(index));
                if self.work > MAX_TRIANGLES as u64 {
                    return Err(self.too_many());
                }
                self.place_triangles(index, pose, scene)
            }
            _ => self.place_triangles(index, pose, scene),
        }
    }

    fn place_triangles(
        &mut self,
        index: usize,
        pose: &Pose<'_>,
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        let primitives = self.primitives(index, scene)?;
        primitives.iter().try_for_each(|primitive| self.place_primitive(index, primitive, pose, scene))
    }

    /// Adds an instance of mesh `index`. `centred` is the translation that moves the mesh's centre to the
    /// origin. Returns false if the transform has no inverse or the instance is too far from the scene's
    /// origin.
    fn place_instance(
        &mut self,
        index: usize,
        centred: DMat4,
        world: &Transform,
        scene: &mut Scene,
    ) -> Result<bool, SceneError> {
        // The group of mirrored instances is mirrored itself, so that its transforms are not.
        let mirror = DMat4::from_scale(DVec3::new(if world.is_mirror { -1.0 } else { 1.0 }, 1.0, 1.0));
        let to_group = mirror * centred;
        let Some(instance) = Instance::new(0, &(world.matrix * to_group.inverse())) else { return Ok(false) };
        let key = (index, world.is_mirror);
        if !self.groups.contains_key(&key) {
            let group = self.add_group(index, to_group, scene)?;
            self.groups.insert(key, group);
        }
        // A group without an area has no instances.
        let Some(Group { index, bounds }) = self.groups.get(&key).copied().flatten() else { return Ok(true) };
        let is_near = |corner: &Vec3| corner.abs().max_element() <= MAX_COORDINATE;
        if !instance.bounds(bounds).iter().all(is_near) {
            return Ok(false);
        }
        let instance = Instance { group: index, object: object_of(scene), ..instance };
        allocation::push(&mut scene.instances, instance).map_err(|error| {
            SceneError::memory(&self.source.document.path, "placing its instances", error)
        })?;
        Ok(true)
    }

    /// Adds the group of mesh `index` to `scene`; `None` if no triangle of it has an area.
    fn add_group(
        &mut self,
        index: usize,
        to_group: DMat4,
        scene: &mut Scene,
    ) -> Result<Option<Group>, SceneError> {
        let outside = std::mem::take(&mut scene.triangles);
        self.place_triangles(index, &Pose::new(to_group, None, &[]), scene)?;
        let triangles = std::mem::replace(&mut scene.triangles, outside);
        let Some(bounds) = bounds_of(&triangles) else { return Ok(None) };
        let group = Group { index: scene.groups.len() as u32, bounds };
        scene.groups.push(triangles);
        Ok(Some(group))
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
            let lightmap = primitive.attributes.contains_key(&Checked::Valid(Semantic::TexCoords(1)));
            used_sets[1] |= self.source.document.has_lightmaps && lightmap;
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
        let object = object_of(scene);
        for triangle in 0..primitive.triangles {
            let corners = reader.corners(triangle, pose)?;
            let plain = Triangle::new(reader.places(&corners)?, primitive.material);
            let mut placed = Triangle { object, ..plain };
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
