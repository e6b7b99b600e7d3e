//! Test whether a triangle is cut out at a given position.

use glam::Vec3;
use photoncard_shared::layout::{LAMP, TriangleId};
use photoncard_shared::message::Fault;

use super::SceneImage;
use super::coverage::coverage;
use super::materials::read_material;
use super::triangles::read_triangle;
use crate::memory::MemoryPort;

/// Returns true if a triangle has no cut-out at the point `place`, metres, and is no lamp without substance.
/// A point off the triangle's plane is projected onto it.
///
/// # Errors
/// If the card image is invalid.
pub fn is_there(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    id: TriangleId,
    place: Vec3,
) -> Result<bool, Fault> {
    let triangle = read_triangle(scene, memory, id)?;
    let material = read_material(scene, memory, triangle.material)?;
    if material.flags & LAMP != 0 {
        return Ok(false);
    }
    let [a, b, c] = triangle.vertices.map(Vec3::from_array);
    let normal = (b - a).cross(c - a);
    let weight = |from: Vec3, to: Vec3| (to - from).cross(place - from).dot(normal) / normal.length_squared();
    let weights = [weight(b, c), weight(c, a), weight(a, b)];
    Ok(coverage(scene, memory, &material, id, weights)? > 0.0)
}
