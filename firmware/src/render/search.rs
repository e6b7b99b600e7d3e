//! Photon search for direction tables, and counters of the reflection of photons.

use glam::Vec3;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::Fault;

use super::Context;
use crate::memory::MemoryPort;
use crate::photon::{NearestPhotons, PhotonMap, Reflected, gather};
use crate::scene::PartialReflection;

/// Counts the photon normals that a gather decoded. If the reflection has a lobe, also counts the photons
/// that the gather found.
#[inline(always)]
pub(super) fn count_reflection(
    counters: &mut Counters,
    reflection: &PartialReflection,
    nearest: &NearestPhotons,
    reflected: &Reflected,
) {
    counters.normals_decoded += u64::from(reflected.normals_decoded);
    if !reflection.is_lambertian() {
        counters.photons_reflected += nearest.len() as u64;
        if reflection.is_of_microfacets() {
            counters.photons_on_microfacets += nearest.len() as u64;
        }
    }
}

/// Collects in `nearest` the photons of a map nearest to a position, for a direction table. Returns the
/// number of photons tested.
#[inline(never)]
pub(super) fn search<M: MemoryPort>(
    context: &mut Context<M>,
    map: PhotonMap,
    position: Vec3,
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    gather(context.scene, context.memory, map, position, nearest)
}
