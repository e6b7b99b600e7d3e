//! Messages: what host and card say to each other. Each is the payload of one frame, in postcard's encoding.
//!
//! The host speaks first. A session is
//!
//! ```text
//! Hello           -> Hello                       versions, budget, build, what of its memory is written and in use
//! ReadChecksums   -> Checksums ...               of chunks that are written: what is there already is not sent again
//! BeginImage      -> (nothing)
//! WriteLines ...  -> (nothing)                   any number, in any order, each up to eight lines
//! EndImage        -> ImageAccepted               the checksum of all lines compared, the header read
//! BeginFrame      -> FrameAccepted
//! RenderTile ...  -> Pixels ..., TileDone        at most the budget's `tiles` unanswered
//! ```
//!
//! Whatever a card cannot do it answers with [`Reply::Fault`]; it stays ready for the next command.

mod fault;
mod pixel;

pub use self::fault::{Fault, FaultCode, Parameter};
pub use self::pixel::{
    LAYER_BYTES, PIXEL_BYTES, PIXELS_BYTES, Pixel, PixelLayers, PixelRecord, record_bytes,
};

use serde::{Deserialize, Serialize};

use crate::budget::Budget;
use crate::counters::Counters;

/// The version of this module, of [`crate::transport`] and of [`crate::frame`].
pub const PROTOCOL_VERSION: u16 = 9;

/// Lines that one [`Command::WriteLines`] may carry.
pub const LINES_PER_WRITE: usize = 8;

/// Lines of a chunk: what one of [`Reply::Checksums`] is of.
pub const CHUNK_LINES: u32 = 64;

/// What a firmware takes of its chip's on-chip memory, as its board measures it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemoryUse {
    /// Static data, initialised and zeroed, bytes.
    pub static_bytes: u32,
    /// Size of the stack, bytes.
    pub stack_bytes: u32,
    /// The most bytes of the stack that have been in use since the chip was switched on.
    pub stack_used: u32,
}

/// Checksums that one [`Reply::Checksums`] may carry.
pub const CHECKSUMS_PER_REPLY: u32 = 64;

/// A pinhole camera. The ray through the picture's point `(u, v)`, both from 0 to 1, v downwards, has the direction
/// `forward + (2 u - 1) right + (1 - 2 v) up`.
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

/// All that a picture depends on besides the card image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameParameters {
    /// Pixels of the whole picture in a row.
    pub width: u32,
    /// Rows of the whole picture.
    pub height: u32,
    /// The view.
    pub camera: Camera,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Final gather rays a sample.
    pub gather_rays: u32,
    /// Shadow rays a sample.
    pub shadow_rays: u32,
    /// Photons a gather looks for, at least 2: the last only tells how far it looked.
    pub neighbors: u32,
    /// How far from its place a gather looks, metres.
    pub max_distance: f32,
    /// Which way gather rays go.
    pub sampling: Sampling,
    /// The relative error that interpolated irradiance may have, above 0 and at most 1; without one no irradiance is interpolated.
    pub irradiance_error: Option<f32>,
    /// Bins that the directions of gather rays are grouped in, at least 1: the rays of one bin are cast for all pixels
    /// of a tile before those of the next. One bin casts all rays of a pixel before those of the next.
    pub bins: u32,
    /// When gathers are done.
    pub drain: Drain,
    /// Gathers that wait at most, at least 1; a chip takes what it has room for.
    pub queue: u32,
    /// What tells the radiance at the end of a gather ray.
    pub radiance: Radiance,
    /// The gathers of caustics; without them gather rays bring the light of emitters by way of perfectly specular surfaces.
    pub caustics: Option<CausticGather>,
    /// Whether pixels come with their [`PixelLayers`]. The rest of them is the same; a tile has fewer
    /// ([`Budget::pixels_of_tile`]).
    pub layers: bool,
}

/// What a gather of caustics looks for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CausticGather {
    /// Photons, at least 2: the last only tells how far it looked.
    pub neighbors: u32,
    /// How far from its place it looks, metres.
    pub max_distance: f32,
}

/// What the directions of final gather rays are chosen by. The expectation of the picture is the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sampling {
    /// The reflection function and the cosine.
    #[default]
    Reflection,
    /// The photons that arrive at the point.
    Photon,
    /// The product of both.
    Product,
    /// The mean of both.
    Mixture,
}

