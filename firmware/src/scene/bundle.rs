//! Bundles of rays: up to sixteen rays traverse the bounding volume hierarchy together (compare Barringer,
//! Akenine-Möller 2014, *Dynamic ray stream traversal*). A line of memory is thus fetched once for all rays
//! that need it. Each ray requests the line separately. The number of requests thus equals that of single
//! rays, and every request but the first is a cache hit.
//!
//! Tests of boxes and triangles use the same operations as for a single ray ([`super::bvh`]). A ray's hit is
//! therefore the same, bit for bit, in every bundle.

use core::ops::ControlFlow;

use heapless::Vec;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhLeaf, BvhNode, Child, Instance, WideNode};
use photoncard_shared::message::{Fault, Invariant};

use super::bvh::{BvhStack, Passed, Search, closest_hit, enter, leave, meet_leaf, moved_leaf, transmittance};
use super::slabs::Slabs;
use super::{Hit, Ray, RayFrame, SceneImage};
use crate::memory::MemoryPort;
use crate::simd::{self, Isa, Kernel, LANES};
use crate::wide_tree::{BEYOND, Descent, END_OF_GROUP, Order};

/// Maximum number of rays of a bundle.
pub const BUNDLE_RAYS: usize = LANES;

/// Mask of the ray bits in the 32 bits that are pushed onto the stack with a child. The lower 16 bits are a
/// set of rays, one bit per ray of the bundle. The upper 16 bits are the upper half of an `f32`: the least
/// distance at which one of these rays enters the child's box.
const RAYS: u32 = (1 << BUNDLE_RAYS) - 1;

/// Finds the [`closest_hit`] of each of up to [`BUNDLE_RAYS`] rays. Hits are written into `hits`, which must
/// hold `None` before; returning them would copy a kilobyte.
///
/// # Errors
/// As [`closest_hit`].
pub fn closest_hits(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    rays: &[Ray],
    hits: &mut [Option<Hit>; BUNDLE_RAYS],
) -> Result<(), Fault> {
    match (rays, &mut *hits) {
        ([], _) => Ok(()),
        ([ray], [hit, ..]) => {
            *hit = closest_hit(scene, memory, ray)?;
            Ok(())
        }
        _ => cast(Bundle { scene, memory, rays, searches: hits }),
    }
}

/// Finds the [`transmittance`] along each of up to [`BUNDLE_RAYS`] rays.
///
/// # Errors
/// As [`closest_hit`].
pub fn transmittances(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    rays: &[Ray],
) -> Result<[Passed; BUNDLE_RAYS], Fault> {
    let mut searches = [Passed::ALL; BUNDLE_RAYS];
    match (rays, &mut searches) {
        ([], _) => {}
        ([ray], [passed, ..]) => *passed = Passed(transmittance(scene, memory, ray)?),
        (_, searches) => cast(Bundle { scene, memory, rays, searches })?,
    }
    Ok(searches)
}

/// Traversal of [`closest_hits`] (`S` is `Option<Hit>`) and of [`transmittances`] (`S` is [`Passed`]),
/// compiled for every instruction set.
pub struct Bundle<'a, M, S> {
    /// The scene.
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// Rays of the bundle, at most [`BUNDLE_RAYS`].
    pub rays: &'a [Ray],
    /// Result of each ray. The caller sets each to `None` or [`Passed::ALL`] at first.
    pub searches: &'a mut [S; BUNDLE_RAYS],
}

/// Runs a kernel in a stack frame of its own, so that a single ray needs no stack for a bundle.
#[inline(never)]
fn cast<M: MemoryPort, S: Search>(bundle: Bundle<M, S>) -> Result<(), Fault> {
    if bundle.rays.len() > BUNDLE_RAYS {
        return Err(Invariant::Bundle.fault());
    }
    simd::run(bundle)
}

/// A ray of a bundle, with its data for tests of boxes and triangles.
struct Way<'a> {
    ray: &'a Ray,
    frame: RayFrame,
    slabs: Slabs,
}

/// State of a bundle's traversal.
struct Rays<'a, S> {
    ways: Vec<Way<'a>, BUNDLE_RAYS>,
    /// Maximum distance at which each ray still needs hits, metres, as `f32` bits.
    until: [u32; BUNDLE_RAYS],
    searches: &'a mut [S; BUNDLE_RAYS],
}

/// Clears the lowest set bit of `rays` and returns its index; `None` if no bit is set.
#[inline(always)]
fn take(rays: &mut u32) -> Option<usize> {
    let index = rays.trailing_zeros();
    *rays &= rays.wrapping_sub(1);
    (index < u32::BITS).then_some(index as usize)
}

