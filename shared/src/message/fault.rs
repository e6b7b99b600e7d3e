//! Faults: reasons why a card could not execute a command, as numbers on the wire and as texts for people.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Reason why a card could not execute a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// Kind of fault.
    pub code: FaultCode,
    /// Number that locates the fault, such as a line or a record; [`FaultCode`] defines its meaning.
    pub detail: u32,
}

/// Numbered faults; the numbers are part of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultCode {
    /// A payload is not a command; detail: its bytes.
    Message,
    /// The command is not allowed in this state of the session; detail: 0.
    Order,
    /// The image does not fit in the card's memory; detail: the number of lines of the memory.
    ImageTooLarge,
    /// The data of a write is not whole lines, exceeds the image, or has too many lines; detail: number of
    /// the first line.
    Lines,
    /// Chunks were requested that are not written, or too many; detail: number of the first chunk.
    Chunks,
    /// The image's checksum differs; detail: the lower half of the checksum found.
    ImageChecksum,
    /// The image's header is invalid; detail: the image's layout version if that is wrong, else 0.
    ImageHeader,
    /// A frame parameter is outside the budget, is not a number, or needs something that the image does not
    /// have; detail: number of the [`Parameter`].
    Parameter,
    /// A tile is empty, outside the picture or larger than the budget allows; detail: the tile's number.
    Tile,
    /// More tiles were sent than the budget allows; detail: the tile's number.
    TooManyTiles,
    /// A line outside the card's memory was requested; detail: the line.
    LineRange,
    /// A record outside its section was requested; detail: the record's index.
    Record,
    /// The bounding volume hierarchy is deeper than the stack, or not a tree; detail: the node.
    Depth,
    /// The operands are not whole triples, none, or too many; detail: their length, bytes.
    Operands,
    /// The chip's program or its on-chip memory is defective; detail: number of the [`Invariant`].
    Internal,
}

/// Invariants of a correct chip, numbered as in [`FaultCode::Internal`]. If one is violated, the card sends a
/// fault instead of losing light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Invariant {
    /// Each pass, completion and gather belongs to a tile in flight.
    Flight,
    /// A tile in flight that begins a block has one left.
    Block,
    /// A block of several pixels can be halved, and the records of a block of one pixel fit into the
    /// irradiance cache.
    Halves,
    /// The buffers of a tile hold all pixels of a block.
    Pixels,
    /// Each pixel with gather rays has sums.
    Sums,
    /// The buffer has room for each gather point, and each gather point has rays.
    Points,
    /// The irradiance record that a gather belongs to is being gathered.
    Record,
    /// A gather that ends is counted among the gathers that its tile waits for.
    Waiting,
    /// A surface that was seen once is seen again by the same ray.
    Surface,
    /// A bundle has room for each of its rays.
    Bundle,
    /// A reply has room for each of its parts.
    Reply,
}

impl Invariant {
    /// Fault that reports a violation of this invariant.
    pub const fn fault(self) -> Fault {
        Fault { code: FaultCode::Internal, detail: self as u32 }
    }
}

/// Fields of [`FrameParameters`](super::FrameParameters), numbered as in [`FaultCode::Parameter`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Parameter {
    /// Width of the picture.
    Width,
    /// Height of the picture.
    Height,
    /// Origin and axes of the camera.
    Camera,
    /// Seed of the random numbers.
    Seed,
    /// Number of the first sample of a pixel.
    FirstSample,
    /// Samples per pixel.
    Samples,
    /// Planned samples per pixel of the whole picture.
    PlannedSamples,
    /// Final gather rays per sample.
    GatherRays,
    /// Shadow rays per sample.
    ShadowRays,
    /// Number of photons of a gather.
    Neighbors,
    /// Maximum radius of a gather.
    MaxDistance,
    /// Importance sampling of gather rays.
    Sampling,
    /// Error bound of interpolated irradiance.
    IrradianceError,
    /// Number of direction bins.
    Bins,
    /// Time and order of gathers.
    Drain,
    /// Maximum number of waiting gathers.
    Queue,
    /// Source of the radiance at the ends of gather rays.
    Radiance,
    /// Gathers in the caustic map.
    Caustics,
    /// Presence of pixel layers.
    Layers,
    /// Pixel filter.
    Filter,
    /// Maximum number of tiles in flight.
    InFlight,
    /// Keeping of irradiance records.
    KeepRecords,
    /// Threshold of adaptive sampling.
    AdaptiveThreshold,
}

