//! Rays traced through the whole scene, used for balls with more triangles than a list can hold.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::{Ray, SceneImage, closest_hit};
use photoncard_shared::layout::TriangleId;
use photoncard_shared::message::Fault;

/// Hit of a ray on a triangle.
pub(super) struct Met {
    /// Distance from the ray's origin, metres.
    pub(super) distance: f32,
    /// Corners of the triangle, metres.
    pub(super) corners: [Vec3; 3],
    /// Unit normal of the triangle's front.
    pub(super) normal: Vec3,
    pub(super) triangle: TriangleId,
}

/// Finds the nearest triangle along a ray.
pub(super) fn first_triangle(scene: &SceneImage, mut memory: Lines, ray: &Ray) -> Result<Option<Met>, Fault> {
    let Some(hit) = closest_hit(scene, &mut memory, ray)? else { return Ok(None) };
    let corners = hit.triangle.vertices.map(Vec3::from);
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    Ok(Some(Met { distance: hit.intersection.distance, corners, normal, triangle: hit.id }))
}

/// Finds all triangles on the segment between two points. After each hit the ray continues `step` metres
/// behind the hit.
pub(super) fn all_on_way(
    scene: &SceneImage,
    memory: Lines,
    [from, to]: [Vec3; 2],
    step: f32,
) -> Result<Vec<Met>, Fault> {
    let length = from.distance(to);
    let direction = (to - from) / length;
    let (mut all, mut gone) = (Vec::new(), 0.0);
    while gone < length {
        let ray = Ray { origin: from + direction * gone, direction, max_distance: length - gone };
        let Some(met) = first_triangle(scene, memory, &ray)? else { break };
        let distance = gone + met.distance;
        all.push(Met { distance, ..met });
        gone = distance + step;
    }
    Ok(all)
}
