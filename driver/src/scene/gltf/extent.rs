//! Place of a scene in its file: the offset of its origin from the file's, by the scene at rest.

use std::collections::BTreeMap;

use glam::{DMat4, DVec3};

use super::accessor::Source;
use super::instances::Instances;
use super::mesh::MeshPlacer;
use super::offset::{Bounds, translation};
use super::primitive::Primitive;
use super::skin::Skin;
use super::stated_places;
use crate::error::SceneError;
use crate::scene::Scene;

/// Offset of a scene's origin, and what its nodes state.
#[derive(Clone, Debug, Default)]
pub(super) struct Anchor {
    pub(super) offset: DVec3,
    /// Translations of all nodes in double precision; empty without an offset.
    stated: Vec<Option<DVec3>>,
}

impl Anchor {
    /// Anchor of a scene whose nodes have these world transforms at rest.
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
            chosen.iter().flat_map(|scene| &scene.nodes).map(|node| node.value()).collect();
        let is_above = |index: &usize| tops.contains(index) && root.nodes[*index].mesh.is_none();
        let above =
            nodes.iter().filter(|(index, _)| is_above(index) && root.nodes[*index].children.is_some());
        let above: Vec<DVec3> = above.map(|(_, world)| world.w_axis.truncate()).collect();
        let offset = bounds.offset(&above);
        let has_offset = offset != DVec3::ZERO;
        let stated = if has_offset { stated_places::read(source.document) } else { Vec::new() };
        Ok(Self { offset, stated })
    }

    /// Local transform of a node about the scene's origin, from that about the file's. `is_posed` if an animation states its translation.
    pub(super) fn placed(&self, node: usize, mut local: DMat4, is_posed: bool, is_root: bool) -> DMat4 {
        if self.offset != DVec3::ZERO {
            let stated = self.stated.get(node).copied().flatten().filter(|_| !is_posed);
            let place = stated.unwrap_or(local.w_axis.truncate());
            local.w_axis = translation(place, self.offset, is_root).extend(1.0);
        }
        local
    }
}

/// Bounds of the triangles of a scene at rest.
struct Extent<'e, 's, 'a> {
    source: &'e Source<'s>,
    meshes: &'e mut MeshPlacer<'a>,
    nodes: &'e [(usize, DMat4)],
    /// Bounds of the primitives of each mesh, in its own space.
    locals: BTreeMap<usize, Vec<Bounds>>,
}

impl Extent<'_, '_, '_> {
    fn bounds(&mut self, scene: &mut Scene) -> Result<Bounds, SceneError> {
        let root = &self.source.document.root;
        let mut worlds = vec![None; root.nodes.len()];
        self.nodes.iter().for_each(|&(index, world)| worlds[index] = Some(world));
        let mut bounds = Bounds::EMPTY;
        for &(index, world) in self.nodes {
            let node = &root.nodes[index];
            let Some(mesh) = node.mesh.map(|mesh| mesh.value()) else { continue };
            let locals = self.locals(mesh, scene)?;
            let instances = if node.skin.is_some() { None } else { Instances::of(self.source, index, node)? };
            let transforms = match (node.skin, instances) {
                (Some(skin), _) => Skin::new(self.source, skin.value(), &worlds)?.joints().to_vec(),
                (None, Some(instances)) => {
                    let placed = |instance| Ok(world * instances.transform(self.source, instance)?);
                    (0..instances.count).map(placed).collect::<Result<_, SceneError>>()?
                }
                (None, None) => vec![world],
            };
            for transform in &transforms {
                locals.iter().for_each(|local| bounds.add_placed(transform, local));
            }
        }
        Ok(bounds)
    }

    /// Bounds of the primitives of a mesh.
    fn locals(&mut self, mesh: usize, scene: &mut Scene) -> Result<Vec<Bounds>, SceneError> {
        if let Some(locals) = self.locals.get(&mesh) {
            return Ok(locals.clone());
        }
        let primitives = self.meshes.primitives(mesh, scene)?;
        let locals: Vec<Bounds> = primitives.iter().map(local).collect();
        self.locals.insert(mesh, locals.clone());
        Ok(locals)
    }
}

/// Bounds of the vertices that a primitive's triangles have.
fn local(primitive: &Primitive<'_>) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    for corner in (0..primitive.triangles).flat_map(|triangle| primitive.corners(triangle)) {
        let vertex = primitive.indices.as_ref().map_or(corner, |indices| indices.unsigned(corner));
        if vertex < primitive.positions.count {
            bounds.add(DVec3::from(primitive.positions.vec3(vertex).map(f64::from)));
        }
    }
    bounds
}
