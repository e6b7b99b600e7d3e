//! The micro chip, whose budget is that of a microcontroller: the whole renderer fits into its SRAM.

use photoncard_shared::budget::{Budget, MAX_GATHER_RAYS, gather_buckets, gather_candidates};

use super::capacity::Entries;
use super::chip_kind::{ChipKind, FixedKind, TechniqueMemory};

/// Budget of the micro chip: 256 KB of SRAM.
pub const MICRO: Budget = Budget {
    sram_bytes: 256 << 10,
    dram_bytes: 16 << 20,
    photon_cache_bytes: 64 << 10,
    scene_cache_bytes: 32 << 10,
    stack_bytes: 24 << 10,
    tile_pixels: 256,
    neighbors: 128,
    gather_rays: MAX_GATHER_RAYS,
    gather_queue: 1024,
    irradiance_records: 128,
    shadow_rays: 64,
    samples: 4096,
    tiles: 2,
    in_flight: 1,
    waiting_blocks: 8,
};

/// Kind of the micro chip ([`MICRO`]), with `DRAM_MB` megabytes of card memory. `Micro<8>` is for boards with
/// one chip of PSRAM or a small SDRAM.
#[derive(Clone, Copy, Debug)]
pub struct Micro<const DRAM_MB: u32 = 16>;

impl<const DRAM_MB: u32> ChipKind for Micro<DRAM_MB> {
    type TilePixels = Entries<{ MICRO.tile_pixels as usize }>;
    type Candidates = Entries<{ gather_candidates(MICRO.neighbors) }>;
    type GatherQueue = Entries<{ MICRO.gather_queue as usize }>;
    type Buckets = Entries<{ gather_buckets(MICRO.gather_queue) }>;
    type WaitingBlocks = Entries<{ MICRO.waiting_blocks as usize }>;
    type IrradianceRecords = Entries<{ MICRO.irradiance_records as usize }>;
    type Points = Entries<256>;
    type Flights = Entries<{ MICRO.in_flight as usize }>;

    fn budget(&self) -> &Budget {
        const { &Self::BUDGET }
    }
}

impl<const DRAM_MB: u32> FixedKind for Micro<DRAM_MB> {
    const KIND: Self = Self;
    const BUDGET: Budget = Budget { dram_bytes: (DRAM_MB as u64) << 20, ..MICRO };
    const TECHNIQUE_LIMITS: TechniqueMemory =
        TechniqueMemory { reordering: 30 << 10, irradiance_cache: 48 << 10, importance_sampling: 12_800 };
}
