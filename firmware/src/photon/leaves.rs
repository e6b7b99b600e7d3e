//! The photon map in lines: photons in leaves that fill a line each, inner nodes in treelets of a line.
//!
//! A kd-tree like [`super::kdtree`], but a visit of a leaf tests ten photons of one line, where a visit of a node there tests
//! one of a line that is mostly other nodes. The distance to a subtree is that to its part of space, kept coordinate by
//! coordinate (Arya, Mount 1993, *Algorithms for fast vector quantization*), and not to the last plane alone.

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::PHOTON_STACK;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{
    PHOTON_CONTENT_BYTES, PhotonChild, PhotonLeaf, PhotonTreelet, TREELET_NODES,
};
use photoncard_shared::message::{Fault, FaultCode};

use super::{Candidate, NearestPhotons};
use crate::memory::MemoryPort;
use crate::scene::SceneImage;

/// A part of the tree.
#[derive(Clone, Copy)]
enum Part {
    /// A node of a treelet.
    Node(u32, u8),
    Leaf(u32),
}

impl Part {
    fn new(child: PhotonChild, treelet: u32) -> Self {
        match child {
            PhotonChild::Node(node) => Self::Node(treelet, node),
            PhotonChild::Leaf(leaf) => Self::Leaf(leaf),
            PhotonChild::Treelet(treelet) => Self::Node(treelet, 0),
        }
    }
}

/// A part of the tree put off, and how far its part of space is off, coordinate by coordinate.
#[derive(Clone, Copy)]
struct Deferred {
    part: Part,
    offset: [f32; 3],
}

impl Deferred {
    /// A lower bound of the squared distance of all its photons, rounded as theirs is.
    #[inline(always)]
    fn distance_squared(&self) -> f32 {
        let [x, y, z] = self.offset;
        x * x + y * y + z * z
    }
}

/// Searches the photons nearest to `position` into `nearest`. Returns the number of photons tested.
///
/// # Errors
/// If the image is not sound.
#[inline(always)]
pub(super) fn gather(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    position: Vec3,
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    let [treelets, leaves] = [SectionKind::PhotonTreelets, SectionKind::PhotonLeaves]
        .map(|kind| scene.header.section(kind).records);
    let query = position.to_array();
    let mut deferred: Vec<Deferred, PHOTON_STACK> = Vec::new();
    let root = if treelets > 0 { Part::Node(0, 0) } else { Part::Leaf(0) };
    let mut next = (leaves > 0).then_some(Deferred { part: root, offset: [0.0; 3] });
    // A tree's part is visited once: more visits tell of a cycle in an unsound image.
    let mut visits_left = treelets as u64 * TREELET_NODES as u64 + leaves as u64;
    let mut tested = 0;
    while let Some(visited) = next {
        if visited.distance_squared() > nearest.limit() {
            next = deferred.pop();
            continue;
        }
        match visited.part {
            Part::Leaf(leaf) => {
                tested += test_leaf(scene, memory, query, leaf, nearest)?;
                next = deferred.pop();
            }
            Part::Node(treelet, node) => {
                let depth = Fault { code: FaultCode::Depth, detail: treelet };
                visits_left = visits_left.checked_sub(1).ok_or(depth)?;
                let [near, far] = divide(scene, memory, query, visited.offset, treelet, node)?;
                if far.distance_squared() <= nearest.limit() {
                    deferred.push(far).map_err(|_| depth)?;
                }
                next = Some(near);
            }
        }
    }
    Ok(tested)
}

/// The two sides of a node's plane: that of the query, and the other.
#[inline(always)]
fn divide(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    query: [f32; 3],
    offset: [f32; 3],
    treelet: u32,
    node: u8,
) -> Result<[Deferred; 2], Fault> {
    let first = node as u32 * PhotonTreelet::NODE_BYTES;
    let line =
        scene.line(memory, SectionKind::PhotonTreelets, treelet, first..first + PhotonTreelet::NODE_BYTES)?;
    let depth = Fault { code: FaultCode::Depth, detail: treelet };
    let node = PhotonTreelet(line).node(node).ok_or(depth)?;
    let plane = scene.header.photon_grid.coordinate(node.axis, node.plane);
    let mut far_offset = offset;
    let [x, y, z] = &mut far_offset;
    let (coordinate, offset_there) = match node.axis {
        0 => (query[0], x),
        1 => (query[1], y),
        _ => (query[2], z),
    };
    let to_plane = coordinate - plane;
    *offset_there = to_plane;
    let [below, above] = node.children.map(|child| Part::new(child, treelet));
    let (near, far) = if to_plane < 0.0 { (below, above) } else { (above, below) };
    Ok([Deferred { part: near, offset }, Deferred { part: far, offset: far_offset }])
}

/// Tests the photons of a leaf. Returns how many there are.
#[inline(always)]
fn test_leaf(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    query: [f32; 3],
    index: u32,
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    let line = scene.line(memory, SectionKind::PhotonLeaves, index, 0..LINE_BYTES as u32)?;
    let leaf = PhotonLeaf::read(line);
    for photon in 0..leaf.photons() {
        let place = scene.header.photon_grid.position(leaf.point(photon));
        let [x, y, z] = [query[0] - place[0], query[1] - place[1], query[2] - place[2]];
        let distance_squared = x * x + y * y + z * z;
        if distance_squared <= nearest.limit() {
            let content: [u8; PHOTON_CONTENT_BYTES] = leaf.content(photon);
            nearest.insert(Candidate::new(distance_squared, content));
        }
    }
    Ok(leaf.photons())
}
