//! Ray caster: traversal of a bounding volume hierarchy. Nodes have sixteen children and leaves up to eight
//! triangles; each takes one line of memory. A leaf without triangles is an [`Instance`] of a group, which
//! has a hierarchy of its own. The group's boxes are tested in its space, and its triangles in world space.
//! An instance and copies of its triangles at the same positions are therefore hit alike.

use core::ops::ControlFlow;

use glam::Vec3;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::BVH_STACK;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{
    BvhLeaf, BvhNode, Child, Instance, LEAF_TRIANGLES, NO_INSTANCE, TriangleId, WideNode,
};
use photoncard_shared::message::{Fault, FaultCode};

use super::coverage::is_met;
use super::flat_glass::of_flat_glass;
use super::slabs::Slabs;
use super::triangle::ShearedLeaf;
use super::triangles::place_leaf;
use super::{Hit, Intersection, Ray, RayFrame, SceneImage};
use crate::memory::MemoryPort;
use crate::simd::{self, Isa, Kernel, LANES};
use crate::wide_tree::{Descent, END_OF_GROUP, Order, Outside, Stack};

/// Finds the closest hit of a ray. Of hits at equal distances, the lower triangle index wins.
///
/// # Errors
/// If the card image is invalid: a record is out of range, or the hierarchy is deeper than the stack.
#[inline(never)]
pub fn closest_hit(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
) -> Result<Option<Hit>, Fault> {
    simd::run(ClosestHit { scene, memory, ray })
}

/// Calls `take` for all hits of a ray, in any order.
///
/// # Errors
/// As [`closest_hit`].
pub fn for_each_hit(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    take: impl FnMut(Hit),
) -> Result<(), Fault> {
    simd::run(EveryHit { scene, memory, ray, take })
}

/// Fraction of a light's radiance that arrives along a ray: the product of the transmittances of the flat
/// glass that the ray hits, 0 if the ray hits anything else.
///
/// # Errors
/// As [`closest_hit`].
#[inline(never)]
pub fn transmittance(scene: &SceneImage, memory: &mut impl MemoryPort, ray: &Ray) -> Result<Vec3, Fault> {
    simd::run(ShadowRay { scene, memory, ray })
}

/// Search of [`closest_hit`], compiled for every instruction set.
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
        let mut nearest = None;
        descend(isa, scene, memory, ray, &mut nearest)?;
        Ok(nearest)
    }
}

/// Search of [`for_each_hit`], compiled for every instruction set.
struct EveryHit<'a, M, F> {
    scene: &'a SceneImage,
    memory: &'a mut M,
    ray: &'a Ray,
    take: F,
}

impl<M: MemoryPort, F: FnMut(Hit)> Kernel for EveryHit<'_, M, F> {
    type Output = Result<(), Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, ray, take } = self;
        descend(isa, scene, memory, ray, &mut Every { take, until: ray.max_distance })
    }
}

/// Search of [`transmittance`], compiled for every instruction set.
pub struct ShadowRay<'a, M> {
    /// The scene.
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// The ray.
    pub ray: &'a Ray,
}

impl<M: MemoryPort> Kernel for ShadowRay<'_, M> {
    type Output = Result<Vec3, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, ray } = self;
        let mut passed = Passed::ALL;
        descend(isa, scene, memory, ray, &mut passed)?;
        Ok(passed.0)
    }
}

/// State of a search along a ray: the closest hit, all hits, or the fraction of light that passes.
pub(super) trait Search {
    /// Order in which a node's children are visited.
    const ORDER: Order;
    /// True if the search continues behind flat glass.
    const PASSES_FLAT_GLASS: bool;

    /// Processes a hit of the triangle in slot `at.1` of the leaf `at.0`. Returns the maximum distance of
    /// further hits, or [`ControlFlow::Break`] if no further hit is needed.
    fn meet(&mut self, hit: Intersection, id: TriangleId, at: (BvhLeaf, usize)) -> ControlFlow<(), f32>;

