//! Messages between host and card, in postcard's encoding. Each message is the payload of one frame.
//!
//! The host sends the first message. A session proceeds as follows:
//!
//! ```text
//! Hello           -> Hello                       versions, budget, build, written lines, use of on-chip memory
//! ReadChecksums   -> Checksums ...               of written chunks; equal chunks are not sent again
//! BeginImage      -> (nothing)
//! WriteLines ...  -> (nothing)                   any number, in any order, each up to eight lines
//! EndImage        -> ImageAccepted               after the check of the checksum and the header
//! BeginFrame      -> FrameAccepted
//! RenderTile ...  -> Pixels ..., TileDone        at most the budget's `tiles` unanswered, in any order
//! Flush           -> (nothing)                   no tile follows for now: waiting gathers are done
//! ```
//!
//! A self-test takes the place of the card image: `Compute -> Computed`, any number, then `TestMemory ->
//! MemoryTested ...`.
//!
//! A command that the card cannot execute is answered with [`Reply::Fault`]; the card stays ready for the
//! next one.

mod fault;
mod identity;
mod pixel;
mod self_test;

pub use self::fault::{Fault, FaultCode, Invariant, Parameter};
pub use self::identity::{IdentityCoverage, MAX_IDENTITIES};
pub use self::pixel::{
    ALBEDO_STEPS, COVERAGE_STEPS, DEPTH_STEPS, GroupSums, LayerSums, NORMAL_STEPS, PIXEL_BYTES, PIXELS_BYTES,
    PROBES, Pixel, PixelForm, PixelLayers, PixelSums, SampleCount, SumScale, WEIGHT_OF_PROBE,
};
pub use self::self_test::{
    CASES_PER_COMMAND, MemoryPattern, MemoryTest, OPERAND_BYTES, RESULT_BYTES, RESULTS, WORDS_PER_LINE,
    WrongWord, WrongWords,
};

use serde::{Deserialize, Serialize};

use crate::budget::Budget;
use crate::counters::Counters;

/// Version of the protocol that this module, [`crate::transport`] and [`crate::frame`] define.
pub const PROTOCOL_VERSION: u16 = 19;

/// Maximum number of lines in one [`Command::WriteLines`].
pub const LINES_PER_WRITE: usize = 8;

/// Number of lines of a chunk. [`Reply::Checksums`] has one checksum per chunk.
pub const CHUNK_LINES: u32 = 64;

/// On-chip memory that a card's firmware uses, measured by the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryUse {
    /// Static data, initialised and zeroed, bytes.
    pub static_bytes: u32,
    /// Size of the stack, bytes.
    pub stack_bytes: u32,
    /// Maximum use of the stack since the chip was switched on, bytes.
    pub stack_used: u32,
}

/// Board of a card, as its firmware states it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Board<'a> {
    /// Name of the board; empty if it has none. At most [`MAX_NAME_BYTES`] are sent.
    pub name: &'a str,
    /// Serial number that tells the board from others of its name; empty if it has none. At most
    /// [`MAX_NAME_BYTES`] are sent.
    pub serial_number: &'a str,
    /// Clock rate of the counter behind [`Counters::cycles`], Hz; 0 if it is unknown.
    pub clock_hz: u32,
}

impl Board<'_> {
    /// The board with names cut to [`MAX_NAME_BYTES`], at a character's border.
    pub fn cut(&self) -> Self {
        Self { name: cut(self.name), serial_number: cut(self.serial_number), ..*self }
    }
}

/// The longest start of a text that has at most [`MAX_NAME_BYTES`] bytes.
fn cut(text: &str) -> &str {
    (0..=MAX_NAME_BYTES).rev().find_map(|end| text.get(..end)).unwrap_or_default()
}

/// Maximum length of each name in a [`Board`], bytes.
pub const MAX_NAME_BYTES: usize = 64;

/// Maximum number of checksums in one [`Reply::Checksums`].
pub const CHECKSUMS_PER_REPLY: u32 = 64;

