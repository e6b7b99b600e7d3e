//! Messages of host and card, in postcard's encoding. Each is the payload of one frame.
//!
//! The host sends the first message. The course of a session:
//!
//! ```text
//! Hello           -> Hello                       versions, budget, build, written lines, use of on-chip memory
//! ReadChecksums   -> Checksums ...               of written chunks; equal chunks are not sent again
//! BeginImage      -> (nothing)
//! WriteLines ...  -> (nothing)                   any number, in any order, each up to eight lines
//! EndImage        -> ImageAccepted               after the check of the checksum and the header
//! BeginFrame      -> FrameAccepted
//! RenderTile ...  -> Pixels ..., TileDone        at most the budget's `tiles` unanswered, in any order
//! Flush           -> (nothing)                   no tile follows for now: gathers that wait are done
//! ```
//!
//! A self-test takes the place of the image: `Compute -> Computed`, any number, then `TestMemory ->
//! MemoryTested ...`.
//!
//! A command that the card cannot execute is answered with [`Reply::Fault`]; the card stays ready for the
//! next one.

mod fault;
mod pixel;
mod self_test;

pub use self::fault::{Fault, FaultCode, Invariant, Parameter};
pub use self::pixel::{
    ALBEDO_STEPS, DEPTH_STEPS, LAYERED_PIXEL_BYTES, LayerSums, NORMAL_STEPS, PIXEL_BYTES, PIXELS_BYTES,
    PROBES, Pixel, PixelLayers, PixelSums, SampleCount, SumScale, WEIGHT_OF_PROBE, record_bytes,
};
pub use self::self_test::{
    CASES_PER_COMMAND, MemoryPattern, MemoryTest, OPERAND_BYTES, RESULT_BYTES, RESULTS, WORDS_PER_LINE,
    WrongWord, WrongWords,
};

use serde::{Deserialize, Serialize};

use crate::budget::Budget;
use crate::counters::Counters;

/// Version of the protocol: this module, [`crate::transport`] and [`crate::frame`].
pub const PROTOCOL_VERSION: u16 = 17;

/// Maximum number of lines of one [`Command::WriteLines`].
pub const LINES_PER_WRITE: usize = 8;

/// Number of lines of a chunk, the unit of [`Reply::Checksums`].
pub const CHUNK_LINES: u32 = 64;

/// On-chip memory that a firmware uses, as its board measures it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemoryUse {
    /// Static data, initialised and zeroed, bytes.
    pub static_bytes: u32,
    /// Size of the stack, bytes.
    pub stack_bytes: u32,
    /// Maximum of the stack in use since the chip was switched on, bytes.
    pub stack_used: u32,
}

/// Maximum number of checksums of one [`Reply::Checksums`].
pub const CHECKSUMS_PER_REPLY: u32 = 64;

/// A pinhole camera. The ray through the picture's point `(u, v)`, both from 0 to 1, v downwards, has the
/// direction `forward + (2 u - 1) right + (1 - 2 v) up`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// The pinhole, metres.
    pub origin: [f32; 3],
    /// Unit vector of the view.
    pub forward: [f32; 3],
    /// To the right edge of the picture, at distance 1.
    pub right: [f32; 3],
    /// To the upper edge of the picture, at distance 1.
    pub up: [f32; 3],
}

