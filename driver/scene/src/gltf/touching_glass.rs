//! Joins coinciding faces of glass solids that touch, such as a drink and its tumbler, into one interface
//! between two media. Otherwise a ray would meet one of the faces and miss the other.

use std::collections::BTreeMap;

use glam::Vec3;

use super::solid_glass::transmission;
use crate::{Material, Reflection, Scene, Transmission};

/// Result of joining two coinciding faces.
#[derive(Clone, Debug, PartialEq)]
enum Touch {
    /// Both faces are removed, because the medium is the same on both sides.
    None,
    /// One face becomes the interface of the two media, with this material, and the other is removed.
    Interface(Box<Material>),
}

/// Joins coinciding glass faces that face each other. Returns the names of materials with coinciding faces
/// that cannot be joined.
pub(super) fn join(scene: &mut Scene) -> Vec<String> {
    let mut places: BTreeMap<[[u32; 3]; 3], Vec<usize>> = BTreeMap::new();
    for (index, triangle) in scene.triangles.iter().enumerate() {
        if transmission(&scene.materials[triangle.material as usize]).is_some_and(|it| it.is_volume) {
            places.entry(place(triangle.vertices).0).or_default().push(index);
        }
    }
    let mut apart = Vec::new();
    let mut is_left_out = vec![false; scene.triangles.len()];
    let mut interfaces: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for faces in places.into_values().filter(|faces| faces.len() > 1) {
        let Some((kept, touch)) = touch_of(scene, &faces) else {
            let names = faces.iter().map(|&face| scene.triangles[face].material as usize);
            apart.extend(names.map(|material| scene.materials[material].name.clone()));
            continue;
        };
        let key = [kept, faces[0] + faces[1] - kept].map(|face| scene.triangles[face].material);
        faces.iter().for_each(|&face| is_left_out[face] = true);
        if let Touch::Interface(material) = touch {
            is_left_out[kept] = false;
            scene.triangles[kept].material = *interfaces.entry(key).or_insert_with(|| {
                scene.materials.push(*material);
                scene.materials.len() as u32 - 1
            });
        }
    }
    let mut is_left_out = is_left_out.into_iter();
    scene.triangles.retain(|_| !is_left_out.next().unwrap_or(false));
    apart
}

/// Corners of a triangle in ascending order, and whether the triangle traverses them in this order or a
/// rotation of it.
fn place(corners: [Vec3; 3]) -> ([[u32; 3]; 3], bool) {
    // Negative zero equals zero.
    let [a, b, c] = corners.map(|corner| corner.to_array().map(|axis| (axis + 0.0).to_bits()));
    let is_descending = (a < b) ^ (b < c) ^ (c < a);
    let mut sorted = [a, b, c];
    sorted.sort_unstable();
    (sorted, !is_descending)
}

/// Decides which of two coinciding, opposite faces is kept, and with which material. Returns `None` unless
/// there are exactly two faces, of opposite orientation. Different media also give `None` if both absorb
/// light, or if a material has layers or textures.
fn touch_of(scene: &Scene, faces: &[usize]) -> Option<(usize, Touch)> {
    let &[one, other] = faces else { return None };
    let triangles = [one, other].map(|face| &scene.triangles[face]);
    let [is_forward, is_other_forward] = triangles.map(|triangle| place(triangle.vertices).1);
    if is_forward == is_other_forward {
        return None;
    }
    let materials = triangles.map(|triangle| &scene.materials[triangle.material as usize]);
    let media = materials.map(transmission);
    let [Some(inside), Some(outside)] = media else { return None };
    if inside.ior == outside.ior && inside.absorption == outside.absorption {
        return Some((one, Touch::None));
    }
    let is_plain = |material: &Material| material.layers.is_none() && material.textures().next().is_none();
    if !materials.into_iter().all(is_plain) {
        return None;
    }
    // A face has one coefficient of absorption, for the side behind it.
    if outside.absorption == Vec3::ZERO {
        interface(materials, [inside, outside]).map(|material| (one, material))
    } else if inside.absorption == Vec3::ZERO {
        let [first, second] = materials;
        interface([second, first], [outside, inside]).map(|material| (other, material))
    } else {
        None
    }
}

