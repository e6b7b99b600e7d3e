//! Identities of triangles: numbers of pairs of object and material.
//!
//! Pairs of the triangles in world space come first, in order. The pairs of an object that is an instance of
//! a group are consecutive, one for each material of the group. A triangle of the group stores the number of
//! its material among them, and the instance the number of the first.

use std::collections::{BTreeMap, BTreeSet};

use photoncard_picture::cryptomatte::Identities;
use photoncard_scene::{Instance, Scene, Triangle};
use photoncard_shared::layout::LEAF_TRIANGLES;

use crate::bvh::Hierarchy;

/// Identities of a scene.
pub(super) struct Identified {
    pub(super) names: Identities,
    /// Identities of the triangles in world space, by object and material.
    pairs: BTreeMap<[u32; 2], u32>,
    /// Materials of each group, in order.
    of_groups: Vec<Vec<u32>>,
    /// First identity of the instances, by object and group.
    instances: BTreeMap<[u32; 2], u32>,
}

impl Identified {
    pub(super) fn new(scene: &Scene) -> Self {
        let placed: BTreeSet<_> = scene.triangles.iter().map(pair).collect();
        let mut pairs: Vec<[u32; 2]> = placed.into_iter().collect();
        let of_triangles = pairs.iter().copied().zip(0..).collect();
        let of_group = |group: &Vec<Triangle>| -> Vec<u32> {
            let materials: BTreeSet<u32> = group.iter().map(|triangle| triangle.material).collect();
            materials.into_iter().collect()
        };
        let of_groups: Vec<Vec<u32>> = scene.groups.iter().map(of_group).collect();
        let mut instances = BTreeMap::new();
        for &Instance { group, object, .. } in &scene.instances {
            instances.entry([object, group]).or_insert_with(|| {
                let first = pairs.len() as u32;
                let materials = of_groups.get(group as usize).into_iter().flatten();
                pairs.extend(materials.map(|&material| [object, material]));
                first
            });
        }
        Self { names: named(scene, &pairs), pairs: of_triangles, of_groups, instances }
    }

    /// Values of the section: for each leaf of the hierarchy, one for each slot.
    pub(super) fn values(&self, scene: &Scene, hierarchy: &Hierarchy) -> Vec<u32> {
        let of_groups = scene.groups.iter().zip(&self.of_groups).flat_map(|(group, materials)| {
            let number = |triangle: &Triangle| materials.binary_search(&triangle.material).unwrap_or(0);
            group.iter().map(move |triangle| number(triangle) as u32)
        });
        let of_triangles = scene.triangles.iter().map(|triangle| self.pairs.get(&pair(triangle)).copied());
        let stored: Vec<u32> = of_triangles.map(Option::unwrap_or_default).chain(of_groups).collect();
        let mut values = vec![0; hierarchy.leaves.len() * LEAF_TRIANGLES];
        for (slots, triangles) in values.chunks_mut(LEAF_TRIANGLES).zip(&hierarchy.leaf_triangles) {
            for (slot, &triangle) in slots.iter_mut().zip(triangles) {
                *slot = stored.get(triangle as usize).copied().unwrap_or(0);
            }
        }
        for &(leaf, instance) in &hierarchy.instances {
            let Instance { group, object, .. } = scene.instances[instance as usize];
            values[leaf * LEAF_TRIANGLES] = self.instances.get(&[object, group]).copied().unwrap_or(0);
        }
        values
    }
}

fn pair(triangle: &Triangle) -> [u32; 2] {
    [triangle.object, triangle.material]
}

/// Names of pairs of object and material; objects and materials of no pair are left out.
fn named(scene: &Scene, pairs: &[[u32; 2]]) -> Identities {
    let used = |side: usize| -> Vec<u32> {
        let all: BTreeSet<u32> = pairs.iter().map(|pair| pair[side]).collect();
        all.into_iter().collect()
    };
    let (objects, materials) = (used(0), used(1));
    let object = |&index: &u32| {
        scene.objects.get(index as usize).cloned().unwrap_or_else(|| format!("object {index}"))
    };
    let material = |&index: &u32| {
        let material = scene.materials.get(index as usize);
        material.map_or_else(|| format!("material {index}"), |material| material.name.clone())
    };
    let place = |list: &[u32], index: u32| list.binary_search(&index).unwrap_or(0) as u32;
    let renumbered =
        pairs.iter().map(|&[object, material]| [place(&objects, object), place(&materials, material)]);
    let names = Identities::new(
        objects.iter().map(object).collect(),
        materials.iter().map(material).collect(),
        renumbered.collect(),
    );
    // Every index is in its list.
    names.unwrap_or_default()
}
