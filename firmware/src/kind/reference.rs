//! The reference chip, which has the cache sizes of Steinhurst's dissertation (2007).

use photoncard_shared::budget::{
    Budget, MAX_GATHER_RAYS, REFERENCE_DRAM_BYTES, gather_buckets, gather_candidates,
};

use super::capacity::Entries;
use super::chip_kind::{ChipKind, FixedKind, TechniqueMemory};
use crate::photon::CandidateBuffer;

/// Budget of the reference chip: a photon cache of 128 KB (section 6.5) and a ray caster cache of 75 KB
/// (section 7.3.2). Tiles have up to 64x64 pixels (16x16 in the dissertation). One tile in flight leaves
/// memory for a long gather queue and for the gather points of half a tile.
pub const REFERENCE: Budget = Budget {
    sram_bytes: 1 << 20,
    dram_bytes: REFERENCE_DRAM_BYTES,
    photon_cache_bytes: 128 << 10,
    scene_cache_bytes: 75 << 10,
    stack_bytes: 16 << 10,
    tile_pixels: 4096,
    neighbors: 256,
    gather_rays: MAX_GATHER_RAYS,
    gather_queue: 15_700,
    irradiance_records: 512,
    shadow_rays: 64,
    samples: 4096,
    tiles: 4,
    in_flight: 1,
    waiting_blocks: 64,
};

/// Kind of the reference chip ([`REFERENCE`]).
#[derive(Clone, Copy, Debug)]
pub struct Reference;

impl ChipKind for Reference {
    type TilePixels = Entries<{ REFERENCE.tile_pixels as usize }>;
    type Candidates = Entries<{ gather_candidates(REFERENCE.neighbors) }>;
    type GatherQueue = Entries<{ REFERENCE.gather_queue as usize }>;
    type Buckets = Entries<{ gather_buckets(REFERENCE.gather_queue) }>;
    type WaitingBlocks = Entries<{ REFERENCE.waiting_blocks as usize }>;
    type IrradianceRecords = Entries<{ REFERENCE.irradiance_records as usize }>;
    type Points = Entries<1664>;
    type Flights = Entries<{ REFERENCE.in_flight as usize }>;

    fn budget(&self) -> &Budget {
        &REFERENCE
    }
}

impl FixedKind for Reference {
    const KIND: Self = Self;
    const BUDGET: Budget = REFERENCE;
    const TECHNIQUE_LIMITS: TechniqueMemory = TechniqueMemory {
        reordering: 408 << 10,
        irradiance_cache: 159 << 10,
        importance_sampling: 136 << 10,
    };
}

/// Candidate buffer for photon searches on the host. It suffices for the maximum number of neighbours of
/// [`REFERENCE`].
pub type ReferenceCandidates = CandidateBuffer<{ gather_candidates(REFERENCE.neighbors) }>;
