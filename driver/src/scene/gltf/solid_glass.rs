//! Solid glass without `KHR_materials_volume`: Blender writes no thickness, and its users mean solids.

use std::collections::HashMap;

use glam::Vec3;

use super::document::Document;
use crate::allocation;
use crate::error::SceneError;
use crate::scene::{Material, Reflection, Scene, Transmission, Triangle};

/// Memory of an edge of a triangle while it is matched, bytes.
const BYTES_OF_AN_EDGE: u64 = 64;

/// Makes closed meshes of glass without a thickness solid in a file of Blender: all surfaces of a material, if all of them are closed.
/// Returns the materials' names.
///
/// # Errors
/// If the memory for the edges is not to be had.
pub(super) fn make_solid(document: &Document, scene: &mut Scene) -> Result<Vec<String>, SceneError> {
    if !document.is_of_blender() {
        return Ok(Vec::new());
    }
    let is_wall: Vec<bool> = scene.materials.iter().map(|material| wall(material).is_some()).collect();
    let is_of_wall = |triangle: &&Triangle| is_wall[triangle.material as usize];
    let edges = 3 * scene.triangles.iter().filter(is_of_wall).count() as u64;
    allocation::check(edges * BYTES_OF_AN_EDGE)
        .map_err(|error| SceneError::memory(&document.path, "matching edges of glass", error))?;
    let is_open = open_materials(scene.triangles.iter().filter(is_of_wall), scene.materials.len());
    let mut names = Vec::new();
    for (material, is_open) in scene.materials.iter_mut().zip(is_open) {
        if let Some(transmission) = wall(material).filter(|_| !is_open) {
            let Reflection::MetallicRoughness { transmission: target, .. } = &mut material.reflection else {
                continue;
            };
            *target = Some(Transmission { is_volume: true, ..transmission });
            names.push(material.name.clone());
        }
    }
    Ok(names)
}

/// Transmission of a thin wall; `None` for any other material.
fn wall(material: &Material) -> Option<Transmission> {
    let Reflection::MetallicRoughness { transmission, .. } = material.reflection else { return None };
    transmission.filter(|transmission| transmission.factor > 0.0 && !transmission.is_volume)
}

/// Returns for each material whether its triangles leave an edge open, or it has none: an edge of a closed surface is passed as often in
/// one direction as in the other.
fn open_materials<'a>(triangles: impl Iterator<Item = &'a Triangle>, materials: usize) -> Vec<bool> {
    // Negative zero equals zero.
    let bits = |corner: Vec3| corner.to_array().map(|axis| (axis + 0.0).to_bits());
    let mut passed: HashMap<(u32, [[u32; 3]; 2]), i64> = HashMap::new();
    let mut is_open = vec![true; materials];
    for triangle in triangles {
        is_open[triangle.material as usize] = false;
        let [a, b, c] = triangle.vertices.map(bits);
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let (edge, direction) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
            *passed.entry((triangle.material, edge)).or_default() += direction;
        }
    }
    for ((material, _), direction) in passed {
        is_open[material as usize] |= direction != 0;
    }
    is_open
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Vec<Triangle> {
        let [o, x, y, z] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        [[o, y, x], [o, x, z], [o, z, y], [x, y, z]].map(|vertices| Triangle::new(vertices, 0)).to_vec()
    }

    #[test]
    fn a_solid_is_closed_and_one_without_a_face_is_not() {
        let solid = tetrahedron();
        assert_eq!(open_materials(solid.iter(), 2), [false, true]);
        assert_eq!(open_materials(solid.iter().skip(1), 1), [true]);
    }
}