impl Parameter {
    /// All parameters, in the order of their numbers.
    pub const ALL: [Self; 23] = [
        Self::Width,
        Self::Height,
        Self::Camera,
        Self::Seed,
        Self::FirstSample,
        Self::Samples,
        Self::PlannedSamples,
        Self::GatherRays,
        Self::ShadowRays,
        Self::Neighbors,
        Self::MaxDistance,
        Self::Sampling,
        Self::IrradianceError,
        Self::Bins,
        Self::Drain,
        Self::Queue,
        Self::Radiance,
        Self::Caustics,
        Self::Layers,
        Self::Filter,
        Self::InFlight,
        Self::KeepRecords,
        Self::AdaptiveThreshold,
    ];

    /// Fault that reports that the card cannot render with this parameter's value.
    pub const fn fault(self) -> Fault {
        Fault { code: FaultCode::Parameter, detail: self as u32 }
    }

    /// Name of the parameter in texts for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Width => "width",
            Self::Height => "height",
            Self::Camera => "camera",
            Self::Seed => "seed",
            Self::FirstSample => "first sample of a pixel",
            Self::Samples => "samples a pixel",
            Self::PlannedSamples => "planned samples a pixel",
            Self::GatherRays => "gather rays a sample",
            Self::ShadowRays => "shadow rays a sample",
            Self::Neighbors => "neighbors of a gather",
            Self::MaxDistance => "greatest distance of a gather",
            Self::Sampling => "sampling of gather rays",
            Self::IrradianceError => "error of interpolated irradiance",
            Self::Bins => "direction bins",
            Self::Drain => "order of gathers",
            Self::Queue => "queue of gathers",
            Self::Radiance => "radiance at the ends of gather rays",
            Self::Caustics => "gathers of caustics",
            Self::Layers => "layers",
            Self::Filter => "pixel filter",
            Self::InFlight => "tiles in flight",
            Self::KeepRecords => "keeping of irradiance records",
            Self::AdaptiveThreshold => "threshold of adaptive sampling",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let detail = self.detail;
        match self.code {
            FaultCode::Message => write!(f, "a message of {detail} bytes is not a command"),
            FaultCode::Order => f.write_str("a command came out of order"),
            FaultCode::ImageTooLarge => {
                write!(f, "the card image does not fit the card's {detail} lines of memory")
            }
            FaultCode::Lines => {
                write!(f, "the lines written from line {detail} on are not whole, or not of the image")
            }
            FaultCode::Chunks => {
                write!(f, "checksums from chunk {detail} on are of memory that was not written")
            }
            FaultCode::ImageChecksum => write!(f, "the card image has another checksum (...{detail:08x})"),
            FaultCode::ImageHeader if detail == 0 => f.write_str("the card image's header is not sound"),
            FaultCode::ImageHeader => write!(f, "the card image has layout version {detail}"),
            FaultCode::Parameter => match Parameter::ALL.get(detail as usize) {
                Some(parameter) => write!(
                    f,
                    "the frame parameter `{}` is outside the card's budget, or the card image lacks what it needs",
                    parameter.name()
                ),
                None => write!(f, "frame parameter {detail} is outside the card's budget"),
            },
            FaultCode::Tile => {
                write!(f, "tile {detail} is empty, outside the picture or larger than the budget's")
            }
            FaultCode::TooManyTiles => write!(f, "tile {detail} is one more than the card's budget"),
            FaultCode::LineRange => write!(f, "line {detail} is outside the card's memory"),
            FaultCode::Record => write!(f, "record {detail} is outside its section of the card image"),
            FaultCode::Depth => {
                write!(f, "the hierarchy is deeper than the traversal stack, or no tree, at node {detail}")
            }
            FaultCode::Operands => {
                write!(f, "{detail} bytes of operands are not whole triples, none, or too many")
            }
            FaultCode::Internal => write!(
                f,
                "invariant {detail} of the chip is broken: its program or its on-chip memory is at fault"
            ),
        }
    }
}

impl core::error::Error for Fault {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_numbered_by_their_position() {
        for (number, parameter) in (0..).zip(Parameter::ALL) {
            assert_eq!(parameter as u32, number, "{parameter:?}");
        }
    }
}