impl<M: MemoryPort, S: Search> Kernel for Bundle<'_, M, S> {
    type Output = Result<(), Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, rays, searches } = self;
        let mut rays = Rays::new(rays, searches);
        let mut waiting = RAYS & !(u32::MAX << rays.ways.len());
        let mut stack = BvhStack::new();
        let sections = [SectionKind::Nodes, SectionKind::Triangles];
        let mut descent = Descent::with_root(scene, sections, &mut stack, waiting);
        let mut group = None;
        while waiting != 0
            && let Some((bits, child)) = descent.pop()?
        {
            let here = rays.within(isa, bits) & waiting;
            // Each ray requests the line once; the first ray's request is the read below.
            let others = 1..here.count_ones();
            match child {
                Child::Leaf(END_OF_GROUP) => {
                    rays.set_space(None);
                    leave(&mut group, &mut descent)?;
                }
                _ if here == 0 => {}
                Child::Node(node) => {
                    for _ in others {
                        scene.line(memory, SectionKind::Nodes, node, 0..LINE_BYTES as u32)?;
                    }
                    descent
                        .enter(isa, memory, node, S::ORDER, |line| rays.enter(isa, BvhNode(line), here))?;
                }
                Child::Leaf(leaf) => {
                    for _ in others {
                        descent.leaf(memory, leaf)?;
                    }
                    let mut moved = [0; LINE_BYTES];
                    let (line, instance) =
                        moved_leaf(descent.leaf(memory, leaf)?, group.as_ref(), &mut moved);
                    let line = *line;
                    match Instance::read(&line) {
                        None => {
                            waiting &= !rays.meet(isa, (scene, memory), ([leaf, instance], &line), here)?;
                        }
                        Some(instance) => {
                            rays.set_space(Some(&instance));
                            enter(&mut group, (leaf, instance), &mut descent, here)?;
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

impl<'a, S: Search> Rays<'a, S> {
    #[inline(always)]
    fn new(rays: &'a [Ray], searches: &'a mut [S; BUNDLE_RAYS]) -> Self {
        let mut ways = Vec::new();
        let mut until = [0; BUNDLE_RAYS];
        for (ray, until) in rays.iter().zip(&mut until) {
            *until = ray.max_distance.to_bits();
            // There is room for a bundle.
            let _ = ways.push(Way { ray, frame: RayFrame::new(ray), slabs: Slabs::new(ray) });
        }
        Self { ways, until, searches }
    }

    /// Returns those rays in `bits` (see `RAYS`) that may still have a hit in the child pushed with `bits`.
    /// In nearest-first order, this excludes rays whose maximum distance is below the distance in `bits`.
    #[inline(always)]
    fn within(&self, isa: impl Isa, bits: u32) -> u32 {
        match S::ORDER {
            Order::NearestFirst => bits & RAYS & !isa.below(&self.until, bits & !RAYS),
            Order::Any => bits & RAYS,
        }
    }

    /// Tests the rays `here` against the boxes of a node's children. Returns the bits to push with each child
    /// (see `RAYS`): the rays that enter its box, and their least distance; `BEYOND` if no ray enters it.
    #[inline(always)]
    fn enter(&self, isa: impl Isa, node: BvhNode, mut here: u32) -> [u32; LANES] {
        let children = WideNode(node.0).children() as usize;
        let mut entered = [0; LANES];
        let mut nearest = [BEYOND; LANES];
        while let Some(index) = take(&mut here) {
            // Always there: only bits of rays in the bundle are set.
            let (Some(way), Some(&until)) = (self.ways.get(index), self.until.get(index)) else { continue };
            let distances = way.slabs.enter(isa, node, children, f32::from_bits(until));
            let lanes = entered.iter_mut().zip(&mut nearest).zip(distances);
            for ((entered, nearest), distance) in lanes.take(isa.lanes(children)) {
                *entered |= if distance == BEYOND { 0 } else { 1 << index };
                *nearest = distance.min(*nearest);
            }
        }
        let mut bits = [BEYOND; LANES];
        let lanes = bits.iter_mut().zip(entered).zip(nearest);
        for ((bits, rays), nearest) in lanes.take(isa.lanes(children)) {
            let distance = if S::ORDER == Order::NearestFirst { nearest & !RAYS } else { 0 };
            *bits = if rays == 0 { BEYOND } else { distance | rays };
        }
        bits
    }

    /// Prepares the rays for boxes in the space of an instance's group, or in world space.
    #[cold]
    #[inline(never)]
    fn set_space(&mut self, instance: Option<&Instance>) {
        for way in &mut self.ways {
            way.slabs = match instance {
                Some(instance) => Slabs::in_group(way.ray, instance),
                None => Slabs::new(way.ray),
            };
        }
    }

    /// Finds the hits of the rays `here` with the triangles of the leaf `line`. `place` has the indices of
    /// the leaf and of its instance. Returns the set of rays that need no further hit.
    #[inline(always)]
    fn meet<M: MemoryPort>(
        &mut self,
        isa: impl Isa,
        (scene, memory): (&SceneImage, &mut M),
        (place, line): ([u32; 2], &[u8; LINE_BYTES]),
        mut here: u32,
    ) -> Result<u32, Fault> {
        let line = BvhLeaf(line);
        let corners = line.all_corners();
        let mut done = 0;
        while let Some(index) = take(&mut here) {
            let Self { ways, until, searches } = self;
            // Always there, as in `enter`.
            let (Some(way), Some(until), Some(search)) =
                (ways.get(index), until.get_mut(index), searches.get_mut(index))
            else {
                continue;
            };
            let sheared = way.frame.leaf(isa, line, &corners);
            if sheared.may_meet == 0 {
                continue;
            }
            let place = (way.ray, &way.frame, place);
            let limit = f32::from_bits(*until);
            match meet_leaf(scene, memory, place, (line, &sheared), limit, search)? {
                ControlFlow::Continue(distance) => *until = distance.to_bits(),
                ControlFlow::Break(()) => done |= 1 << index,
            }
        }
        Ok(done)
    }
}