/// A camera. The point of the picture with the fractions `u` of its width, from the left, and `v` of its
/// height, from the top, has the coordinates `x = 2 u - 1 + shift[0]` and `y = 1 - 2 v + shift[1]`. Its ray
/// follows from them by [`Projection`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Camera {
    /// Position of the camera, metres.
    pub origin: [f32; 3],
    /// Unit vector of the camera's axis.
    pub forward: [f32; 3],
    /// Vector to the right. Its length is stated at [`Projection`].
    pub right: [f32; 3],
    /// Vector to the top. Its length is stated at [`Projection`].
    pub up: [f32; 3],
    /// Offset of the picture's centre from the camera's axis, in halves of the picture's width and height:
    /// the lens shift.
    pub shift: [f32; 2],
    /// Ray of a point of the picture.
    pub projection: Projection,
}

/// Ray of a point `(x, y)` of the picture ([`Camera`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Projection {
    /// A pinhole: from the origin in the direction `forward + x right + y up`. At distance 1, `right` and
    /// `up` reach the edges of an unshifted picture.
    #[default]
    Pinhole,
    /// A thin lens: from a point of the lens through the point of the plane in focus that a
    /// [pinhole](Self::Pinhole) sees.
    ThinLens {
        /// Vector from the centre of the lens to its edge, parallel to `right`, metres.
        right: [f32; 3],
        /// Vector from the centre of the lens to its edge, parallel to `up`, metres.
        up: [f32; 3],
        /// Distance of the plane in focus along the axis, metres.
        focus: f32,
    },
    /// Parallel rays: from `origin + x right + y up` in the direction `forward`. `right` and `up` are half
    /// the picture's width and height, metres.
    Orthographic,
    /// An equirectangular panorama: from the origin at longitude `x angles[0]` and latitude `y angles[1]`,
    /// in the direction `cos(latitude) (cos(longitude) forward + sin(longitude) right) + sin(latitude) up`.
    /// `right` and `up` are unit vectors.
    Panorama {
        /// Half the angles that the picture shows, of longitude and of latitude, radians.
        angles: [f32; 2],
    },
    /// No rays: pixel `(x, y)` of a picture `w` pixels wide is the [`Sensor`](crate::layout::Sensor) with the
    /// number `y w + x`. Its light is `E / pi`, of the irradiance `E` on the sensor, W/m^2. Pixels without a
    /// sensor are black. Such a frame interpolates no irradiance and has no identities.
    Sensors {
        /// Line of card memory in which the first sensor lies. The lines of the sensors are part of the card
        /// image, behind its sections.
        line: u32,
        /// Number of the first sensor in card memory.
        first: u32,
        /// Number of sensors in card memory.
        count: u32,
    },
}

impl Camera {
    /// Pinhole camera without lens shift, of [`Projection::Pinhole`]'s vectors.
    pub const fn pinhole(origin: [f32; 3], forward: [f32; 3], right: [f32; 3], up: [f32; 3]) -> Self {
        Self { origin, forward, right, up, shift: [0.0; 2], projection: Projection::Pinhole }
    }

    /// Returns whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let Self { origin, forward, right, up, shift, projection } = self;
        let are_finite = |numbers: &[f32]| numbers.iter().all(|number| number.is_finite());
        let is_projection_finite = match projection {
            Projection::Pinhole | Projection::Orthographic | Projection::Sensors { .. } => true,
            Projection::ThinLens { right, up, focus } => {
                are_finite([*right, *up].as_flattened()) && focus.is_finite()
            }
            Projection::Panorama { angles } => are_finite(angles),
        };
        are_finite([*origin, *forward, *right, *up].as_flattened())
            && are_finite(shift)
            && is_projection_finite
    }
}

