//! Interface between the search of a photon tree and the collector of the photons found.

use photoncard_shared::layout::PhotonNode;

use crate::simd::{Isa, LANES};

/// Collector of the photons or irradiance points that a search finds. It also sets the search radius.
pub(super) trait Collector {
    /// Squared search radius, m^2.
    fn limit(&self) -> f32;

    /// Narrows the search radius to the estimate `r` of a visited node, where `photon_share` is `r^2 / k`,
    /// m^2 ([`PhotonNode::photon_share`]). Only collectors whose search can be repeated with a larger radius
    /// implement this.
    #[inline(always)]
    fn narrow(&mut self, _photon_share: f32) {}

    /// Bit mask of the children of a node that the search need not visit.
    #[inline(always)]
    fn skipped(&self, _node: PhotonNode) -> u16 {
        0
    }

    /// Tests the photons in the first `count` lanes, and adds those that belong to the result: photons within
    /// [`Self::limit`], or photons whose disc contains the query.
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, lanes: &Lanes);
}

/// Photons of a leaf, one in each lane.
pub(super) struct Lanes<'a> {
    /// Bits of the squared distances, m^2.
    pub(super) distances: &'a [u32; LANES],
    /// Contents of the photons, as little-endian numbers.
    pub(super) contents: &'a [u64; LANES],
    /// Vectors from the photons to the query, by axis, metres.
    pub(super) ways: [&'a [f32; LANES]; 3],
}
