//! Bundles of rays: up to sixteen go through the hierarchy together, so that a line comes once for all rays that meet it (compare
//! Barringer, Akenine-Möller 2014, *Dynamic ray stream traversal*). Each of them requests it, so that requests are those of work, as of rays alone;
//! all but the first find it in any cache.
//!
//! Each ray is tested against each box and triangle by the operations of a ray alone ([`super::bvh`]): the hits are equal bit for bit,
//! whatever the rays beside it.

use core::ops::ControlFlow;

use heapless::Vec;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhLeaf, BvhNode, Child, WideNode};
use photoncard_shared::message::Fault;

use super::bvh::{BvhStack, Search, closest_hit, is_occluded, meet_leaf};
use super::slabs::Slabs;
use super::{Hit, Ray, RayFrame, SceneImage};
use crate::memory::MemoryPort;
use crate::simd::{self, Isa, Kernel, LANES};
use crate::wide_tree::{BEYOND, Descent, Order};

/// Maximum number of rays of a bundle.
pub const BUNDLE_RAYS: usize = LANES;

/// A bit for each ray of a bundle: the lower half of the bits that are pushed with a child. The upper half is that of the least of
/// the rays' distances, rounded down.
const RAYS: u32 = (1 << BUNDLE_RAYS) - 1;

/// [`closest_hit`] of each of up to [`BUNDLE_RAYS`] rays, put into `hits`, which are `None`: in place, as they are a kilobyte.
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

/// [`is_occluded`] of each of up to [`BUNDLE_RAYS`] rays.
///
/// # Errors
/// As [`closest_hit`].
pub fn are_occluded(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    rays: &[Ray],
) -> Result<[bool; BUNDLE_RAYS], Fault> {
    let mut searches = [false; BUNDLE_RAYS];
    match (rays, &mut searches) {
        ([], _) => {}
        ([ray], [occluded, ..]) => *occluded = is_occluded(scene, memory, ray)?,
        (_, searches) => cast(Bundle { scene, memory, rays, searches })?,
    }
    Ok(searches)
}

/// Kernel of [`closest_hits`] with searches of the type `Option<Hit>`, of [`are_occluded`] with `bool`.
pub struct Bundle<'a, M, S> {
    /// The scene.
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// The rays; those beyond [`BUNDLE_RAYS`] are ignored.
    pub rays: &'a [Ray],
    /// The result of each ray, nothing found.
    pub searches: &'a mut [S; BUNDLE_RAYS],
}

/// Runs a kernel, in a frame of its own: a ray alone needs no room on the stack for a bundle.
#[inline(never)]
fn cast<M: MemoryPort, S: Search>(bundle: Bundle<M, S>) -> Result<(), Fault> {
    simd::run(bundle)
}

/// A ray of a bundle.
struct Way<'a> {
    ray: &'a Ray,
    frame: RayFrame,
    slabs: Slabs,
}

impl<M: MemoryPort, S: Search> Kernel for Bundle<'_, M, S> {
    type Output = Result<(), Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, rays, searches } = self;
        let mut ways = Vec::<Way, BUNDLE_RAYS>::new();
        // Bits of the maximum distance of each ray.
        let mut until = [0; BUNDLE_RAYS];
        for (ray, until) in rays.iter().zip(&mut until) {
            *until = ray.max_distance.to_bits();
            let _ = ways.push(Way { ray, frame: RayFrame::new(ray), slabs: Slabs::new(ray) });
        }
        let mut waiting = RAYS & !(u32::MAX << ways.len());
        let mut stack = BvhStack::new();
        let sections = [SectionKind::Nodes, SectionKind::Triangles];
        let mut descent = Descent::with_root(scene, sections, &mut stack, waiting);
        while let Some((bits, child)) = descent.pop()? {
            let mut here = bits & waiting;
            if S::ORDER == Order::NearestFirst {
                here &= !isa.below(&until, bits & !RAYS);
            }
            if here == 0 {
                continue;
            }
            match child {
                Child::Node(node) => {
                    for _ in 1..here.count_ones() {
                        scene.line(memory, SectionKind::Nodes, node, 0..LINE_BYTES as u32)?;
                    }
                    descent.enter(isa, memory, node, S::ORDER, |line| {
                        enter(isa, BvhNode(line), &ways, here, &until, S::ORDER)
                    })?;
                }
                Child::Leaf(leaf) => {
                    for _ in 1..here.count_ones() {
                        descent.leaf(memory, leaf)?;
                    }
                    let line = *descent.leaf(memory, leaf)?;
                    let line = BvhLeaf(&line);
                    let corners = line.all_corners();
                    while here != 0 {
                        let index = here.trailing_zeros() as usize;
                        here &= here - 1;
                        let (Some(way), Some(until), Some(search)) =
                            (ways.get(index), until.get_mut(index), searches.get_mut(index))
                        else {
                            continue;
                        };
                        let sheared = way.frame.leaf(isa, line, &corners);
                        if sheared.may_meet == 0 {
                            continue;
                        }
                        let place = (way.ray, &way.frame, leaf);
                        let limit = f32::from_bits(*until);
                        match meet_leaf(scene, memory, place, (line, &sheared), limit, search)? {
                            ControlFlow::Continue(distance) => *until = distance.to_bits(),
                            ControlFlow::Break(()) => waiting &= !(1 << index),
                        }
                    }
                    if waiting == 0 {
                        break;
                    }
                }
            }
        }
        Ok(())
    }
}

/// The bits to push with each child of a node: the rays of `here` that enter its box, and the least distance at which one does.
#[inline(always)]
fn enter(
    isa: impl Isa,
    node: BvhNode,
    ways: &[Way],
    mut here: u32,
    until: &[u32; BUNDLE_RAYS],
    order: Order,
) -> [u32; LANES] {
    let children = WideNode(node.0).children() as usize;
    let mut entered = [0; LANES];
    let mut nearest = [BEYOND; LANES];
    while here != 0 {
        let index = here.trailing_zeros() as usize;
        let ray = here & here.wrapping_neg();
        here &= here - 1;
        let (Some(way), Some(&until)) = (ways.get(index), until.get(index)) else { continue };
        let distances = way.slabs.enter(isa, node, children, f32::from_bits(until));
        let lanes = entered.iter_mut().zip(&mut nearest).zip(distances);
        for ((entered, nearest), distance) in lanes.take(isa.lanes(children)) {
            *entered |= if distance == BEYOND { 0 } else { ray };
            *nearest = distance.min(*nearest);
        }
    }
    let mut bits = [BEYOND; LANES];
    let lanes = bits.iter_mut().zip(entered).zip(nearest);
    for ((bits, rays), nearest) in lanes.take(isa.lanes(children)) {
        let distance = if order == Order::NearestFirst { nearest & !RAYS } else { 0 };
        *bits = if rays == 0 { BEYOND } else { distance | rays };
    }
    bits
}