/// Parameters of a frame. With the card image, they determine the pixels. Some of them only set the order of
/// work.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameParameters {
    /// Width of the whole picture, pixels.
    pub width: u32,
    /// Height of the whole picture, pixels.
    pub height: u32,
    /// Camera of the picture.
    pub camera: Camera,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Number of the first sample of each pixel. It is above 0 if other frames of the picture render the
    /// earlier samples.
    pub first_sample: u32,
    /// Number of samples per pixel in this frame.
    pub samples: u32,
    /// Planned number of samples per pixel in all frames of the picture together. With the irradiance cache,
    /// a pixel's gather rays are divided among these samples.
    pub planned_samples: u32,
    /// Number of final gather rays per sample. With the irradiance cache, it is the number per irradiance
    /// record, and the number per pixel for all planned samples together.
    pub gather_rays: u32,
    /// Shadow rays per sample.
    pub shadow_rays: u32,
    /// Number k of photons of a gather, at least 2. The k-th photon determines the radius and adds no light.
    pub neighbors: u32,
    /// Maximum radius of a gather, metres.
    pub max_distance: f32,
    /// Importance sampling of final gather rays.
    pub sampling: Sampling,
    /// Relative error bound of interpolated irradiance, above 0 and at most 1; `None` turns the irradiance
    /// cache off.
    pub irradiance_error: Option<f32>,
    /// Number of direction bins of gather rays, at least 1. The rays of one bin are cast for all pixels of a
    /// tile before the rays of the next bin; with one bin, all rays of a pixel are cast before those of the
    /// next pixel.
    pub bins: u32,
    /// Time and order of photon gathers.
    pub drain: Drain,
    /// Maximum number of waiting gathers, at least 1. A chip limits it to the capacity of its queue.
    pub queue: u32,
    /// Source of the reflected radiance at the end of a gather ray.
    pub radiance: Radiance,
    /// Parameters of gathers in the caustic map; `None` if the map is not used. Without the map, a gather ray
    /// that reaches an emitter through specular surfaces counts the emitter's emission.
    pub caustics: Option<CausticGather>,
    /// True if the card sends [`LayerSums`] with each pixel. The radiance of a pixel is the same with and
    /// without layers. With layers, a tile has fewer pixels ([`Budget::pixels_of_tile`]).
    pub layers: bool,
    /// Pixel filter.
    pub filter: Filter,
    /// Maximum number of tiles in flight, at least 1. A chip limits it to [`Budget::in_flight`].
    pub in_flight: u32,
    /// True if irradiance records are kept for later frames of the picture, which have other samples. They
    /// are kept in the lines after the card image, as far as there is room.
    pub keep_records: bool,
    /// Threshold of adaptive sampling, W^(1/2)/(sr^(1/2) m), finite and above 0; `None` for one path per
    /// sample. The first [`PROBES`] samples are probes, whose light has the mean `L` and the standard
    /// deviation `s`. Each later sample is the mean of `s / (threshold sqrt(L))` paths, rounded, 1 to
    /// [`MAX_PATHS`].
    pub adaptive_threshold: Option<f32>,
    /// True if the environment is black where an eye ray leaves the scene without a hit. It still lights the
    /// scene, and is seen in mirrors and through glass.
    pub transparent: bool,
    /// True if the card sends [`PixelSums::position`] with each pixel.
    pub position: bool,
    /// True if the card sends [`PixelSums::coverage`] with each pixel.
    pub coverage: bool,
    /// True if the card sends [`PixelSums::identities`] with each pixel. The card image must have
    /// [`SectionKind::Identities`](crate::image::SectionKind::Identities).
    pub identities: bool,
    /// Number of light groups whose light the card sends separately with each pixel ([`GroupSums`]), at most
    /// [`MAX_LIGHT_GROUPS`](crate::budget::MAX_LIGHT_GROUPS). Light of a group beyond them counts as that of
    /// the last. At 0, the card sends the light of all groups as one.
    pub light_groups: u8,
    /// True if every surface that an eye ray meets first counts as white, Lambertian and without emission,
    /// and the environment behind the scene as black. The light of a pixel is then `E / pi`, of the
    /// irradiance `E` on the surface, W/m^2.
    pub irradiance: bool,
    /// Length below which a gather ray goes on from its end, metres, finite and at least 0. Photons are
    /// gathered at the end of its first continuation that is longer, or of the eighth. A ray that itself
    /// brings light, of an emitter or of a punctual light by narrow lobes, ends there.
    pub near_distance: f32,
}

/// Maximum number of paths per sample in adaptive sampling.
pub const MAX_PATHS: u32 = 16;

impl FrameParameters {
    /// Optional contents of the pixels that the card sends.
    pub const fn form(&self) -> PixelForm {
        let Self { layers, light_groups, position, coverage, identities, .. } = *self;
        PixelForm { layers, light_groups, position, coverage, identities }
    }

    /// Maximum number of paths per pixel, including probes of earlier samples.
    pub fn max_paths(&self) -> u64 {
        let (of_sample, probes) =
            if self.adaptive_threshold.is_some() { (MAX_PATHS, PROBES) } else { (1, 0) };
        u64::from(self.samples) * u64::from(of_sample) + u64::from(probes)
    }

