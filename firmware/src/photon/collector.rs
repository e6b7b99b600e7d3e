//! Interface between a search of leaves and the collector of its photons, which sets the search radius.

use photoncard_shared::layout::PhotonNode;

use crate::simd::{Isa, LANES};

/// Collector of the photons or irradiance points that a search finds. It limits the search radius.
pub(super) trait Collector {
    /// Squared search radius, m^2.
    fn limit(&self) -> f32;

    /// Narrows the search at the first node with a [`PhotonNode::photon_share`], if the search can be
    /// repeated with a larger radius.
    #[inline(always)]
    fn narrow(&mut self, _photon_share: f32) {}

    /// Bit mask of those children of a node whose photons the collector does not need.
    #[inline(always)]
    fn skipped(&self, _node: PhotonNode) -> u16 {
        0
    }

    /// Adds those photons in the first `count` lanes that belong to the result: within [`Self::limit`], or
    /// with a disc that contains the query.
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, lanes: &Lanes);
}

/// Photons of a leaf, one in each lane.
pub(super) struct Lanes<'a> {
    /// Bits of the squared distances, m^2.
    pub(super) distances: &'a [u32; LANES],
    /// Contents of the photons, each read as a little-endian `u64`.
    pub(super) contents: &'a [u64; LANES],
    /// Vectors from the photons to the query, by axis, metres.
    pub(super) ways: [&'a [f32; LANES]; 3],
}
