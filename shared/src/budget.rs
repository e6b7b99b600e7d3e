//! Capacities of a chip, which a card reports to its host, and limits for all kinds of chips.

use serde::{Deserialize, Serialize};

use crate::address::LINE_BYTES;
use crate::layout::LEAF_LANES;

/// Fixed capacities of one kind of chip. A card reports them in [`crate::message::Reply::Hello`]; the host
/// must not exceed them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Budget {
    /// On-chip memory in total, bytes.
    pub sram_bytes: u32,
    /// Private DRAM, bytes.
    pub dram_bytes: u64,
    /// On-chip memory that the photon map's cache takes, bytes.
    pub photon_cache_bytes: u32,
    /// On-chip memory that the ray caster's cache takes, bytes.
    pub scene_cache_bytes: u32,
    /// On-chip memory that the call stack takes, bytes.
    pub stack_bytes: u32,
    /// Maximum number of pixels of a tile, in a picture whose light is in one sum
    /// ([`PixelForm::sums_of_light`](crate::message::PixelForm::sums_of_light)).
    pub tile_pixels: u32,
    /// Maximum k of a search for the k nearest photons.
    pub neighbors: u32,
    /// Maximum of [`FrameParameters::gather_rays`](crate::message::FrameParameters::gather_rays).
    pub gather_rays: u32,
    /// Capacity of the queue in which photon gathers wait to be reordered, gathers.
    pub gather_queue: u32,
    /// Maximum number of irradiance cache records of a block; a power of two. A block is a tile, or a part of
    /// a tile whose records would exceed this number.
    pub irradiance_records: u32,
    /// Maximum number of shadow rays of a sample.
    pub shadow_rays: u32,
    /// Maximum number of samples of a pixel.
    pub samples: u32,
    /// Maximum number of tiles that a chip holds, waiting or in flight. At this number, the host sends no
    /// tile before another is complete.
    pub tiles: u32,
    /// Maximum number of tiles in flight. A tile is in flight until its last gather is done, so several tiles
    /// can wait for gathers at once.
    pub in_flight: u32,
    /// Maximum number of blocks whose gathers wait in card memory at once
    /// ([`Drain::Buckets`](crate::message::Drain::Buckets)), and of tiles that a chip then holds. A chip with
    /// none cannot render such frames.
    pub waiting_blocks: u32,
}

/// Maximum number of light groups.
pub const MAX_LIGHT_GROUPS: usize = 4;

/// Number of sums per pixel in a picture with layers: direct light, indirect light, caustics, and a count of
/// gathers.
pub const SUMS_WITH_LAYERS: u32 = 4;

/// Maximum of [`PixelForm::sums_of_light`](crate::message::PixelForm::sums_of_light).
pub const MAX_SUMS: u32 = SUMS_WITH_LAYERS + MAX_LIGHT_GROUPS as u32;

impl Budget {
    /// Maximum number of pixels of a tile, in a picture whose pixels have `sums` sums of light
    /// ([`PixelForm::sums_of_light`](crate::message::PixelForm::sums_of_light)).
    pub const fn pixels_of_tile(&self, sums: u32) -> u32 {
        match self.tile_pixels.checked_div(sums) {
            Some(pixels) => pixels,
            None => self.tile_pixels,
        }
    }
}

/// Upper limit of [`Budget::waiting_blocks`] for all kinds of chips.
pub const MAX_WAITING_BLOCKS: u32 = 64;

/// Upper limit of [`Budget::tile_pixels`] and of [`Budget::irradiance_records`] of a chip with
/// [`Budget::waiting_blocks`].
pub const MAX_WAITING_POINTS: u32 = 1 << 12;

/// Least number of waiting gathers in a full line of card memory.
pub const LEAST_GATHERS_OF_LINE: usize = 5;
/// Greatest number of waiting gathers in a line of card memory: of Lambertian surfaces.
pub const MOST_GATHERS_OF_LINE: usize = 8;

