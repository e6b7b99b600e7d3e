//! Buffers that all tiles in flight of a chip share.

use photoncard_shared::budget::{Budget, gather_buckets, gather_candidates};

use super::gathers::Gathers;
use super::pixel_sums::PixelSums;
use super::points::Points;
use super::rounds::Rounds;
use crate::irradiance_cache::RecordStore;
use crate::kind::ChipKind;

/// Gather points, pixel sums, gathers, waiting blocks and kept irradiance records of a chip.
pub(super) struct Shared<K: ChipKind> {
    /// Gather points of the tile whose rays are being cast.
    pub(super) points: Points<K::Points>,
    pub(super) sums: PixelSums<K::TilePixels>,
    pub(super) gathers: Gathers<K::Candidates, K::GatherQueue, K::Buckets>,
    pub(super) rounds: Rounds<K::WaitingBlocks>,
    pub(super) store: RecordStore,
}

impl<K: ChipKind> Shared<K> {
    pub(super) const fn new() -> Self {
        Self {
            points: Points::new(),
            sums: PixelSums::new(),
            gathers: Gathers::new(),
            rounds: Rounds::new(),
            store: RecordStore::EMPTY,
        }
    }

    /// Sets the capacities that the types leave open: room for `points` gather points, and for the budget's
    /// numbers of sums, candidates and queued gathers.
    pub(super) fn reserve(&mut self, budget: &Budget, points: usize) {
        self.points.reserve(points);
        self.sums.reserve(budget.tile_pixels as usize);
        let blocks = budget.waiting_blocks as usize;
        let buckets = if blocks == 0 { 0 } else { gather_buckets(budget.gather_queue) };
        self.gathers.reserve(gather_candidates(budget.neighbors), budget.gather_queue as usize, buckets);
        self.rounds.reserve(blocks);
    }
}
