//! Trait of a kind of chip, and the memory that its techniques and caches take.

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::{
    Budget, MAX_IN_FLIGHT, MAX_TILE_PIXELS, MAX_WAITING_BLOCKS, MAX_WAITING_POINTS, gather_buckets,
    gather_candidates,
};

use super::capacity::{Capacity, FixedCapacity};
use crate::irradiance_cache::MIN_RECORDS;
use crate::memory::CacheEntry;

/// A kind of chip: the containers of its buffers, and their capacities.
pub trait ChipKind: 'static {
    /// Containers for the pixels of a tile, with capacity [`Budget::tile_pixels`].
    type TilePixels: Capacity;
    /// Containers for the candidates of a photon search for [`Budget::neighbors`] neighbours, with capacity
    /// [`gather_candidates`].
    type Candidates: Capacity;
    /// Containers for queued gathers, with capacity [`Budget::gather_queue`].
    type GatherQueue: Capacity;
    /// Containers for the buckets of gathers in card memory, with capacity [`gather_buckets`].
    type Buckets: Capacity;
    /// Containers for the blocks whose gathers wait in card memory, with capacity
    /// [`Budget::waiting_blocks`].
    type WaitingBlocks: Capacity;
    /// Containers for the irradiance records of a tile, with capacity [`Budget::irradiance_records`].
    type IrradianceRecords: Capacity;
    /// Containers for gather points whose rays are cast together. The points belong to all irradiance records
    /// of a block of pixels, or to some consecutive pixels of the block.
    type Points: Capacity;
    /// Containers for the tiles in flight, with capacity [`Budget::in_flight`].
    type Flights: Capacity;

    /// Budget of the kind, which a card reports when a session begins.
    fn budget(&self) -> &Budget;
}

/// A kind of chip whose capacities are fixed by types at compile time, as a board needs them.
pub trait FixedKind:
    ChipKind<
        TilePixels: FixedCapacity,
        Candidates: FixedCapacity,
        GatherQueue: FixedCapacity,
        Buckets: FixedCapacity,
        WaitingBlocks: FixedCapacity,
        IrradianceRecords: FixedCapacity,
        Points: FixedCapacity,
        Flights: FixedCapacity,
    >
{
    /// The kind itself, as a constant.
    const KIND: Self;
    /// Budget of the kind, as [`ChipKind::budget`] returns it.
    const BUDGET: Budget;
    /// Upper limits of the on-chip memory that each technique adds to the chip, checked at compile time.
    const TECHNIQUE_LIMITS: TechniqueMemory;
}

/// On-chip memory that each technique adds to a chip, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TechniqueMemory {
    /// Deferred reordering: the gather queue, and the tables of what waits in card memory.
    pub reordering: usize,
    /// Irradiance cache: the irradiance records of all tiles in flight, and the sums of their gathers.
    pub irradiance_cache: usize,
    /// Combined importance sampling: a direction table for every gather point.
    pub importance_sampling: usize,
}

impl TechniqueMemory {
    /// Returns true if no technique exceeds its limit in `limit`.
    pub const fn is_within(&self, limit: &Self) -> bool {
        self.reordering <= limit.reordering
            && self.irradiance_cache <= limit.irradiance_cache
            && self.importance_sampling <= limit.importance_sampling
    }
}

/// Checks at compile time that the capacities of a kind equal those of its budget, and fit the chip's index
/// types.
pub(crate) const fn check<K: FixedKind>() {
    let budget = K::BUDGET;
    assert!(K::TilePixels::ENTRIES == budget.tile_pixels as usize, "TilePixels is not of the budget");
    assert!(K::Candidates::ENTRIES == gather_candidates(budget.neighbors), "Candidates is not of the budget");
    assert!(K::GatherQueue::ENTRIES == budget.gather_queue as usize, "GatherQueue is not of the budget");
    let buckets = if budget.waiting_blocks == 0 { 0 } else { gather_buckets(budget.gather_queue) };
    assert!(K::Buckets::ENTRIES == buckets, "Buckets is not of the budget");
    let blocks = budget.waiting_blocks;
    assert!(K::WaitingBlocks::ENTRIES == blocks as usize, "WaitingBlocks is not of the budget");
    assert!(blocks <= MAX_WAITING_BLOCKS, "the target of a gather has 6 bits for its block");
    let points = budget.tile_pixels <= MAX_WAITING_POINTS && budget.irradiance_records <= MAX_WAITING_POINTS;
    assert!(blocks == 0 || points, "the target of a gather of a waiting block has 12 bits for its point");
    assert!(blocks == 0 || buckets > 0, "gathers that wait in card memory need a line in the queue");
    let records = K::IrradianceRecords::ENTRIES;
    assert!(records == budget.irradiance_records as usize, "IrradianceRecords is not of the budget");
    assert!(K::Flights::ENTRIES == budget.in_flight as usize, "Flights is not of the budget");
    assert!(K::Points::ENTRIES >= records, "all records of a block are gathered together");
    assert!(records >= MIN_RECORDS, "a block of one pixel must fit");
    assert!(budget.tile_pixels <= MAX_TILE_PIXELS, "the target of a gather has 15 bits for a pixel");
    assert!(records <= MAX_TILE_PIXELS as usize, "the target of a gather has 15 bits for a record");
    assert!(
        budget.in_flight >= 1 && budget.in_flight <= MAX_IN_FLIGHT,
        "the target of a gather has 3 bits for its tile"
    );
    assert!(budget.in_flight <= budget.tiles, "a tile in flight takes a credit");
}

/// On-chip memory of a budget's caches, including tags, bytes.
pub const fn cache_bytes(budget: &Budget) -> usize {
    line_bytes(budget) + tag_bytes(budget)
}

/// On-chip memory of the tags of a budget's caches, bytes.
pub const fn tag_bytes(budget: &Budget) -> usize {
    line_bytes(budget) / LINE_BYTES * size_of::<CacheEntry>()
}

const fn line_bytes(budget: &Budget) -> usize {
    budget.photon_cache_bytes as usize + budget.scene_cache_bytes as usize
}
