//! Traversal of the bounding volume hierarchy by single rays. A node has up to sixteen children, a leaf up to
//! eight triangles; each takes one line of memory.

use core::ops::ControlFlow;

use glam::Vec3;
use photoncard_shared::budget::BVH_STACK;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhLeaf, BvhNode, Child, LEAF_TRIANGLES, Triangle, WideNode};
use photoncard_shared::message::Fault;

use super::coverage::is_met;
use super::flat_glass::of_flat_glass;
use super::slabs::Slabs;
use super::triangle::ShearedLeaf;
use super::{Hit, Intersection, Ray, RayFrame, SceneImage};
use crate::memory::MemoryPort;
use crate::simd::{self, Isa, Kernel, LANES};
use crate::wide_tree::{Descent, Order, Stack};

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

/// Fraction of a light's radiance that arrives along a shadow ray, by channel: the product of the
/// transmittances of all flat glass on the ray; 0 if the ray hits any other surface.
///
/// # Errors
/// As [`closest_hit`].
#[inline(never)]
pub fn transmittance(scene: &SceneImage, memory: &mut impl MemoryPort, ray: &Ray) -> Result<Vec3, Fault> {
    simd::run(ShadowRay { scene, memory, ray })
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
        let mut nearest = None;
        descend(isa, scene, memory, ray, &mut nearest)?;
        Ok(nearest)
    }
}

/// Kernel of [`transmittance`].
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

/// Result of a ray so far: the closest hit, or for a shadow ray the fraction of light that passes.
pub(super) trait Search {
    /// Order in which a node's children are visited.
    const ORDER: Order;
    /// True if the search continues behind flat glass.
    const PASSES_FLAT_GLASS: bool;

    /// Processes a hit of triangle `index`, which is in slot `at.1` of the leaf `at.0`. Returns the maximum
    /// distance at which further hits are needed, metres, or [`ControlFlow::Break`] if none is needed.
    fn meet(&mut self, hit: Intersection, index: u32, at: (BvhLeaf, usize)) -> ControlFlow<(), f32>;

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
        index: u32,
        (leaf, slot): (BvhLeaf, usize),
    ) -> ControlFlow<(), f32> {
        let nearest = match self {
            Some(hit) => {
                let distance = hit.intersection.distance;
                if found.distance > distance || found.distance == distance && index > hit.index {
                    return ControlFlow::Continue(distance);
                }
                found.distance
            }
            None => found.distance,
        };
        *self = Some(Hit { intersection: found, triangle: leaf.triangle(slot), index });
        ControlFlow::Continue(nearest)
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
    fn meet(&mut self, _: Intersection, _: u32, _: (BvhLeaf, usize)) -> ControlFlow<(), f32> {
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
    let slabs = Slabs::new(ray);
    let mut until = ray.max_distance;
    let mut stack = BvhStack::new();
    let mut descent = Descent::new(scene, SectionKind::Nodes, SectionKind::Triangles, &mut stack);
    while let Some(part) = descent.next(until.to_bits())? {
        match part {
            Child::Node(node) => descent.enter(isa, memory, node, S::ORDER, |line| {
                let children = WideNode(line).children() as usize;
                slabs.enter(isa, BvhNode(line), children, until)
            })?,
            Child::Leaf(leaf) => {
                let line = descent.leaf(memory, leaf)?;
                let corners = BvhLeaf(line).all_corners();
                let sheared = frame.leaf(isa, BvhLeaf(line), &corners);
                if sheared.may_meet == 0 {
                    continue;
                }
                // The line is copied, because reading textures of cut-outs borrows the memory too.
                let line = *line;
                let place = (ray, &frame, leaf);
                match meet_leaf(scene, memory, place, (BvhLeaf(&line), &sheared), until, search)? {
                    ControlFlow::Continue(distance) => until = distance,
                    ControlFlow::Break(()) => return Ok(()),
                }
            }
        }
    }
    Ok(())
}

pub(super) type BvhStack = Stack<{ BVH_STACK + LANES }>;

/// Passes the hits of a ray with a leaf's triangles, up to the distance `until`, to `search`. Returns the new
/// maximum distance, or [`ControlFlow::Break`] if no further hit is needed.
#[inline(always)]
pub(super) fn meet_leaf<S: Search>(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    (ray, frame, leaf): (&Ray, &RayFrame, u32),
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
        let weights = intersection.barycentric;
        if line.is_cut_out(slot) && !is_met(scene, memory, ray, (index, &line.triangle(slot)), weights)? {
            continue;
        }
        if S::PASSES_FLAT_GLASS && line.is_flat_glass(slot) {
            let transmittance = of_flat_glass(scene, memory, ray, (index, &line.triangle(slot)), weights)?;
            match search.pass(transmittance) {
                ControlFlow::Continue(()) => continue,
                ControlFlow::Break(()) => return Ok(ControlFlow::Break(())),
            }
        }
        match search.meet(intersection, index, (line, slot)) {
            ControlFlow::Continue(distance) => until = distance,
            ControlFlow::Break(()) => return Ok(ControlFlow::Break(())),
        }
    }
    Ok(ControlFlow::Continue(until))
}

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