/// What tells the radiance of a surface at the end of a gather ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Radiance {
    /// The density of the photons nearest to it.
    #[default]
    Density,
    /// Of a Lambertian surface the nearest irradiance point, which the image must have (Christensen 1999, *Faster photon map
    /// global illumination*); of one with a Phong lobe the density of photons.
    Precomputed,
}

/// When gathers are done, and in which order. The picture is the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Drain {
    /// At once.
    #[default]
    Immediate,
    /// When the queue is full or their results are needed, by a spatial hash of their place.
    Hash,
    /// When the queue is full or their results are needed, along a Hilbert curve.
    Sort,
}

/// A rectangle of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tile {
    /// The host's number for it.
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

/// From the host to a card.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Command<'a> {
    /// Who are you? Any time; forgets frame and tiles, and whether there is an image. Lines that are written stay.
    /// It is the same in all versions of the protocol.
    Hello {
        /// The host's [`PROTOCOL_VERSION`].
        protocol: u16,
        /// The host's [`crate::image::LAYOUT_VERSION`].
        layout: u16,
    },
    /// Tell the checksums of some chunks, at most [`CHECKSUMS_PER_REPLY`] of them.
    ReadChecksums {
        /// The first chunk.
        first: u32,
        /// How many.
        count: u32,
    },
    /// An image of so many lines follows, with this checksum of all its bytes.
    BeginImage {
        /// Lines.
        lines: u32,
        /// [`crate::checksum::image_checksum`] of them.
        checksum: u64,
    },
    /// Lines of the image.
    WriteLines {
        /// Number of the first.
        first: u32,
        /// Whole lines, at most [`LINES_PER_WRITE`].
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// The image is complete.
    EndImage,
    /// The parameters of the tiles to come.
    BeginFrame(FrameParameters),
    /// Render a tile.
    RenderTile(Tile),
}

/// From a card to the host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply<'a> {
    /// Who I am. The versions come first in all versions of the protocol: [`hello_versions`].
    Hello {
        /// The card's [`PROTOCOL_VERSION`].
        protocol: u16,
        /// The card's [`crate::image::LAYOUT_VERSION`].
        layout: u16,
        /// What the chip can hold.
        budget: Budget,
        /// Lines of its memory, from the first on, that were written since it was switched on: what is beyond is nothing.
        written_lines: u32,
        /// What the firmware takes of on-chip memory; `None` where nobody measures it, as of an emulated chip.
        memory_use: Option<MemoryUse>,
        /// Name and version of the firmware.
        #[serde(borrow)]
        build: &'a str,
    },
    /// Checksums of chunks.
    Checksums {
        /// The first chunk.
        first: u32,
        /// The [`crate::checksum::image_checksum`] of each, eight bytes, little-endian.
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// The image is in memory and its header is sound.
    ImageAccepted,
    /// Tiles may come.
    FrameAccepted,
    /// Some pixels of a tile, in rows, [`record_bytes`] each.
    Pixels {
        /// The tile's number.
        tile: u32,
        /// The first of these pixels, counted in the tile's rows.
        first: u32,
        /// [`PixelRecord`]s.
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// All pixels of this tile are sent.
    TileDone {
        /// The tile's number.
        tile: u32,
        /// The work that it took.
        counters: Counters,
    },
    /// A command could not be done.
    Fault(Fault),
}

/// Writes a message into `bytes`; its length, or `None` if there is no room.
pub fn encode<T: Serialize>(message: &T, bytes: &mut [u8]) -> Option<usize> {
    postcard::to_slice(message, bytes).ok().map(|written| written.len())
}

/// Reads a message that fills all of `bytes`; `None` if they are anything else.
pub fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Option<T> {
    postcard::take_from_bytes(bytes).ok().filter(|(_, rest)| rest.is_empty()).map(|(message, _)| message)
}

/// The versions of a hello.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Versions {
    /// The protocol's.
    pub protocol: u16,
    /// The card image's layout's.
    pub layout: u16,
}

/// Reads the versions of a [`Reply::Hello`] of any version of the protocol; `None` of any other reply. They come first in
/// all versions, whatever follows.
pub fn hello_versions(bytes: &[u8]) -> Option<Versions> {
    let (opcode, rest) = postcard::take_from_bytes::<u32>(bytes).ok()?;
    let (versions, _) = postcard::take_from_bytes(rest).ok()?;
    (opcode == 0).then_some(versions)
}