/// Material of the interface between the media behind and in front of a face.
fn interface([material, before]: [&Material; 2], [inside, outside]: [Transmission; 2]) -> Option<Touch> {
    let mut face = material.clone();
    let Reflection::MetallicRoughness { base_colour: base_before, .. } = before.reflection else {
        return None;
    };
    let Reflection::MetallicRoughness { base_colour, dielectric, grazing, transmission, .. } =
        &mut face.reflection
    else {
        return None;
    };
    let ior = inside.ior / outside.ior;
    let amplitude = (ior - 1.0) / (ior + 1.0);
    *base_colour *= base_before;
    *dielectric = Vec3::splat(amplitude * amplitude * *grazing);
    *transmission = Some(Transmission { ior, factor: inside.factor * outside.factor, ..inside });
    face.name = format!("{} in {}", material.name, before.name);
    Some(Touch::Interface(Box::new(face)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Triangle;

    fn medium(name: &str, ior: f32, absorption: f32) -> Material {
        let transmission =
            Transmission { factor: 1.0, ior, is_volume: true, absorption: Vec3::splat(absorption) };
        let reflection = Reflection::MetallicRoughness {
            base_colour: Vec3::splat(0.5),
            metallic: 0.0,
            roughness: 0.0,
            dielectric: Vec3::splat(0.04),
            grazing: 1.0,
            transmission: Some(transmission),
        };
        Material::new(name, reflection)
    }

    /// Two tetrahedra of different media with one pair of coinciding faces.
    fn tetrahedra(media: [Material; 2]) -> Scene {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [3, 2, 1], [4, 1, 2], [4, 2, 3], [4, 3, 1]];
        let triangles = faces.into_iter().zip(0..);
        let triangles =
            triangles.map(|(face, index)| Triangle::new(face.map(|corner| corners[corner]), index / 4));
        Scene::default()
            .with(|scene| (scene.triangles, scene.materials) = (triangles.collect(), media.into()))
    }

    #[test]
    fn faces_of_two_media_become_one_behind_which_is_the_one_that_absorbs() {
        for absorbing in [0, 1] {
            let of = |medium: usize| if medium == absorbing { 3.0 } else { 0.0 };
            let mut scene = tetrahedra([medium("glass", 1.5, of(0)), medium("water", 1.3, of(1))]);
            let behind = scene.triangles[if absorbing == 0 { 3 } else { 4 }];
            assert!(join(&mut scene).is_empty());
            assert_eq!((scene.triangles.len(), scene.materials.len()), (7, 3));
            let face = scene.triangles.iter().find(|triangle| triangle.material == 2).expect("an interface");
            assert_eq!(face.vertices, behind.vertices);
            let found = transmission(&scene.materials[2]).expect("glass");
            let expected = [1.5 / 1.3, 1.3 / 1.5][absorbing];
            assert_eq!((found.ior, found.absorption, found.is_volume), (expected, Vec3::splat(3.0), true));
        }
    }

    #[test]
    fn faces_within_one_medium_are_left_out_and_those_of_two_that_absorb_are_named() {
        let mut one = tetrahedra([medium("one", 1.5, 2.0), medium("other", 1.5, 2.0)]);
        assert!(join(&mut one).is_empty());
        assert_eq!((one.triangles.len(), one.materials.len()), (6, 2));
        let two = tetrahedra([medium("one", 1.5, 2.0), medium("other", 1.3, 3.0)]);
        let mut apart = two.clone();
        assert_eq!(join(&mut apart), ["one", "other"]);
        assert_eq!(apart.triangles, two.triangles);
    }

    /// Places one solid twice: its coinciding faces do not face each other.
    #[test]
    fn coinciding_faces_with_one_orientation_are_named() {
        let mut twice = tetrahedra([medium("one", 1.5, 0.0), medium("other", 1.3, 0.0)]);
        twice.triangles[4].vertices.swap(0, 1);
        assert_eq!(join(&mut twice), ["one", "other"]);
        assert_eq!(twice.triangles.len(), 8);
    }
}
