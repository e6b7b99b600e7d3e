//! Search of a photon map that is a tree with leaves. An inner node has up to sixteen children; nodes and
//! leaves take one line of memory each.

use glam::Vec3;
use photoncard_shared::budget::PHOTON_STACK;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{
    Child, LEAF_LANES, LeafCoordinates, NodeCoordinates, PhotonGrid, PhotonLeaf, PhotonNode, WideNode,
};
use photoncard_shared::message::Fault;

use super::collector::{Collector, Lanes};
use super::region::Filter;
use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::simd::{Isa, LANES};
use crate::wide_tree::{BEYOND, Descent, Order, Stack};

const _: () = assert!(LEAF_LANES == LANES);

/// Collects in `nearest` the photons or irradiance points near `position` that `filter` accepts. The tree's
/// nodes and leaves are in the two given sections. Returns the number of photons tested.
///
/// # Errors
/// If the card image is invalid.
#[inline(always)]
pub(super) fn gather(
    isa: impl Isa,
    scene: &SceneImage,
    [nodes, leaves]: [SectionKind; 2],
    memory: &mut impl MemoryPort,
    (position, filter): (Vec3, &impl Filter),
    nearest: &mut impl Collector,
) -> Result<u32, Fault> {
    let query = position.to_array();
    let grid = &scene.header.photon_grid;
    let mut stack = Stack::<{ PHOTON_STACK + LANES }>::new();
    let mut descent = Descent::new(scene, nodes, leaves, &mut stack);
    let mut tested = 0;
    while let Some(part) = descent.next(nearest.limit().to_bits())? {
        match part {
            Child::Leaf(leaf) => {
                let line = descent.leaf(memory, leaf)?;
                tested += test_leaf(isa, grid, PhotonLeaf::read(line), (query, filter), nearest);
            }
            Child::Node(node) => descent.enter(isa, memory, node, Order::NearestFirst, |line| {
                let line = PhotonNode(line);
                nearest.narrow(line.photon_share());
                let mut distances = distances_to_boxes(isa, grid, line, query, nearest.limit());
                let skipped = nearest.skipped(line);
                for (lane, distance) in distances.iter_mut().enumerate() {
                    if skipped >> lane & 1 != 0 {
                        *distance = BEYOND;
                    }
                }
                distances
            })?,
        }
    }
    Ok(tested)
}

/// Squared distances to the boxes of a node's children, as bits; [`BEYOND`] for those above `limit`. They are
/// computed like distances to photons, so that they are lower bounds in spite of rounding.
#[inline(always)]
fn distances_to_boxes(
    isa: impl Isa,
    grid: &PhotonGrid,
    node: PhotonNode,
    query: [f32; 3],
    limit: f32,
) -> [u32; LANES] {
    let [x, y, z] = node.coordinates();
    let [a, b, c] = grid.origin;
    let [p, q, r] = query;
    let mut distances = [0; LANES];
    for lane in 0..isa.lanes(WideNode(node.0).children() as usize) {
        let to_box = |axis: &NodeCoordinates, origin: i32, query: f32| {
            let side = |sides: &[u8; LANES]| {
                let side = u32::from(sides.get(lane).copied().unwrap_or(0)) << axis.exponent;
                // Wraps in unsound card images only.
                (origin.wrapping_add((axis.corner + side).cast_signed())) as f32 * grid.cell
            };
            let (below, above) = (side(axis.lower) - query, query - side(axis.upper));
            let outside = if below > above { below } else { above };
            if outside > 0.0 { outside } else { 0.0 }
        };
        let [x, y, z] = [to_box(&x, a, p), to_box(&y, b, q), to_box(&z, c, r)];
        if let Some(distance) = distances.get_mut(lane) {
            let squared = x * x + y * y + z * z;
            *distance = if squared <= limit { squared.to_bits() } else { BEYOND };
        }
    }
    distances
}

/// Hands a leaf's photons that `filter` accepts to `nearest`. Returns the number of photons in the leaf.
#[inline(always)]
fn test_leaf(
    isa: impl Isa,
    grid: &PhotonGrid,
    leaf: PhotonLeaf,
    (query, filter): ([f32; 3], &impl Filter),
    nearest: &mut impl Collector,
) -> u32 {
    let photons = leaf.photons();
    let [x, y, z] = leaf.coordinates();
    let [a, b, c] = grid.origin;
    let [p, q, r] = query;
    let mut distances = [0; LANES];
    let [mut along_x, mut along_y, mut along_z] = [[0.0; LANES]; 3];
    for lane in 0..isa.lanes(photons as usize) {
        let to_photon = |axis: &LeafCoordinates, origin: i32, query: f32| {
            let offset = u16::from_le_bytes(axis.offsets.get(lane).copied().unwrap_or_default()) & axis.mask;
            let point = axis.corner + u32::from(offset);
            query - origin.wrapping_add(point.cast_signed()) as f32 * grid.cell
        };
        let [x, y, z] = [to_photon(&x, a, p), to_photon(&y, b, q), to_photon(&z, c, r)];
        if let Some(distance) = distances.get_mut(lane) {
            *distance = (x * x + y * y + z * z).to_bits();
        }
        for (ways, way) in [(&mut along_x, x), (&mut along_y, y), (&mut along_z, z)] {
            if let Some(target) = ways.get_mut(lane) {
                *target = way;
            }
        }
    }
    let ways = [&along_x, &along_y, &along_z];
    filter.filter(isa, ways, &mut distances);
    let mut contents = [0; LANES];
    for (content, bytes) in contents.iter_mut().zip(leaf.contents().iter().rev()) {
        *content = u64::from_le_bytes(*bytes);
    }
    nearest.insert_lanes(isa, photons, &Lanes { distances: &distances, contents: &contents, ways });
    photons
}
