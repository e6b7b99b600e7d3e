//! Offset of the scene's origin from the file's, computed from the bounds of the scene without animations.

use std::collections::BTreeMap;

use glam::{DMat4, DVec3};

use super::accessor::Source;
use super::instances::Instances;
use super::limits::MAX_TRIANGLES;
use super::mesh::MeshPlacer;
use super::offset::{Bounds, translation};
use super::primitive::Primitive;
use super::skin::Skin;
use super::stated_places;
use crate::Scene;
use crate::error::SceneError;

/// Offset of the scene's origin from the file's, and the nodes' translations from which it is subtracted.
#[derive(Clone, Debug, Default)]
pub(super) struct Anchor {
    pub(super) offset: DVec3,
    /// Translation of each node as the file states it, in double precision; empty if the offset is zero.
    stated: Vec<Option<DVec3>>,
}

impl Anchor {
    /// Computes the offset of a scene from the world transforms that its nodes have without animations.
    pub(super) fn of(
        source: &Source<'_>,
        meshes: &mut MeshPlacer<'_>,
        nodes: &[(usize, DMat4)],
        scene: &mut Scene,
    ) -> Result<Self, SceneError> {
        let bounds = Extent { source, meshes, nodes, locals: BTreeMap::new() }.bounds(scene)?;
        let root = &source.document.root;
        let chosen = root.scenes.get(root.scene.map_or(0, |scene| scene.value()));
        let tops: Vec<usize> =
            chosen.iter().flat_map(|scene| &scene.nodes).map(gltf::json::Index::value).collect();
        let is_above = |index: &usize| tops.contains(index) && root.nodes[*index].mesh.is_none();
        let above =
            nodes.iter().filter(|(index, _)| is_above(index) && root.nodes[*index].children.is_some());
        let above: Vec<DVec3> = above.map(|(_, world)| world.w_axis.truncate()).collect();
        let offset = bounds.offset(&above);
        let has_offset = offset != DVec3::ZERO;
        let stated = if has_offset { stated_places::read(source.document) } else { Vec::new() };
        Ok(Self { offset, stated })
    }

    /// Converts a node's local transform from the file's origin to the scene's. `is_posed` is true if an
    /// animation sets the node's translation, `is_root` if the node has no parent.
    pub(super) fn placed(&self, node: usize, mut local: DMat4, is_posed: bool, is_root: bool) -> DMat4 {
        if self.offset != DVec3::ZERO {
            let stated = self.stated.get(node).copied().flatten().filter(|_| !is_posed);
            let place = stated.unwrap_or(local.w_axis.truncate());
            local.w_axis = translation(place, self.offset, is_root).extend(1.0);
        }
        local
    }
}

/// Computes the bounds of the triangles of a scene without animations.
struct Extent<'e, 's, 'a> {
    source: &'e Source<'s>,
    meshes: &'e mut MeshPlacer<'a>,
    nodes: &'e [(usize, DMat4)],
    locals: BTreeMap<usize, Local>,
}

/// Bounds of a mesh's primitives in the mesh's space, without empty primitives, and the number of triangles.
#[derive(Clone, Default)]
struct Local {
    bounds: Vec<Bounds>,
    triangles: u64,
}

impl Extent<'_, '_, '_> {
    fn bounds(&mut self, scene: &mut Scene) -> Result<Bounds, SceneError> {
        let root = &self.source.document.root;
        let mut worlds = vec![None; root.nodes.len()];
        self.nodes.iter().for_each(|&(index, world)| worlds[index] = Some(world));
        let (mut bounds, mut placed) = (Bounds::EMPTY, 0_u64);
        for &(index, world) in self.nodes {
            let node = &root.nodes[index];
            let Some(mesh) = node.mesh.map(|mesh| mesh.value()) else { continue };
            let Local { bounds: locals, triangles } = self.locals(mesh, scene)?;
            let mut add = |transform: &DMat4| {
                locals.iter().for_each(|local| bounds.add_placed(transform, local));
            };
            if triangles == 0 {
                continue;
            }
            if let Some(skin) = node.skin {
                Skin::new(self.source, skin.value(), &worlds)?.joints().iter().for_each(&mut add);
                continue;
            }
            let Some(instances) = Instances::of(self.source, index, node)? else {
                add(&world);
                continue;
            };
            placed = placed.saturating_add(instances.count);
            if placed > MAX_TRIANGLES as u64 {
                // The loader refuses a scene of so many instances.
                break;
            }
            // An instance without a valid transform is skipped here, and the loader reports it.
            let transforms =
                (0..instances.count).filter_map(|index| instances.transform(self.source, index).ok());
            transforms.for_each(|transform| add(&(world * transform)));
        }
        Ok(bounds)
    }

    fn locals(&mut self, mesh: usize, scene: &mut Scene) -> Result<Local, SceneError> {
        if let Some(locals) = self.locals.get(&mesh) {
            return Ok(locals.clone());
        }
        let primitives = self.meshes.primitives(mesh, scene)?;
        let shown = primitives.iter().filter(|primitive| primitive.triangles > 0);
        let triangles = shown.clone().map(|primitive| primitive.triangles).sum();
        let mut bounds: Vec<Bounds> = shown.map(Primitive::bounds).collect();
        if self.meshes.is_grouped(mesh) {
            // One box bounds the time, which grows with boxes times instances.
            bounds = bounds.into_iter().reduce(Bounds::joined).into_iter().collect();
        }
        let locals = Local { bounds, triangles };
        self.locals.insert(mesh, locals.clone());
        Ok(locals)
    }
}
