//! The search of a photon map for points that the eye sees.

use glam::Vec3;
use photoncard_shared::message::Fault;

use super::Context;
use crate::memory::MemoryPort;
use crate::photon::{NearestPhotons, PhotonMap, gather};

/// The photons of a map nearest to a place, as many as `nearest` looks for: for gathers at the points that the eye sees. They are
/// few, and have the code in common.
#[inline(never)]
pub(super) fn search<M: MemoryPort>(
    context: &mut Context<M>,
    map: PhotonMap,
    position: Vec3,
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    gather(context.scene, context.memory, map, position, nearest)
}