/// Maximum number of buckets of gathers in card memory.
pub const MAX_BUCKETS: usize = 256;

/// Number of buckets of gathers in card memory: the greatest power of two, at most [`MAX_BUCKETS`], for which
/// a queue of `queue` gathers has room for a line of each bucket; 0 if there is none.
pub const fn gather_buckets(queue: u32) -> usize {
    let lines = queue as usize / MOST_GATHERS_OF_LINE;
    if lines == 0 {
        return 0;
    }
    let buckets = 1 << lines.ilog2();
    if buckets < MAX_BUCKETS { buckets } else { MAX_BUCKETS }
}

/// Number of places of a queue of `queue` gathers that hold the lines of the buckets while rays are cast.
pub const fn places_of_buckets(queue: u32) -> usize {
    gather_buckets(queue) * MOST_GATHERS_OF_LINE
}

/// Number of places of a queue of `queue` gathers that hold gathers read from the buckets. A quarter of the
/// queue reads hardly more of the photon map than the whole, and leaves memory for a larger cache.
pub const fn places_of_gathering(queue: u32) -> usize {
    let quarter = queue as usize / 4;
    if quarter < MOST_GATHERS_OF_LINE { MOST_GATHERS_OF_LINE } else { quarter }
}

/// Upper limit of [`Budget::in_flight`] for all kinds of chips.
pub const MAX_IN_FLIGHT: u32 = 8;

/// Upper limit of [`Budget::tile_pixels`] and of [`Budget::irradiance_records`] for all kinds of chips.
pub const MAX_TILE_PIXELS: u32 = 1 << 15;

/// [`Budget::dram_bytes`] of the reference chip. Scenes are checked against this size when no card is known.
pub const REFERENCE_DRAM_BYTES: u64 = 512 << 20;

/// Upper limit of [`Budget::dram_bytes`] for all kinds of chips: a line's address has 32 bits.
pub const MAX_DRAM_BYTES: u64 = u32::MAX as u64 * LINE_BYTES as u64;

/// Upper limit of [`Budget::gather_rays`] for all kinds of chips.
pub const MAX_GATHER_RAYS: u32 = 1 << 14;

/// Number of specular bounces of a path before Russian roulette begins.
pub const FREE_BOUNCES: u32 = 16;

/// Maximum number of specular bounces of a path. A longer path contributes nothing: between mirrors of
/// reflectance 0.98, less than 4e-5 of the light is left by then.
pub const SPECULAR_BOUNCES: u32 = 512;

/// Maximum number of direction bins of generative reordering.
pub const MAX_BINS: u32 = 256;

/// Number of stack entries for a traversal of the bounding volume hierarchy. The host refuses a hierarchy
/// that needs more.
pub const BVH_STACK: usize = 256;

/// Maximum depth of the photon kd-tree, in levels: 2^27 photons.
pub const KD_TREE_LEVELS: usize = 27;

/// Number of stack entries for a search in a photon map that is a wide tree. The host builds no tree that
/// needs more.
pub const PHOTON_STACK: usize = 160;

/// Returns the number of candidates at which a search for the k = `neighbors` nearest photons selects the k
/// nearest and drops the others. A lower number shrinks the search radius sooner, but causes more selections.
pub const fn selected_candidates(neighbors: u32) -> usize {
    const MIN_BEYOND: usize = 32;
    let beyond = neighbors as usize * 3 / 5;
    neighbors as usize + if beyond < MIN_BEYOND { MIN_BEYOND } else { beyond }
}

/// Returns the capacity, in candidates, of the buffer of a search for the `neighbors` nearest photons. It is
/// `selected_candidates(neighbors)` plus [`LEAF_LANES`], because the photons of one leaf are added together.
pub const fn gather_candidates(neighbors: u32) -> usize {
    selected_candidates(neighbors) + LEAF_LANES
}
