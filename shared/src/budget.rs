//! What a chip can hold. One room for every capacity: containers take theirs from here, and nowhere else.

use serde::{Deserialize, Serialize};

use crate::layout::LEAF_LANES;

/// The fixed capacities of one kind of chip. A host reads them in the card's hello and keeps within them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Budget {
    /// On-chip memory, bytes.
    pub sram_bytes: u32,
    /// Private DRAM, bytes.
    pub dram_bytes: u32,
    /// Share of the on-chip memory for the cache of the photon kd-tree, bytes.
    pub photon_cache_bytes: u32,
    /// Share of the on-chip memory for the ray caster's cache, bytes.
    pub scene_cache_bytes: u32,
    /// Share of the on-chip memory for the stack, bytes.
    pub stack_bytes: u32,
    /// Pixels of one tile, without layers.
    pub tile_pixels: u32,
    /// Photons that one gather can look for.
    pub neighbors: u32,
    /// Final gather rays of one sample.
    pub gather_rays: u32,
    /// Photon gathers that can wait to be reordered.
    pub gather_queue: u32,
    /// Irradiance records of one block of a tile; a power of two.
    pub irradiance_records: u32,
    /// Irradiance records that are gathered at once.
    pub gathered_records: u32,
    /// Shadow rays of one sample.
    pub shadow_rays: u32,
    /// Samples of one pixel.
    pub samples: u32,
    /// Tile commands that may be waiting or at work on a chip: its credits.
    pub tiles: u32,
}

/// Sums of light that a chip keeps of a pixel of a picture with layers: three components, and a count of gathers.
pub const SUMS_WITH_LAYERS: u32 = 4;

/// Sums of light that a chip keeps of a pixel.
pub const fn sums_of_pixel(layers: bool) -> u32 {
    if layers { SUMS_WITH_LAYERS } else { 1 }
}

impl Budget {
    /// Pixels of one tile of a picture without or with layers.
    pub const fn pixels_of_tile(&self, layers: bool) -> u32 {
        self.tile_pixels / sums_of_pixel(layers)
    }
}

/// The reference chip: the dissertation's, with 128 KB of photon cache (6.5), a 75 KB ray caster cache (7.3.2), tiles
/// of 16x16 (up to 64x64 here).
pub const REFERENCE: Budget = Budget {
    sram_bytes: 1 << 20,
    dram_bytes: 512 << 20,
    photon_cache_bytes: 128 << 10,
    scene_cache_bytes: 75 << 10,
    stack_bytes: 16 << 10,
    tile_pixels: 4096,
    neighbors: 256,
    gather_rays: MOST_GATHER_RAYS,
    gather_queue: 12_640,
    irradiance_records: 512,
    gathered_records: 512,
    shadow_rays: 64,
    samples: 4096,
    tiles: 4,
};

/// The micro chip: everything within the 256 KB of SRAM that microcontrollers have.
pub const MICRO: Budget = Budget {
    sram_bytes: 256 << 10,
    dram_bytes: 16 << 20,
    photon_cache_bytes: 64 << 10,
    scene_cache_bytes: 32 << 10,
    stack_bytes: 24 << 10,
    tile_pixels: 256,
    neighbors: 128,
    gather_rays: MOST_GATHER_RAYS,
    gather_queue: 1024,
    irradiance_records: 128,
    gathered_records: 128,
    shadow_rays: 64,
    samples: 4096,
    tiles: 2,
};

/// On-chip memory that each technique may add to a chip that does without, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TechniqueMemory {
    /// Reordering: the queue of gathers that wait.
    pub reordering: usize,
    /// The irradiance cache: records, and the sums of those being gathered.
    pub irradiance_cache: usize,
    /// Combined importance sampling: a table of directions for every pixel of a tile.
    pub importance_sampling: usize,
}

impl TechniqueMemory {
    /// What the techniques may add to [`REFERENCE`].
    pub const REFERENCE: Self =
        Self { reordering: 299 << 10, irradiance_cache: 189 << 10, importance_sampling: 136 << 10 };
    /// What the techniques may add to [`MICRO`].
    pub const MICRO: Self =
        Self { reordering: (24 << 10) + 64, irradiance_cache: 48 << 10, importance_sampling: 8704 };

    /// Whether every technique adds no more than `limit` allows.
    pub const fn is_within(&self, limit: &Self) -> bool {
        self.reordering <= limit.reordering
            && self.irradiance_cache <= limit.irradiance_cache
            && self.importance_sampling <= limit.importance_sampling
    }
}

/// Final gather rays of one sample that any budget may allow.
pub const MOST_GATHER_RAYS: u32 = 1 << 14;

/// Perfectly specular surfaces that a path may meet: what would meet more is black. In a glass ball the eighth reflection inside
/// carries less than a millionth.
pub const SPECULAR_BOUNCES: u32 = 16;

/// Direction bins that gather rays may be grouped in.
pub const MOST_BINS: u32 = 256;

/// Entries of the stack of a descent in the bounding volume hierarchy: a host refuses a hierarchy that needs more.
pub const BVH_STACK: usize = 160;

/// Levels of the photon kd-tree: enough for 2^27 photons.
pub const KD_TREE_LEVELS: usize = 27;

/// Entries of the stack of a search in a photon map of leaves: a host makes no tree that needs more.
pub const PHOTON_STACK: usize = 160;

/// Candidates from which on a gather of `neighbors` photons selects the nearest of them. The fewer, the sooner it looks less far,
/// and the more often it selects.
pub const fn selected_candidates(neighbors: u32) -> usize {
    const LEAST_BEYOND: usize = 32;
    let beyond = neighbors as usize * 3 / 5;
    neighbors as usize + if beyond < LEAST_BEYOND { LEAST_BEYOND } else { beyond }
}

/// Candidates that a gather of `neighbors` photons has room for: those from which it selects, and those that are tested at
/// once.
pub const fn gather_candidates(neighbors: u32) -> usize {
    selected_candidates(neighbors) + LEAF_LANES
}