/// Parameters of a frame: everything besides the card image that its pixels depend on, and its order of work.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameParameters {
    /// Width of the whole picture, pixels.
    pub width: u32,
    /// Height of the whole picture, pixels.
    pub height: u32,
    /// The view.
    pub camera: Camera,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Number of the first sample of a pixel: 0, or the number of those that other frames of the picture
    /// have.
    pub first_sample: u32,
    /// Samples a pixel, from the first on.
    pub samples: u32,
    /// Samples a pixel of the whole picture as planned: with the irradiance cache, rays are divided among so
    /// many.
    pub planned_samples: u32,
    /// Final gather rays a sample.
    pub gather_rays: u32,
    /// Shadow rays a sample.
    pub shadow_rays: u32,
    /// Number k of photons of a gather, at least 2: the k-th only determines the radius.
    pub neighbors: u32,
    /// Maximum radius of a gather, metres.
    pub max_distance: f32,
    /// Importance sampling of gather rays.
    pub sampling: Sampling,
    /// Relative error bound of interpolated irradiance, above 0 and at most 1; `None` turns the irradiance
    /// cache off.
    pub irradiance_error: Option<f32>,
    /// Number of direction bins of gather rays, at least 1: the rays of one bin are cast for all pixels of a
    /// tile before those of the next bin. With one bin, all rays of a pixel are cast before those of the next
    /// pixel.
    pub bins: u32,
    /// Time and order of gathers.
    pub drain: Drain,
    /// Maximum number of waiting gathers, at least 1; a chip limits it to the capacity of its queue.
    pub queue: u32,
    /// Source of the radiance at the end of a gather ray.
    pub radiance: Radiance,
    /// Gathers in the caustic map; with `None`, emission that gather rays meet through specular surfaces
    /// counts.
    pub caustics: Option<CausticGather>,
    /// `true` for pixels with [`LayerSums`]. Their light does not change; tiles have fewer pixels
    /// ([`Budget::pixels_of_tile`]).
    pub layers: bool,
    /// Pixel filter.
    pub filter: Filter,
    /// Maximum number of tiles in flight, at least 1; a chip limits it to [`Budget::in_flight`].
    pub in_flight: u32,
    /// `true` for one of several frames of a picture: irradiance records of a tile are kept in card memory,
    /// where there is room beyond the image, for a frame of other samples.
    pub keep_records: bool,
    /// Adaptive sampling: threshold of the deviation of a pixel's samples over the root of their mean,
    /// W^(1/2)/(sr^(1/2) m), finite and above 0, above which samples after the first [`PROBES`] are means of
    /// several paths. `None` for one path a sample.
    pub adaptive_threshold: Option<f32>,
}

/// Maximum number of paths of a sample by adaptive sampling.
pub const MAX_PATHS: u32 = 16;

impl FrameParameters {
    /// Maximum number of paths that a pixel has, probes of earlier samples included.
    pub fn max_paths(&self) -> u64 {
        let (of_sample, probes) =
            if self.adaptive_threshold.is_some() { (MAX_PATHS, PROBES) } else { (1, 0) };
        u64::from(self.samples) * u64::from(of_sample) + u64::from(probes)
    }
}

/// Pixel filter: the density of a pixel's samples around its centre, in both directions alike. Samples are
/// drawn from the filter and count equally (Ernst, Stamminger, Greiner 2006, *Filter importance sampling*),
/// so that no pixel needs those of its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Filter {
    /// The pixel's square.
    #[default]
    Box,
    /// A Gaussian of the standard deviation 1/2 pixel, cut off at 3/2 pixels.
    Gaussian,
    /// A Blackman-Harris window of four terms, 3/2 pixels wide.
    BlackmanHarris,
}

/// Parameters of gathers in the caustic map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CausticGather {
    /// Number k of photons, at least 2: the k-th only determines the radius.
    pub neighbors: u32,
    /// Maximum radius, metres.
    pub max_distance: f32,
}

/// Importance sampling of final gather rays. The expectation of the picture does not depend on it. Points of
/// fewer than eight rays have that of the reflection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sampling {
    /// By the reflection function and the cosine.
    #[default]
    Reflection,
    /// By the flux of the photons at the point.
    Photon,
    /// By the product of reflection and flux.
    Product,
    /// By the mean of reflection and flux.
    Mixture,
}

/// Source of the reflected radiance at the end of a gather ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Radiance {
    /// Density of the nearest photons.
    #[default]
    Density,
    /// Nearest irradiance point, which the image must have (Christensen 1999, *Faster photon map global
    /// illumination*), for Lambertian surfaces; density of photons for surfaces with a lobe.
    Precomputed,
}

/// Time and order of gathers. The picture does not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Drain {
    /// At the end of their ray, without a queue.
    #[default]
    Immediate,
    /// By a spatial hash of their position, when the queue is full or no other work is left.
    Hash,
    /// Along a Hilbert curve, when the queue is full or no other work is left.
    Sort,
}

/// A rectangle of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tile {
    /// Number of the tile, chosen by the host.
    pub id: u32,
    /// First column.
    pub x: u32,
    /// First row, from the top.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Tile {
    /// Number of pixels.
    pub fn pixels(&self) -> u64 {
        self.width as u64 * self.height as u64
    }
}

