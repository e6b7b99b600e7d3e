//! Interface between a search of leaves and its result, which has the photons found and the search radius.

use crate::simd::{Isa, LANES};

/// Collector of the nearest photons or irradiance points, which limits the search radius.
pub(super) trait Collector {
    /// Squared search radius, m^2.
    fn limit(&self) -> f32;

    /// Narrows the search at the first node with a [`PhotonNode::photon_share`], if the search can be
    /// repeated with a larger radius.
    ///
    /// [`PhotonNode::photon_share`]: photoncard_shared::layout::PhotonNode::photon_share
    #[inline(always)]
    fn narrow(&mut self, _photon_share: f32) {}

    /// Adds the photons in the first `count` lanes that are within the limit. Lanes hold bits of squared
    /// distances, and contents.
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, distances: &[u32; LANES], contents: &[u64; LANES]);
}