    /// Maximum number of tiles that a chip holds, waiting or in flight: [`Budget::tiles`], or
    /// [`Budget::waiting_blocks`] if that is more and gathers wait in card memory.
    pub const fn tiles_of(&self, budget: &Budget) -> u32 {
        match self.drain {
            Drain::Buckets if budget.waiting_blocks > budget.tiles => budget.waiting_blocks,
            _ => budget.tiles,
        }
    }
}

/// Pixel filter: the probability density of a pixel's samples on each axis. Samples are drawn from the filter
/// and have equal weights (Ernst, Stamminger, Greiner 2006, *Filter importance sampling*), so that a pixel
/// needs no samples of its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Filter {
    /// A box filter, 1 pixel wide.
    #[default]
    Box,
    /// A Gaussian with standard deviation 1/2 pixel, cut off at 3/2 pixels.
    Gaussian,
    /// A Blackman-Harris window of four terms, 3/2 pixels wide.
    BlackmanHarris,
}

/// Parameters of photon gathers in the caustic map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CausticGather {
    /// Number of neighbours from which the host has chosen the photons' kernel radii, at least 2. A card only
    /// checks it against [`Budget::neighbors`].
    pub neighbors: u32,
    /// Maximum kernel radius of a photon, metres. The last code of
    /// [`kernel_share`](crate::layout::kernel_share) stands for it.
    pub max_distance: f32,
}

/// Importance sampling of final gather rays. It does not change the expectation of the picture. A gather
/// point with fewer than eight rays always uses [`Self::Reflection`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sampling {
    /// Directions are chosen in proportion to the BRDF times the cosine.
    #[default]
    Reflection,
    /// Directions are chosen in proportion to the flux of the photons around the gather point.
    Photon,
    /// Directions are chosen in proportion to the product of the BRDF and the photons' flux.
    Product,
    /// Directions are chosen in proportion to the mean of the densities of [`Self::Reflection`] and
    /// [`Self::Photon`].
    Mixture,
    /// Directions are chosen as by [`Self::Product`] and, where photons arrive from nearly the same
    /// direction, in narrow cones around it.
    Focused,
}

/// Source of the reflected radiance at the end of a gather ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Radiance {
    /// Density estimate from the nearest photons, for all surfaces.
    #[default]
    Density,
    /// Irradiance of the nearest irradiance point (Christensen 1999, *Faster photon map global illumination*)
    /// for Lambertian surfaces, density estimate for surfaces with a lobe. The card image must have
    /// irradiance points.
    Precomputed,
}

/// Time and order of photon gathers. The picture depends on neither.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Drain {
    /// A gather is done at the end of its ray, without a queue.
    #[default]
    Immediate,
    /// Gathers are queued. When the queue is full or no other work is left, they are done in the order of a
    /// spatial hash.
    Hash,
    /// Gathers are queued. When the queue is full or no other work is left, they are done in the order of a
    /// Hilbert curve.
    Sort,
    /// Gathers of many tiles wait in card memory after the card image, in buckets along a Hilbert curve, and
    /// so do the blocks that wait for them. When there is no room or no other work is left, the buckets are
    /// read back one after another, and their gathers are done in the order of the curve.
    Buckets,
}

/// A rectangle of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tile {
    /// Number of the tile, which the host chooses.
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
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command<'a> {
    /// Begins a session, at any time. The card drops its frame, its tiles and its card image, but keeps the
    /// written lines of memory. The encoding is equal in all versions of the protocol.
    Hello {
        /// The host's [`PROTOCOL_VERSION`].
        protocol: u16,
        /// The host's [`crate::image::LAYOUT_VERSION`].
        layout: u16,
    },
    /// Requests the checksums of up to [`CHECKSUMS_PER_REPLY`] chunks.
    ReadChecksums {
        /// Number of the first chunk.
        first: u32,
        /// Number of chunks.
        count: u32,
    },
    /// Announces a card image. Lines of memory written earlier are kept. The host therefore writes only the
    /// lines that differ.
    BeginImage {
        /// Number of lines of the card image.
        lines: u32,
        /// [`crate::checksum::image_checksum`] of all lines.
        checksum: u64,
    },
    /// Writes lines of the card image.
    WriteLines {
        /// Number of the first line.
        first: u32,
        /// Whole lines, at most [`LINES_PER_WRITE`].
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// Ends the card image. The card then checks it.
    EndImage,
    /// Sets the parameters of the tiles that follow. Tiles of an earlier frame are dropped; replies about
    /// them may arrive before the answer to this command.
    BeginFrame(FrameParameters),
    /// Renders a tile.
    RenderTile(Tile),
    /// Computes the fixed operations of a self-test on operands.
    Compute {
        /// Up to [`CASES_PER_COMMAND`] triples of `f32` operands, [`OPERAND_BYTES`] bytes per triple.
        #[serde(borrow)]
        operands: &'a [u8],
    },
    /// Tests the whole memory. The card drops all that [`Command::Hello`] drops, and all written lines.
    TestMemory,
    /// Announces that no tile follows for now: waiting gathers are done once no other work is left. The next
    /// [`Command::RenderTile`] revokes the announcement.
    Flush,
}

