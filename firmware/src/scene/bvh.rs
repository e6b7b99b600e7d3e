//! The ray caster: descent in a hierarchy of four-wide nodes, one line each, with a stack of fixed size.

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::BVH_STACK;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhNode, ChildReference, Record, Triangle};
use photoncard_shared::message::{Fault, FaultCode};

use super::{Intersection, Ray, RayFrame, SceneImage};
use crate::memory::MemoryPort;
use crate::vector::{max, min};

const TRIANGLES_PER_LINE: u32 = Triangle::PER_LINE as u32;

/// The nearest triangle that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Where on the ray and on the triangle.
    pub intersection: Intersection,
    /// The triangle.
    pub triangle: Triangle,
    /// Its index in the image.
    pub index: u32,
}

/// The first triangle on the ray's way; of two at the same distance, that of the lower index.
///
/// # Errors
/// If the image is not sound: a record out of range, or a hierarchy deeper than the stack.
pub fn closest_hit(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
) -> Result<Option<Hit>, Fault> {
    let mut nearest: Option<Hit> = None;
    descend(scene, memory, ray, |intersection, triangle, index| {
        let is_nearer = nearest.is_none_or(|hit| {
            let distance = hit.intersection.distance;
            intersection.distance < distance || intersection.distance == distance && index < hit.index
        });
        if is_nearer {
            nearest = Some(Hit { intersection, triangle: *triangle, index });
        }
        Visit::Until(nearest.map_or(ray.max_distance, |hit| hit.intersection.distance))
    })?;
    Ok(nearest)
}

/// Whether any triangle lies on the ray's way.
///
/// # Errors
/// As [`closest_hit`].
pub fn is_occluded(scene: &SceneImage, memory: &mut impl MemoryPort, ray: &Ray) -> Result<bool, Fault> {
    let mut occluded = false;
    descend(scene, memory, ray, |_, _, _| {
        occluded = true;
        Visit::Stop
    })?;
    Ok(occluded)
}

/// What a descent does after a triangle was met.
enum Visit {
    /// Go on with what is at most this far.
    Until(f32),
    /// Enough is known.
    Stop,
}

/// A child whose box the ray enters, and where.
#[derive(Clone, Copy)]
struct Entry {
    distance: f32,
    child: ChildReference,
}

/// Calls `visit` for every triangle that the ray meets and that is not farther than `visit` last said.
#[inline(always)]
fn descend(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    mut visit: impl FnMut(Intersection, &Triangle, u32) -> Visit,
) -> Result<(), Fault> {
    let frame = RayFrame::new(ray);
    let slabs = Slabs::new(ray);
    let mut until = ray.max_distance;
    let mut stack: Vec<Entry, BVH_STACK> = Vec::new();
    let Some(root) = ChildReference::node(0) else { return Ok(()) };
    let mut next = Some(Entry { distance: 0.0, child: root });
    // A tree's node is entered once: more visits than nodes tell of a cycle in an unsound image.
    let mut visits_left = scene.header.section(SectionKind::Nodes).records;
    while let Some(entry) = next {
        if entry.distance > until {
            next = stack.pop();
            continue;
        }
        let Some((first, count)) = entry.child.triangles() else {
            let index = entry.child.0;
            visits_left =
                visits_left.checked_sub(1).ok_or(Fault { code: FaultCode::Depth, detail: index })?;
            let bytes = scene.record::<LINE_BYTES, 1>(memory, SectionKind::Nodes, index)?;
            let entered = slabs.enter(&BvhNode::read(bytes), until);
            next = push(&mut stack, entered).map_err(|()| Fault { code: FaultCode::Depth, detail: index })?;
            continue;
        };
        for index in first..first.saturating_add(count) {
            let triangle = read_triangle(scene, memory, index)?;
            let Some(intersection) = frame.intersect(&triangle.vertices, until) else { continue };
            match visit(intersection, &triangle, index) {
                Visit::Until(distance) => until = distance,
                Visit::Stop => return Ok(()),
            }
        }
        next = stack.pop();
    }
    Ok(())
}

#[inline(always)]
pub(super) fn read_triangle(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    index: u32,
) -> Result<Triangle, Fault> {
    scene
        .record::<{ Triangle::BYTES }, TRIANGLES_PER_LINE>(memory, SectionKind::Triangles, index)
        .map(Triangle::read)
}

/// Pushes the children that were entered, the nearest last, and takes that one off again.
#[expect(clippy::indexing_slicing, reason = "a network of constant indices")]
#[inline(always)]
fn push(stack: &mut Vec<Entry, BVH_STACK>, mut entered: [Entry; 4]) -> Result<Option<Entry>, ()> {
    // A sorting network for four; a child that was not entered is infinitely far.
    for (a, b) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        if entered[a].distance < entered[b].distance {
            entered.swap(a, b);
        }
    }
    let [farthest, farther, nearer, nearest] = entered;
    for entry in [farthest, farther, nearer] {
        if entry.distance < f32::INFINITY {
            stack.push(entry).map_err(drop)?;
        }
    }
    if nearest.distance < f32::INFINITY { Ok(Some(nearest)) } else { Ok(stack.pop()) }
}

/// A ray made ready for many boxes.
struct Slabs {
    origin: Vec3,
    inverse: Vec3,
}

/// A far distance is enlarged by this, so that rounding never loses a box that the ray grazes (Ize 2013, *Robust BVH
/// ray traversal*).
const FAR_MARGIN: f32 = 1.0 + 4.0 * f32::EPSILON;

impl Slabs {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        // A zero component would make 0 * infinity: a direction that small is as good.
        let invert = |d: f32| 1.0 / if d.abs() < 1e-30 { 1e-30 } else { d };
        let d = ray.direction;
        Self { origin: ray.origin, inverse: Vec3::new(invert(d.x), invert(d.y), invert(d.z)) }
    }

    /// Where the ray enters each child's box: infinity if it does not, or beyond `until`.
    #[expect(clippy::indexing_slicing, reason = "constant bounds")]
    #[inline(always)]
    fn enter(&self, node: &BvhNode, until: f32) -> [Entry; 4] {
        let origin = self.origin.to_array();
        let inverse = self.inverse.to_array();
        let mut near = [0.0_f32; 4];
        let mut far = [until; 4];
        for axis in 0..3 {
            for child in 0..4 {
                let a = (node.lower[axis][child] - origin[axis]) * inverse[axis];
                let b = (node.upper[axis][child] - origin[axis]) * inverse[axis];
                near[child] = max(min(a, b), near[child]);
                far[child] = min(max(a, b) * FAR_MARGIN, far[child]);
            }
        }
        core::array::from_fn(|child| Entry {
            distance: if near[child] <= far[child] && node.children[child] != ChildReference::EMPTY {
                near[child]
            } else {
                f32::INFINITY
            },
            child: node.children[child],
        })
    }
}
