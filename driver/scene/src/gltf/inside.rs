//! Default views inside closed rooms, for files without a camera.

use glam::Vec3;
use rayon::prelude::*;

use crate::{PunctualKind, Scene, Triangle};

/// Number of test rays from a point, spread evenly over the sphere.
const DIRECTIONS: u32 = 96;

/// Maximum number of rays that may leave a closed room, through cracks between its walls.
const MAX_OPEN: usize = 3;

/// Maximum number of triangles of a scene that is tested, because each ray is tested against every triangle.
const MAX_TRIANGLES: usize = 4_000_000;

/// Number of light sources that are tested, the brightest first.
const LAMPS: usize = 4;

/// Position of the camera on the way from the tested point (0) to the wall behind it (1).
const BEFORE_WALL: f32 = 0.92;

/// Offset of the test rays' origin from the lamp's surface, as a fraction of the scene's diagonal.
const CLEARANCE: f32 = 1e-4;

/// Offsets in x and z of tested points from the middle of the scene's bounding box, as fractions of the box's
/// sides.
const STEPS: [f32; 3] = [0.0, 0.2, -0.2];

/// Kind of the default view of a scene without cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Framed {
    FromFront,
    FromInside,
}

/// Returns the position and horizontal direction of a view along the longest free distance in a closed room.
/// `None` if the scene is no closed room, or has no lamp inside.
pub(super) fn view(scene: &Scene) -> Option<(Vec3, Vec3)> {
    if scene.triangles.len() > MAX_TRIANGLES || !lamps(scene).into_iter().any(|lamp| is_enclosed(scene, lamp))
    {
        return None;
    }
    let (low, high) = scene.bounds();
    let (centre, size) = ((low + high) * 0.5, high - low);
    let place = |x, z| centre + Vec3::new(x, 0.0, z) * size;
    let mut places = STEPS.into_iter().flat_map(|x| STEPS.into_iter().map(move |z| place(x, z)));
    let place = places.find(|place| is_enclosed(scene, (*place, None)))?;
    let lengths = [Vec3::Z, Vec3::X, Vec3::NEG_Z, Vec3::NEG_X]
        .map(|back| (back, distance(scene, place, back).unwrap_or(0.0)));
    // Of equal lengths the first is taken, a view along -z like that of a camera of glTF.
    let (back, length) = lengths.into_iter().reduce(|a, b| if b.1 > a.1 { b } else { a })?;
    Some((place + back * (BEFORE_WALL * length), -back))
}

/// Light source: its position, and the normal of its emitting side; `None` for a light without a surface.
type Lamp = (Vec3, Option<Vec3>);

/// The brightest point lights, spot lights and emissive triangles.
fn lamps(scene: &Scene) -> Vec<Lamp> {
    let mut lamps = Vec::new();
    for light in &scene.lights {
        match light.kind {
            PunctualKind::Point { position }
            | PunctualKind::Spot { position, .. }
            | PunctualKind::Profile { position, .. } => {
                lamps.push((light.intensity.max_element(), (position, None)));
            }
            PunctualKind::Directional { .. } => {}
        }
    }
    let (low, high) = scene.bounds();
    let clearance = CLEARANCE * low.distance(high);
    for triangle in &scene.triangles {
        let Some(material) = scene.materials.get(triangle.material as usize) else { continue };
        let Some(normal) = triangle.scaled_normal().try_normalize().filter(|_| material.is_emissive()) else {
            continue;
        };
        let centre = triangle.vertices.into_iter().sum::<Vec3>() / 3.0;
        let power = triangle.area() * material.emission.max_element();
        lamps.push((power, (centre + normal * clearance, Some(normal))));
    }
    lamps.sort_by(|a, b| b.0.total_cmp(&a.0));
    lamps.into_iter().take(LAMPS).map(|(_, lamp)| lamp).collect()
}

/// Returns whether nearly all rays from a lamp meet surfaces, and less than half of the rays meet the back of
/// a one-sided surface.
fn is_enclosed(scene: &Scene, (place, side): Lamp) -> bool {
    let directions = (0..DIRECTIONS).map(direction);
    let directions: Vec<Vec3> =
        directions.filter(|direction| side.is_none_or(|side| direction.dot(side) > 0.0)).collect();
    let (mut open, mut backs) = (0, 0);
    for direction in &directions {
        match nearest(scene, place, *direction) {
            None => open += 1,
            Some((_, triangle)) => {
                let material = scene.materials.get(triangle.material as usize);
                let is_one_sided = material.is_some_and(|material| !material.double_sided);
                backs += usize::from(is_one_sided && triangle.scaled_normal().dot(*direction) > 0.0);
            }
        }
        if open > MAX_OPEN {
            return false;
        }
    }
    2 * backs < directions.len()
}

/// Unit vector `index` of a spiral that covers the sphere evenly.
fn direction(index: u32) -> Vec3 {
    let y = 1.0 - (2.0 * index as f32 + 1.0) / DIRECTIONS as f32;
    let golden = std::f32::consts::PI * (3.0 - libm::sqrtf(5.0));
    let (sine, cosine) = libm::sincosf(golden * index as f32);
    let radius = libm::sqrtf(1.0 - y * y);
    Vec3::new(radius * cosine, y, radius * sine)
}

fn distance(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<f32> {
    nearest(scene, origin, direction).map(|(distance, _)| distance)
}

/// Nearest triangle along a ray, with its distance.
fn nearest(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<(f32, &Triangle)> {
    let hits = scene.triangles.par_iter().with_min_len(4096).enumerate();
    let hits = hits.filter_map(|(index, triangle)| Some((hit(triangle, origin, direction)?, index)));
    let (distance, index) = hits.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
    Some((distance, scene.triangles.get(index)?))
}

/// Distance to a triangle along a ray (Möller and Trumbore 1997).
fn hit(triangle: &Triangle, origin: Vec3, direction: Vec3) -> Option<f32> {
    let [a, b, c] = triangle.vertices;
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from = (origin - a) / determinant;
    let u = from.dot(p);
    let q = from.cross(ab);
    let (v, distance) = (direction.dot(q), ac.dot(q));
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}