/// Message from a card to the host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply<'a> {
    /// Answer to [`Command::Hello`]. In all versions of the protocol, its first fields are the versions of
    /// protocol and layout ([`hello_versions`]).
    Hello {
        /// The card's [`PROTOCOL_VERSION`].
        protocol: u16,
        /// The card's [`crate::image::LAYOUT_VERSION`].
        layout: u16,
        /// Capacities of the chip.
        budget: Budget,
        /// Number of lines at the start of card memory that were written since the card was switched on.
        written_lines: u32,
        /// On-chip memory that the firmware uses. `None` on cards that do not measure it, such as emulated
        /// ones.
        memory_use: Option<MemoryUse>,
        /// Name and version of the firmware.
        #[serde(borrow)]
        build: &'a str,
        /// Board that the firmware runs on. `None` on cards that are no boards, such as emulated ones.
        #[serde(borrow)]
        board: Option<Board<'a>>,
    },
    /// Answer to [`Command::ReadChecksums`].
    Checksums {
        /// Number of the first chunk.
        first: u32,
        /// [`crate::checksum::image_checksum`] of each chunk: eight bytes, little-endian.
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// Answer to [`Command::EndImage`]: the checksum is right and the header is valid.
    ImageAccepted,
    /// Answer to [`Command::BeginFrame`]: the card can render the frame.
    FrameAccepted,
    /// Consecutive pixels of a tile in row-major order, [`PixelForm::record_bytes`] each. A tile takes
    /// several replies, in any order. Every pixel is sent once.
    Pixels {
        /// Number of the tile.
        tile: u32,
        /// Row-major index in the tile of the first of these pixels.
        first: u32,
        /// [`PixelSums`] of the pixels.
        #[serde(borrow)]
        data: &'a [u8],
    },
    /// End of a tile, sent after all its pixels.
    TileDone {
        /// Number of the tile.
        tile: u32,
        /// Counters of the work on the tile.
        counters: Counters,
    },
    /// Answer to a command that the card cannot execute.
    Fault(Fault),
    /// Answer to [`Command::Compute`].
    Computed {
        /// Results of the triples of operands, [`RESULT_BYTES`] bytes per triple.
        #[serde(borrow)]
        results: &'a [u8],
    },
    /// Answer to [`Command::TestMemory`], sent repeatedly until the test ends.
    MemoryTested(MemoryTest),
}

/// Encodes a message into `bytes` and returns its length; `None` if there is no room.
pub fn encode<T: Serialize>(message: &T, bytes: &mut [u8]) -> Option<usize> {
    postcard::to_slice(message, bytes).ok().map(|written| written.len())
}

/// Decodes a message; `None` if `bytes` is not exactly one encoded message.
pub fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Option<T> {
    postcard::take_from_bytes(bytes).ok().filter(|(_, rest)| rest.is_empty()).map(|(message, _)| message)
}

/// Protocol and layout version of a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Versions {
    /// Version of the protocol.
    pub protocol: u16,
    /// Version of the card image's layout.
    pub layout: u16,
}

/// Reads the versions from the first fields of a [`Reply::Hello`] in any version of the protocol; `None` for
/// other replies.
pub fn hello_versions(bytes: &[u8]) -> Option<Versions> {
    let (opcode, rest) = postcard::take_from_bytes::<u32>(bytes).ok()?;
    let (versions, _) = postcard::take_from_bytes(rest).ok()?;
    (opcode == 0).then_some(versions)
}