/// Message from the host to a card.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Command<'a> {
    /// Begins a session, at any time. The card forgets frame, tiles, and whether it has an image; written
    /// lines stay. Its encoding is equal in all versions of the protocol.
    Hello {
        /// The host's [`PROTOCOL_VERSION`].
        protocol: u16,
        /// The host's [`crate::image::LAYOUT_VERSION`].
        layout: u16,
    },
    /// Requests the checksums of up to [`CHECKSUMS_PER_REPLY`] chunks.
    ReadChecksums {
        /// The first chunk.
        first: u32,
        /// Number of chunks.
        count: u32,
    },
    /// Announces an image: number of lines, and checksum of all its bytes. Written lines stay, so that only
    /// those need be written in which the image differs from the one before.
    BeginImage {
        /// Lines.
        lines: u32,
        /// [`crate::checksum::image_checksum`] of the lines.
        checksum: u64,
    },
    /// Writes lines of the image.
    WriteLines {
        /// Number of the first line.
        first: u32,
        /// Whole lines, at most [`LINES_PER_WRITE`].
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// Ends the image, which is then checked.
    EndImage,
    /// Sets the parameters of the tiles that follow. Tiles of an earlier frame are dropped; messages about
    /// them may still come before the answer.
    BeginFrame(FrameParameters),
    /// Renders a tile.
    RenderTile(Tile),
    /// Computes fixed operations on operands.
    Compute {
        /// Up to [`CASES_PER_COMMAND`] triples of `f32`, [`OPERAND_BYTES`] each.
        #[serde(borrow)]
        operands: &'a [u8],
    },
    /// Tests the whole memory. The card forgets what it forgets at a hello, and all written lines.
    TestMemory,
    /// Ends the wait for further tiles: gathers that wait are done when no other work is left. The next
    /// [`Command::RenderTile`] revokes it.
    Flush,
}

/// Message from a card to the host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply<'a> {
    /// Answer to [`Command::Hello`]. The versions are first in all versions of the protocol:
    /// [`hello_versions`].
    Hello {
        /// The card's [`PROTOCOL_VERSION`].
        protocol: u16,
        /// The card's [`crate::image::LAYOUT_VERSION`].
        layout: u16,
        /// Capacities of the chip.
        budget: Budget,
        /// Number of lines of card memory, from the first, that were written since the card was switched on.
        written_lines: u32,
        /// On-chip memory that the firmware uses; `None` on cards that do not measure it, such as emulated
        /// ones.
        memory_use: Option<MemoryUse>,
        /// Name and version of the firmware.
        #[serde(borrow)]
        build: &'a str,
    },
    /// Answer to [`Command::ReadChecksums`].
    Checksums {
        /// The first chunk.
        first: u32,
        /// The [`crate::checksum::image_checksum`] of each, eight bytes, little-endian.
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// Answer to [`Command::EndImage`]: the checksum agrees, and the header is sound.
    ImageAccepted,
    /// Answer to [`Command::BeginFrame`]: the card can render it.
    FrameAccepted,
    /// Consecutive pixels of a tile in row-major order, [`record_bytes`] each. Every pixel of a tile is sent
    /// once; parts of a tile may come in any order.
    Pixels {
        /// The tile's number.
        tile: u32,
        /// Index of the first of these pixels, row-major.
        first: u32,
        /// [`PixelSums`].
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// End of a tile, after all its pixels.
    TileDone {
        /// The tile's number.
        tile: u32,
        /// Work on the tile.
        counters: Counters,
    },
    /// Answer to a command that the card cannot execute.
    Fault(Fault),
    /// Answer to [`Command::Compute`].
    Computed {
        /// The results of each triple, [`RESULT_BYTES`] each.
        #[serde(borrow)]
        results: &'a [u8],
    },
    /// Answer to [`Command::TestMemory`], repeatedly until the end of the test.
    MemoryTested(MemoryTest),
}

/// Writes a message into `bytes` and returns its length; `None` if there is no room.
pub fn encode<T: Serialize>(message: &T, bytes: &mut [u8]) -> Option<usize> {
    postcard::to_slice(message, bytes).ok().map(|written| written.len())
}

/// Reads a message that fills `bytes` exactly; `None` for any other bytes.
pub fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Option<T> {
    postcard::take_from_bytes(bytes).ok().filter(|(_, rest)| rest.is_empty()).map(|(message, _)| message)
}

/// Versions in a hello.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Versions {
    /// Version of the protocol.
    pub protocol: u16,
    /// Version of the card image's layout.
    pub layout: u16,
}

/// Reads the versions of a [`Reply::Hello`] of any version of the protocol, in which they are first; `None`
/// for other replies.
pub fn hello_versions(bytes: &[u8]) -> Option<Versions> {
    let (opcode, rest) = postcard::take_from_bytes::<u32>(bytes).ok()?;
    let (versions, _) = postcard::take_from_bytes(rest).ok()?;
    (opcode == 0).then_some(versions)
}
