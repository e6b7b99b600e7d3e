//! The large chip, with twice the on-chip memory of the reference chip.

use photoncard_shared::budget::{Budget, gather_buckets, gather_candidates};

use super::capacity::Entries;
use super::chip_kind::{ChipKind, FixedKind, TechniqueMemory};
use super::reference::REFERENCE;

/// Budget of the large chip: `REFERENCE` with 2 MB of SRAM, a scene cache of 128 KB, a longer gather queue,
/// and four tiles in flight to fill it.
pub const LARGE: Budget = Budget {
    sram_bytes: 2 << 20,
    scene_cache_bytes: 128 << 10,
    gather_queue: 30_300,
    tiles: 8,
    in_flight: 4,
    ..REFERENCE
};

/// Kind of the large chip ([`LARGE`]).
#[derive(Clone, Copy, Debug)]
pub struct Large;

impl ChipKind for Large {
    type TilePixels = Entries<{ LARGE.tile_pixels as usize }>;
    type Candidates = Entries<{ gather_candidates(LARGE.neighbors) }>;
    type GatherQueue = Entries<{ LARGE.gather_queue as usize }>;
    type Buckets = Entries<{ gather_buckets(LARGE.gather_queue) }>;
    type WaitingBlocks = Entries<{ LARGE.waiting_blocks as usize }>;
    type IrradianceRecords = Entries<{ LARGE.irradiance_records as usize }>;
    type Points = Entries<3328>;
    type Flights = Entries<{ LARGE.in_flight as usize }>;

    fn budget(&self) -> &Budget {
        &LARGE
    }
}

impl FixedKind for Large {
    const KIND: Self = Self;
    const BUDGET: Budget = LARGE;
    const TECHNIQUE_LIMITS: TechniqueMemory = TechniqueMemory {
        reordering: 772 << 10,
        irradiance_cache: 640 << 10,
        importance_sampling: 163 << 10,
    };
}
