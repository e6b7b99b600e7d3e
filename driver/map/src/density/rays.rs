//! Rays traced through the whole scene, used for balls with more triangles than a list can hold.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::{Hit, Ray, SceneImage, closest_hit, for_each_hit};
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

impl Met {
    fn new(hit: &Hit) -> Self {
        let corners = hit.triangle.vertices.map(Vec3::from);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        Self { distance: hit.intersection.distance, corners, normal, triangle: hit.id }
    }
}

/// Finds the nearest triangle along a ray.
pub(super) fn first_triangle(scene: &SceneImage, mut memory: Lines, ray: &Ray) -> Result<Option<Met>, Fault> {
    Ok(closest_hit(scene, &mut memory, ray)?.map(|hit| Met::new(&hit)))
}

/// Finds the triangles on the segment between two points, in the order of their distances from the first
/// point. Of triangles within `step` metres of each other only the first is found.
pub(super) fn all_on_way(
    scene: &SceneImage,
    mut memory: Lines,
    [from, to]: [Vec3; 2],
    step: f32,
) -> Result<Vec<Met>, Fault> {
    let length = from.distance(to);
    if length == 0.0 {
        return Ok(Vec::new());
    }
    let ray = Ray::of_light(from, (to - from) / length, length);
    let (mut all, mut limit) = (Vec::new(), MANY_HITS);
    for_each_hit(scene, &mut memory, &ray, |hit| {
        all.push(Met::new(&hit));
        if all.len() == limit {
            thin(&mut all, step);
            limit = MANY_HITS.max(2 * all.len());
        }
    })?;
    thin(&mut all, step);
    Ok(all)
}

/// Number of hits above which hits close to each other are removed before all are found: a file can have
/// millions of coincident triangles.
const MANY_HITS: usize = 4096;

/// Sorts hits by distance, and keeps the first of those within `step` metres of each other.
fn thin(hits: &mut Vec<Met>, step: f32) {
    hits.sort_unstable_by(|one, other| {
        one.distance.total_cmp(&other.distance).then(one.triangle.cmp(&other.triangle))
    });
    hits.dedup_by(|next, kept| next.distance <= kept.distance + step);
}
