//! Photon search at points that the eye sees.

use glam::Vec3;
use photoncard_shared::message::Fault;

use super::Context;
use crate::memory::MemoryPort;
use crate::photon::{NearestPhotons, PhotonMap, gather};

/// Collects the photons of a map nearest to a position in `nearest`, for direction tables and caustics. These searches are few and share
/// one copy of the code, unlike gathers at the ends of rays.
#[inline(never)]
pub(super) fn search<M: MemoryPort>(
    context: &mut Context<M>,
    map: PhotonMap,
    position: Vec3,
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    gather(context.scene, context.memory, map, position, nearest)
}
