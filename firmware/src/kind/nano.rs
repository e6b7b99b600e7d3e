//! The nano chip, for the smallest microcontrollers: the whole renderer fits into 64 KB of SRAM.

use photoncard_shared::budget::{Budget, MAX_GATHER_RAYS, gather_candidates};

use super::capacity::Entries;
use super::chip_kind::{ChipKind, FixedKind, TechniqueMemory};

/// Budget of the nano chip: 64 KB of SRAM and 1 MB of card memory.
pub const NANO: Budget = Budget {
    sram_bytes: 64 << 10,
    dram_bytes: 1 << 20,
    photon_cache_bytes: 2 << 10,
    scene_cache_bytes: 1 << 10,
    stack_bytes: 20 << 10,
    tile_pixels: 64,
    neighbors: 100,
    gather_rays: MAX_GATHER_RAYS,
    gather_queue: 256,
    irradiance_records: 32,
    shadow_rays: 64,
    samples: 4096,
    tiles: 2,
    in_flight: 1,
    waiting_blocks: 0,
};

/// Kind of the nano chip ([`NANO`]).
#[derive(Clone, Copy, Debug)]
pub struct Nano;

impl ChipKind for Nano {
    type TilePixels = Entries<{ NANO.tile_pixels as usize }>;
    type Candidates = Entries<{ gather_candidates(NANO.neighbors) }>;
    type GatherQueue = Entries<{ NANO.gather_queue as usize }>;
    type Buckets = Entries<0>;
    type WaitingBlocks = Entries<{ NANO.waiting_blocks as usize }>;
    type IrradianceRecords = Entries<{ NANO.irradiance_records as usize }>;
    type Points = Entries<64>;
    type Flights = Entries<{ NANO.in_flight as usize }>;

    fn budget(&self) -> &Budget {
        &NANO
    }
}

impl FixedKind for Nano {
    const KIND: Self = Self;
    const BUDGET: Budget = NANO;
    const TECHNIQUE_LIMITS: TechniqueMemory =
        TechniqueMemory { reordering: 8 << 10, irradiance_cache: 11 << 10, importance_sampling: 3328 };
}
