//! Search of a photon map that is a left-balanced kd-tree (Jensen 2001, *Realistic Image Synthesis Using
//! Photon Mapping*, chapter 6). Every node is a photon. The children of node `i` are nodes `2 i + 1` and
//! `2 i + 2`.

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::budget::KD_TREE_LEVELS;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Photon, Record};
use photoncard_shared::message::{Fault, FaultCode};

use super::region::Filter;
use super::{Candidate, NearestPhotons};
use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::simd::Isa;

const PHOTONS_PER_LINE: u32 = Photon::PER_LINE as u32;

/// Stack entry: the root of a subtree, and a lower bound of its squared distance from the query, m^2.
struct Deferred {
    node: u32,
    distance_squared: f32,
}

/// Collects in `nearest` the photons nearest to `position` that `filter` accepts. Returns the number of
/// photons tested, one per visited node.
///
/// # Errors
/// If the card image is invalid.
#[inline(always)]
pub(super) fn gather(
    isa: impl Isa,
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    (position, filter): (Vec3, &impl Filter),
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    let photons = scene.header.section(SectionKind::Photons).records;
    let query = position.to_array();
    let mut deferred: Vec<Deferred, KD_TREE_LEVELS> = Vec::new();
    let mut node = 0;
    let mut tested = 0;
    while node < photons {
        let record =
            scene.record::<{ Photon::BYTES }, PHOTONS_PER_LINE>(memory, SectionKind::Photons, node)?;
        tested += 1;
        let place = Photon::position(record);
        let [x, y, z] = [query[0] - place[0], query[1] - place[1], query[2] - place[2]];
        let distance_squared = x * x + y * y + z * z;
        let offset = match Photon::axis_of_flags(Photon::flags(record)) {
            0 => x,
            1 => y,
            _ => z,
        };
        if distance_squared <= nearest.limit() && filter.takes([x, y, z]) {
            nearest.insert(isa, Candidate::new(distance_squared, Photon::content_without_axis(record)));
        }
        let left = 2 * node + 1;
        let (near, far) = if offset < 0.0 { (left, left + 1) } else { (left + 1, left) };
        let plane_squared = offset * offset;
        if far < photons && plane_squared <= nearest.limit() {
            let put_off = Deferred { node: far, distance_squared: plane_squared };
            deferred.push(put_off).map_err(|_| Fault { code: FaultCode::Depth, detail: node })?;
        }
        node = near;
        while node >= photons {
            match deferred.pop() {
                Some(next) if next.distance_squared <= nearest.limit() => node = next.node,
                Some(_) => {}
                None => break,
            }
        }
    }
    Ok(tested)
}