    /// Processes a hit of flat glass with a given transmittance. Returns [`ControlFlow::Break`] if no further
    /// hit is needed.
    fn pass(&mut self, _transmittance: Vec3) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl Search for Option<Hit> {
    const ORDER: Order = Order::NearestFirst;
    const PASSES_FLAT_GLASS: bool = false;

    #[inline(always)]
    fn meet(
        &mut self,
        found: Intersection,
        id: TriangleId,
        (leaf, slot): (BvhLeaf, usize),
    ) -> ControlFlow<(), f32> {
        let nearest = match self {
            Some(hit) => {
                let distance = hit.intersection.distance;
                if found.distance > distance || found.distance == distance && id > hit.id {
                    return ControlFlow::Continue(distance);
                }
                found.distance
            }
            None => found.distance,
        };
        *self = Some(Hit { intersection: found, triangle: leaf.triangle(slot), id });
        ControlFlow::Continue(nearest)
    }
}

/// Search for all hits up to the distance `until`.
struct Every<F> {
    take: F,
    until: f32,
}

impl<F: FnMut(Hit)> Search for Every<F> {
    const ORDER: Order = Order::Any;
    const PASSES_FLAT_GLASS: bool = false;

    #[inline(always)]
    fn meet(
        &mut self,
        intersection: Intersection,
        id: TriangleId,
        (leaf, slot): (BvhLeaf, usize),
    ) -> ControlFlow<(), f32> {
        (self.take)(Hit { intersection, triangle: leaf.triangle(slot), id });
        ControlFlow::Continue(self.until)
    }
}

/// Fraction of the light that passes along a shadow ray.
///
/// Transmittances are multiplied in the order of traversal, which depends only on the tree and the ray. The
/// product is therefore rounded in the same way in every bundle and on every processor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passed(pub Vec3);

impl Passed {
    /// All light passes.
    pub const ALL: Self = Self(Vec3::ONE);
}

impl Search for Passed {
    const ORDER: Order = Order::Any;
    const PASSES_FLAT_GLASS: bool = true;

    #[inline(always)]
    fn meet(&mut self, _: Intersection, _: TriangleId, _: (BvhLeaf, usize)) -> ControlFlow<(), f32> {
        self.0 = Vec3::ZERO;
        ControlFlow::Break(())
    }

