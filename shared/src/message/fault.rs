//! Faults: why a card could not do a command, by number on the wire and in words for people.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Why a card could not do a command, and a number that says where.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// The fault.
    pub code: FaultCode,
    /// Where: a line, a record, a value; see the code.
    pub detail: u32,
}

/// Numbered faults; the numbers are part of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultCode {
    /// A payload is not a command; detail: its bytes.
    Message,
    /// The command does not fit the state of the session; detail: 0.
    Order,
    /// The image does not fit in the card's memory; detail: the lines there are.
    ImageTooLarge,
    /// Lines are not whole, not of the image, or too many; detail: the first.
    Lines,
    /// Chunks are not of what is written, or too many; detail: the first.
    Chunks,
    /// The image's checksum differs; detail: the lower half of the checksum found.
    ImageChecksum,
    /// The image's header is not sound; detail: the image's layout version for a wrong version, else 0.
    ImageHeader,
    /// A frame parameter is outside the budget, not a number, or asks for what the image does not have;
    /// detail: the number of the [`Parameter`].
    Parameter,
    /// A tile is empty, outside the picture or above the budget; detail: its number.
    Tile,
    /// More tiles than the budget's; detail: the tile's number.
    TooManyTiles,
    /// A line outside the card's memory was asked for; detail: the line.
    LineRange,
    /// A record outside its section was asked for; detail: its index.
    Record,
    /// A bounding volume hierarchy that is deeper than the stack, or no tree; detail: the node.
    Depth,
    /// Operands are not whole triples, none, or too many; detail: their bytes.
    Operands,
    /// The chip's program or its on-chip memory is at fault; detail: the number of the [`Invariant`].
    Internal,
}

/// Invariants of a chip whose program is right, by the numbers that [`FaultCode::Internal`] carries. Where
/// one does not hold light would be lost, and a fault is sent in its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Invariant {
    /// There is a tile in flight for each pass, completion and gather.
    Flight,
    /// A tile in flight has a block left when one begins.
    Block,
    /// A block of several pixels can be halved, and one of one pixel fits into the irradiance cache.
    Halves,
    /// The buffers of a tile hold all pixels of a block.
    Pixels,
    /// Each pixel with gather rays has sums of its own.
    Sums,
    /// There is room for each gather point, and each has its rays.
    Points,
    /// A gather's irradiance record is being gathered.
    Record,
    /// A gather that ends is one of those that its tile waits for.
    Waiting,
    /// A surface that was seen is seen again.
    Surface,
    /// There is room for each ray of a bundle.
    Bundle,
    /// There is room for each part of a reply.
    Reply,
}

impl Invariant {
    /// The fault of a card where this does not hold.
    pub const fn fault(self) -> Fault {
        Fault { code: FaultCode::Internal, detail: self as u32 }
    }
}

/// The fields of [`FrameParameters`](super::FrameParameters), by the numbers that [`FaultCode::Parameter`]
/// carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Parameter {
    /// Pixels of the picture in a row.
    Width,
    /// Rows of the picture.
    Height,
    /// Origin and axes of the camera.
    Camera,
    /// Seed of the random numbers.
    Seed,
    /// Number of the first sample of a pixel.
    FirstSample,
    /// Samples a pixel.
    Samples,
    /// Samples a pixel of the whole picture.
    PlannedSamples,
    /// Final gather rays a sample.
    GatherRays,
    /// Shadow rays a sample.
    ShadowRays,
    /// Photons that a gather looks for.
    Neighbors,
    /// Greatest distance of a gather.
    MaxDistance,
    /// Choice of the directions of gather rays.
    Sampling,
    /// Relative error of interpolated irradiance.
    IrradianceError,
    /// Direction bins.
    Bins,
    /// Time of the gathers.
    Drain,
    /// Gathers that wait.
    Queue,
    /// Source of the radiance at the ends of gather rays.
    Radiance,
    /// Gathers of caustics.
    Caustics,
    /// Layers of the pixels.
    Layers,
    /// Pixel filter.
    Filter,
    /// Tiles in flight.
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

    /// The fault of a card that cannot render with this parameter's value.
    pub const fn fault(self) -> Fault {
        Fault { code: FaultCode::Parameter, detail: self as u32 }
    }

    /// The parameter's name in messages to people.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_has_the_number_of_its_place() {
        for (number, parameter) in (0..).zip(Parameter::ALL) {
            assert_eq!(parameter as u32, number, "{parameter:?}");
        }
    }
}
