//! Solid glass without `KHR_materials_volume`: Blender writes no thickness, and its users mean solids.

use std::collections::HashMap;

use super::document::Document;
use crate::scene::{Reflection, Scene, Triangle};

/// Start of `asset.generator` of Blender's own exporter.
const BLENDER: &str = "Khronos glTF Blender I/O";

/// Makes closed meshes of glass without a thickness solid in a file of Blender. Returns the materials' names.
pub(super) fn make_solid(document: &Document, scene: &mut Scene) -> Vec<String> {
    let generator = document.root.asset.generator.as_deref().unwrap_or_default();
    if !generator.starts_with(BLENDER) {
        return Vec::new();
    }
    let mut names = Vec::new();
    for index in 0..scene.materials.len() {
        let is_wall = |reflection: &Reflection| match reflection {
            Reflection::MetallicRoughness { transmission: Some(transmission), .. } => {
                transmission.factor > 0.0 && !transmission.is_volume
            }
            _ => false,
        };
        let of_material = |triangle: &&Triangle| triangle.material as usize == index;
        if !is_wall(&scene.materials[index].reflection)
            || !is_closed(scene.triangles.iter().filter(of_material))
        {
            continue;
        }
        let material = &mut scene.materials[index];
        if let Reflection::MetallicRoughness { transmission: Some(transmission), .. } =
            &mut material.reflection
        {
            transmission.is_volume = true;
        }
        names.push(material.name.clone());
    }
    names
}

/// Returns whether triangles, one at least, bound a solid: every edge is passed as often in one direction as in the other.
fn is_closed<'a>(triangles: impl Iterator<Item = &'a Triangle>) -> bool {
    // Negative zero equals zero.
    let bits = |corner: glam::Vec3| corner.to_array().map(|axis| (axis + 0.0).to_bits());
    let mut passed: HashMap<[[u32; 3]; 2], i64> = HashMap::new();
    for triangle in triangles {
        let [a, b, c] = triangle.vertices.map(bits);
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let (edge, direction) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
            *passed.entry(edge).or_default() += direction;
        }
    }
    !passed.is_empty() && passed.values().all(|&direction| direction == 0)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn tetrahedron() -> Vec<Triangle> {
        let [o, x, y, z] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        [[o, y, x], [o, x, z], [o, z, y], [x, y, z]].map(|vertices| Triangle::new(vertices, 0)).to_vec()
    }

    #[test]
    fn a_solid_is_closed_and_one_without_a_face_is_not() {
        let solid = tetrahedron();
        assert!(is_closed(solid.iter()));
        assert!(!is_closed(solid.iter().skip(1)));
        assert!(!is_closed([].iter()));
    }
}
