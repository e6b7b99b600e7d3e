//! The ray caster: traversal of a bounding volume hierarchy with nodes of sixteen children and leaves of up to eight triangles, one
//! line each.

use core::ops::ControlFlow;

use photoncard_shared::budget::BVH_STACK;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhLeaf, BvhNode, Child, LEAF_TRIANGLES, Triangle, WideNode};
use photoncard_shared::message::Fault;

use super::coverage::is_met;
use super::slabs::Slabs;
use super::{Hit, Intersection, Ray, RayFrame, SceneImage};
use crate::memory::MemoryPort;
use crate::simd::{self, Isa, Kernel, LANES};
use crate::wide_tree::{Descent, Order, Stack};

/// Closest hit of a ray. Ties of distance are broken by the lower triangle index.
///
/// # Errors
/// If the image is not sound: a record out of range, or a hierarchy deeper than the stack.
#[inline(always)]
pub fn closest_hit(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
) -> Result<Option<Hit>, Fault> {
    simd::run(ClosestHit { scene, memory, ray })
}

/// `true` if the ray meets any triangle.
///
/// # Errors
/// As [`closest_hit`].
#[inline(always)]
pub fn is_occluded(scene: &SceneImage, memory: &mut impl MemoryPort, ray: &Ray) -> Result<bool, Fault> {
    simd::run(AnyHit { scene, memory, ray })
}

/// Kernel of [`closest_hit`].
pub struct ClosestHit<'a, M> {
    /// The scene.
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// The ray.
    pub ray: &'a Ray,
}

impl<M: MemoryPort> Kernel for ClosestHit<'_, M> {
    type Output = Result<Option<Hit>, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, ray } = self;
        let mut nearest: Option<Hit> = None;
        descend(isa, scene, memory, ray, Order::NearestFirst, |intersection, index, triangle| {
            let is_nearer = nearest.is_none_or(|hit| {
                let distance = hit.intersection.distance;
                intersection.distance < distance || intersection.distance == distance && index < hit.index
            });
            if is_nearer {
                nearest = Some(Hit { intersection, triangle: triangle(), index });
            }
            ControlFlow::Continue(nearest.map_or(ray.max_distance, |hit| hit.intersection.distance))
        })?;
        Ok(nearest)
    }
}

/// Kernel of [`is_occluded`].
pub struct AnyHit<'a, M> {
    /// The scene.
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// The ray.
    pub ray: &'a Ray,
}

impl<M: MemoryPort> Kernel for AnyHit<'_, M> {
    type Output = Result<bool, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, ray } = self;
        let mut occluded = false;
        descend(isa, scene, memory, ray, Order::Any, |_, _, _| {
            occluded = true;
            ControlFlow::Break(())
        })?;
        Ok(occluded)
    }
}

/// Hits of triangles with cut-outs or partial coverage in one leaf, before their alpha is read.
type CutOuts = heapless::Vec<Hit, LEAF_TRIANGLES>;

/// Calls `visit` with each intersection, the triangle's index, and a function that reads the triangle. The maximum distance is the one
/// that `visit` returned last.
#[inline(always)]
fn descend(
    isa: impl Isa,
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    order: Order,
    mut visit: impl FnMut(Intersection, u32, &dyn Fn() -> Triangle) -> ControlFlow<(), f32>,
) -> Result<(), Fault> {
    let frame = RayFrame::new(ray);
    let slabs = Slabs::new(ray);
    let mut until = ray.max_distance;
    let mut stack = Stack::<{ BVH_STACK + LANES }>::new();
    let mut descent = Descent::new(scene, SectionKind::Nodes, SectionKind::Triangles, &mut stack);
    while let Some(part) = descent.next(until.to_bits())? {
        match part {
            Child::Node(node) => descent.enter(isa, memory, node, order, |line| {
                let children = WideNode(line).children() as usize;
                slabs.enter(isa, BvhNode(line), children, until)
            })?,
            Child::Leaf(leaf) => {
                let line = BvhLeaf(descent.leaf(memory, leaf)?);
                let mut may_meet = frame.may_meet(isa, line);
                let mut with_cut_outs = CutOuts::new();
                while may_meet != 0 {
                    let slot = may_meet.trailing_zeros() as usize;
                    may_meet &= may_meet - 1;
                    let Some(intersection) = frame.intersect_slot(line, slot, until) else {
                        continue;
                    };
                    let index = leaf.wrapping_mul(LEAF_TRIANGLES as u32).wrapping_add(slot as u32);
                    if line.is_cut_out(slot) {
                        // Alpha is read after the leaf: a read of a texture ends the borrow of the leaf's line.
                        let _ =
                            with_cut_outs.push(Hit { intersection, triangle: line.triangle(slot), index });
                        continue;
                    }
                    match visit(intersection, index, &|| line.triangle(slot)) {
                        ControlFlow::Continue(distance) => until = distance,
                        ControlFlow::Break(()) => return Ok(()),
                    }
                }
                for Hit { intersection, triangle, index } in &with_cut_outs {
                    let is_near = intersection.distance <= until;
                    let weights = intersection.barycentric;
                    if !is_near || !is_met(scene, memory, ray, (*index, triangle), weights)? {
                        continue;
                    }
                    match visit(*intersection, *index, &|| *triangle) {
                        ControlFlow::Continue(distance) => until = distance,
                        ControlFlow::Break(()) => return Ok(()),
                    }
                }
            }
        }
    }
    Ok(())
}

/// Triangle `index` of the image.
#[inline(always)]
pub(super) fn read_triangle(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    index: u32,
) -> Result<Triangle, Fault> {
    let [leaf, slot] = [index / LEAF_TRIANGLES as u32, index % LEAF_TRIANGLES as u32];
    let line = scene.line(memory, SectionKind::Triangles, leaf, BvhLeaf::OF_TRIANGLE)?;
    Ok(BvhLeaf(line).triangle(slot as usize))
}
