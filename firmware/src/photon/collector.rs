//! What a search of leaves puts what it finds into, and is bounded by.

use crate::simd::{Isa, LANES};

/// Keeps what is nearest of what is found.
pub(super) trait Collector {
    /// The squared distance beyond which nothing is of use, m^2.
    fn limit(&self) -> f32;

    /// Takes what is of use of the first `count` lanes: the bits of their squared distances, and what they carry.
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, distances: &[u32; LANES], contents: &[u64; LANES]);
}