    fn pass(&mut self, transmittance: Vec3) -> ControlFlow<()> {
        self.0 *= transmittance;
        if self.0 == Vec3::ZERO { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Traverses the hierarchy along a ray and passes the hits to `search`.
#[inline(always)]
fn descend<S: Search>(
    isa: impl Isa,
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    search: &mut S,
) -> Result<(), Fault> {
    let frame = RayFrame::new(ray);
    let mut slabs = Slabs::new(ray);
    let mut until = ray.max_distance;
    let mut stack = BvhStack::new();
    let mut descent = Descent::new(scene, SectionKind::Nodes, SectionKind::Triangles, &mut stack);
    let mut group: Option<Group> = None;
    // A group ends with a leaf at the distance 0, which every limit includes.
    while let Some(part) = descent.next(until.to_bits())? {
        match part {
            Child::Node(node) => descent.enter(isa, memory, node, S::ORDER, |line| {
                let children = WideNode(line).children() as usize;
                slabs.enter(isa, BvhNode(line), children, until)
            })?,
            Child::Leaf(END_OF_GROUP) => {
                slabs = Slabs::new(ray);
                leave(&mut group, &mut descent)?;
            }
            Child::Leaf(leaf) => {
                let line = descent.leaf(memory, leaf)?;
                let mut moved = [0; LINE_BYTES];
                let (line, instance) = moved_leaf(line, group.as_ref(), &mut moved);
                let corners = BvhLeaf(line).all_corners();
                let sheared = frame.leaf(isa, BvhLeaf(line), &corners);
                if sheared.may_meet == 0 {
                    // An instance looks like a leaf without triangles.
                    if let Some(instance) = Instance::read(line) {
                        slabs = Slabs::in_group(ray, &instance);
                        enter(&mut group, (leaf, instance), &mut descent, 0)?;
                    }
                    continue;
                }
                // The line is copied, because reading textures of cut-outs borrows the memory too.
                let line = *line;
                let place = (ray, &frame, [leaf, instance]);
                match meet_leaf(scene, memory, place, (BvhLeaf(&line), &sheared), until, search)? {
                    ControlFlow::Continue(distance) => until = distance,
                    ControlFlow::Break(()) => return Ok(()),
                }
            }
        }
    }
    Ok(())
}

/// Group of triangles that a traversal has entered, and its instance.
pub(super) struct Group {
    /// Index of the leaf line that holds the instance.
    index: u32,
    instance: Instance,
    outside: Outside,
}

/// Enters the group of an instance: pushes the group's root onto the stack, with the distance bits `bits`.
///
/// # Errors
/// [`FaultCode::Record`] if the traversal is already in a group; [`FaultCode::Depth`] if the stack overflows.
#[cold]
#[inline(never)]
pub(super) fn enter(
    group: &mut Option<Group>,
    (index, instance): (u32, Instance),
    descent: &mut Descent<STACK>,
    bits: u32,
) -> Result<(), Fault> {
    if group.is_some() {
        return Err(Fault { code: FaultCode::Record, detail: index });
    }
    let outside = descent.begin_group(instance.root, bits)?;
    *group = Some(Group { index, instance, outside });
    Ok(())
}

/// Leaves a group after its last leaf, and continues the traversal around the group.
///
/// # Errors
/// [`FaultCode::Record`] if the card image has a leaf that the traversal takes for the end of a group.
#[cold]
#[inline(never)]
pub(super) fn leave(group: &mut Option<Group>, descent: &mut Descent<STACK>) -> Result<(), Fault> {
    let fault = Fault { code: FaultCode::Record, detail: END_OF_GROUP };
    let Group { outside, .. } = group.take().ok_or(fault)?;
    if descent.end_group(outside) { Ok(()) } else { Err(fault) }
}

/// Returns the leaf `line` in world space, and the index of its instance. In a group, the moved leaf is in
/// `moved`.
#[inline(always)]
pub(super) fn moved_leaf<'l>(
    line: &'l [u8; LINE_BYTES],
    group: Option<&Group>,
    moved: &'l mut [u8; LINE_BYTES],
) -> (&'l [u8; LINE_BYTES], u32) {
    let Some(Group { index, instance, .. }) = group else { return (line, NO_INSTANCE) };
    if BvhLeaf(line).triangles() == 0 {
        return (line, *index);
    }
    place_leaf(line, instance, moved);
    (moved, *index)
}

pub(super) type BvhStack = Stack<STACK>;

/// Capacity of a [`BvhStack`], entries.
pub(super) const STACK: usize = BVH_STACK + LANES;

/// Passes the hits of a ray with a leaf's triangles, up to the distance `until`, to `search`. Returns the new
/// maximum distance, or [`ControlFlow::Break`] if no further hit is needed.
#[inline(always)]
pub(super) fn meet_leaf<S: Search>(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    (ray, frame, [leaf, instance]): (&Ray, &RayFrame, [u32; 2]),
    (line, sheared): (BvhLeaf, &ShearedLeaf),
    mut until: f32,
    search: &mut S,
) -> Result<ControlFlow<(), f32>, Fault> {
    let mut may_meet = sheared.may_meet;
    while may_meet != 0 {
        let slot = may_meet.trailing_zeros() as usize;
        may_meet &= may_meet - 1;
        // The exact test excludes most of the triangles in `may_meet`.
        let Some(intersection) = frame.intersect_slot(sheared, slot, until) else { continue };
        let index = leaf.wrapping_mul(LEAF_TRIANGLES as u32).wrapping_add(slot as u32);
        let (id, weights) = (TriangleId { index, instance }, intersection.barycentric);
        if line.is_cut_out(slot) && !is_met(scene, memory, ray, (id, &line.triangle(slot)), weights)? {
            continue;
        }
        if S::PASSES_FLAT_GLASS && line.is_flat_glass(slot) {
            let transmittance = of_flat_glass(scene, memory, ray, (id, &line.triangle(slot)), weights)?;
            match search.pass(transmittance) {
                ControlFlow::Continue(()) => continue,
                ControlFlow::Break(()) => return Ok(ControlFlow::Break(())),
            }
        }
        match search.meet(intersection, id, (line, slot)) {
            ControlFlow::Continue(distance) => until = distance,
            ControlFlow::Break(()) => return Ok(ControlFlow::Break(())),
        }
    }
    Ok(ControlFlow::Continue(until))
}
