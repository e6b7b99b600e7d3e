//! Encodes vertex attributes of triangles as records of the card image.

use photoncard_scene::{NO_ATTRIBUTES, Scene, Triangle, VertexAttributes};
use photoncard_shared::layout::{self, LEAF_TRIANGLES, LeafAttributes, Record, Tangents};

use crate::bvh::LeafTriangles;
use crate::light::Lights;

/// Vertex attributes of the triangles in all leaves. Leaves without attributes have no records.
pub(super) struct PackedCorners {
    /// Encoded [`LeafAttributes`] of each leaf; empty if no leaf has attributes.
    pub(super) leaves: Vec<u32>,
    /// Records of the leaves with attributes.
    pub(super) records: Vec<[u8; layout::Attributes::BYTES]>,
}

impl PackedCorners {
    /// Encodes the vertex attributes of a scene whose triangles are in `leaves`. `uncovered` is the result of
    /// [`Scene::uncovered_materials`].
    pub(super) fn new(
        scene: &Scene,
        lights: &Lights,
        (leaves, uncovered): (&[LeafTriangles], &[bool]),
    ) -> Self {
        let mut packed = Self { leaves: Vec::with_capacity(leaves.len()), records: Vec::new() };
        let stored: Vec<&Triangle> = scene.stored_triangles().collect();
        for leaf in leaves {
            let triangles: heapless::Vec<_, LEAF_TRIANGLES> =
                leaf.iter().map(|&index| (index, stored[index as usize])).collect();
            let entry = packed.append(scene, lights, (&triangles, uncovered));
            packed.leaves.push(entry);
        }
        if packed.records.is_empty() {
            packed.leaves.clear();
        }
        packed
    }

    /// Appends the records of a leaf with these triangles and their indices. Returns its encoded
    /// [`LeafAttributes`].
    fn append(
        &mut self,
        scene: &Scene,
        lights: &Lights,
        (leaf, uncovered): (&[(u32, &Triangle)], &[bool]),
    ) -> u32 {
        let triangles = || leaf.iter().map(|&(_, triangle)| triangle);
        let materials = || triangles().map(|triangle| &scene.materials[triangle.material as usize]);
        let has_corners = triangles().any(|triangle| triangle.attributes != NO_ATTRIBUTES);
        let has_cut_outs = triangles().any(|triangle| uncovered[triangle.material as usize]);
        let has_emitters = leaf.iter().any(|&(index, _)| lights.of_triangle(index).is_some());
        if !has_corners && !has_cut_outs && !has_emitters {
            return layout::NO_ATTRIBUTES;
        }
        let is_of_second_set = |texture: u32| scene.textures[texture as usize].set == 1;
        let two_sets = materials().any(|material| material.textures().any(is_of_second_set));
        if materials().any(|material| material.tangent_texture().is_some()) {
            let tangents: Vec<Tangents> = triangles().map(|triangle| tangents(scene, triangle)).collect();
            self.records.extend(Tangents::to_records(&tangents));
        }
        // The upper bit of the index is free, because there are at most 2^28 triangles with at most two
        // records each, and two records per leaf for tangents.
        let first = self.records.len() as u32;
        for &(index, triangle) in leaf {
            let emitter = lights.of_triangle(index);
            let attributes =
                scene.attributes.get(triangle.attributes as usize).unwrap_or(&VertexAttributes::NONE);
            let sets = 0..1 + usize::from(two_sets);
            self.records.extend(sets.map(|set| record(attributes, set, emitter).to_bytes()));
        }
        LeafAttributes { first, two_sets }.to_entry()
    }
}

/// Tangents of a triangle; [`Tangents::NONE`] if its attributes have none.
fn tangents(scene: &Scene, triangle: &Triangle) -> Tangents {
    let attributes = scene.attributes.get(triangle.attributes as usize);
    let tangents = attributes.and_then(|attributes| scene.tangents.get(attributes.tangents as usize));
    tangents.map_or(Tangents::NONE, |corners| Tangents {
        directions: corners.map(|tangent| tangent.truncate().to_array()),
        signs: corners.map(|tangent| tangent.w),
    })
}

/// Record of vertex attributes with one set of texture coordinates. `emitter` is the index of the triangle's
/// emitter, if it emits.
fn record(attributes: &VertexAttributes, set: usize, emitter: Option<u32>) -> layout::Attributes {
    layout::Attributes {
        normals: attributes.normals.map(|normals| normals.map(|normal| normal.to_array())),
        coordinates: attributes.coordinates[set].map(|coordinates| coordinates.to_array()),
        colours: attributes.colours,
        emitter,
    }
}
