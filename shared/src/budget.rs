//! Capacities of a chip, as hosts and chips exchange them, and the bounds that hold for every kind of chip.

use serde::{Deserialize, Serialize};

use crate::layout::LEAF_LANES;

/// Fixed capacities of one kind of chip. A host reads them in [`crate::message::Reply::Hello`] and keeps
/// within them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Budget {
    /// On-chip memory, bytes.
    pub sram_bytes: u32,
    /// Private DRAM, bytes.
    pub dram_bytes: u32,
    /// On-chip memory of the photon map's cache, bytes.
    pub photon_cache_bytes: u32,
    /// On-chip memory of the ray caster's cache, bytes.
    pub scene_cache_bytes: u32,
    /// On-chip memory of the call stack, bytes.
    pub stack_bytes: u32,
    /// Maximum number of pixels of a tile, in a picture without layers.
    pub tile_pixels: u32,
    /// Maximum k of a search for the k nearest photons.
    pub neighbors: u32,
    /// Maximum number of final gather rays of a sample.
    pub gather_rays: u32,
    /// Entries of the queue of gathers for deferred reordering.
    pub gather_queue: u32,
    /// Maximum number of irradiance records of one block of a tile; a power of two.
    pub irradiance_records: u32,
    /// Maximum number of shadow rays of a sample.
    pub shadow_rays: u32,
    /// Maximum number of samples of a pixel.
    pub samples: u32,
    /// Maximum number of tile commands queued or at work on a chip: its credits.
    pub tiles: u32,
    /// Maximum number of tiles in flight: tiles whose gathers may wait at once.
    pub in_flight: u32,
}

/// Sums that a chip keeps for each pixel of a picture with layers: direct, indirect and caustic light, and a
/// count of gathers.
pub const SUMS_WITH_LAYERS: u32 = 4;

/// Sums that a chip keeps for each pixel of a picture: [`SUMS_WITH_LAYERS`] or 1.
pub const fn sums_of_pixel(layers: bool) -> u32 {
    if layers { SUMS_WITH_LAYERS } else { 1 }
}

impl Budget {
    /// Maximum number of pixels of a tile, in a picture without or with layers.
    pub const fn pixels_of_tile(&self, layers: bool) -> u32 {
        self.tile_pixels / sums_of_pixel(layers)
    }
}

/// Maximum of [`Budget::in_flight`] over all chips.
pub const MAX_IN_FLIGHT: u32 = 8;

/// Maximum of [`Budget::tile_pixels`], and of [`Budget::irradiance_records`], over all chips.
pub const MAX_TILE_PIXELS: u32 = 1 << 15;

/// [`Budget::dram_bytes`] of the reference chip, against which a scene is counted where no card is known.
pub const REFERENCE_DRAM_BYTES: u32 = 512 << 20;

/// Maximum of [`Budget::gather_rays`] over all chips.
pub const MAX_GATHER_RAYS: u32 = 1 << 14;

/// Specular bounces that a path takes without Russian roulette.
pub const FREE_BOUNCES: u32 = 16;

/// Maximum number of specular bounces of a path; a path that would take more is black. Between mirrors of
/// reflectance 0.98 less than 4e-5 of the light is left by then.
pub const SPECULAR_BOUNCES: u32 = 512;

/// Maximum number of direction bins of generative reordering.
pub const MAX_BINS: u32 = 256;

/// Stack entries of a traversal of the bounding volume hierarchy; a host refuses a hierarchy that needs more.
pub const BVH_STACK: usize = 160;

/// Maximum depth of the photon kd-tree, in levels: 2^27 photons.
pub const KD_TREE_LEVELS: usize = 27;

/// Stack entries of a search in a photon map in leaves; a host builds no tree that needs more.
pub const PHOTON_STACK: usize = 160;

/// Number of candidates at which a search for the `neighbors` nearest photons selects them: a trade-off, as a
/// lower number shrinks the search radius sooner but selects more often.
pub const fn selected_candidates(neighbors: u32) -> usize {
    const MIN_BEYOND: usize = 32;
    let beyond = neighbors as usize * 3 / 5;
    neighbors as usize + if beyond < MIN_BEYOND { MIN_BEYOND } else { beyond }
}

/// Candidates that a search for `neighbors` photons needs room for: [`selected_candidates`], and the photons
/// of one leaf, which are tested at once.
pub const fn gather_candidates(neighbors: u32) -> usize {
    selected_candidates(neighbors) + LEAF_LANES
}
