//! Faults: reasons why a card could not execute a command, as numbers on the link and as error messages.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Reason why a card could not execute a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Fault {
    /// Kind of fault.
    pub code: FaultCode,
    /// Further information, such as the number of a line or record; [`FaultCode`] defines its meaning.
    pub detail: u32,
}

/// Numbered faults; the numbers are part of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultCode {
    /// A payload is not a command; detail: the length of the payload, bytes.
    Message,
    /// The command is not allowed in this state of the session; detail: 0.
    Order,
    /// The card image does not fit in the card's memory; detail: the number of lines of the memory.
    ImageTooLarge,
    /// The data of a write is not whole lines, exceeds the card image, or has too many lines; detail: number
    /// of the first line.
    Lines,
    /// The requested chunks are none, too many or not written; detail: number of the first chunk.
    Chunks,
    /// The card image's checksum is not the announced one; detail: the lower half of the checksum found.
    ImageChecksum,
    /// The card image's header is invalid; detail: the card image's layout version if that is wrong, else 0.
    ImageHeader,
    /// A frame parameter is outside the budget, is not a number, or needs a section that the card image
    /// lacks; detail: number of the [`Parameter`].
    Parameter,
    /// A tile is empty, outside the picture or larger than the budget allows; detail: the tile's number.
    Tile,
    /// More tiles were sent than the budget allows; detail: the tile's number.
    TooManyTiles,
    /// A line outside the card's memory was requested; detail: index of the line.
    LineRange,
    /// A record outside its section was requested; detail: the record's index.
    Record,
    /// A bounding volume hierarchy, photon map or light tree is deeper than a chip's stack allows, or is not
    /// a tree; detail: index of a node.
    Depth,
    /// The operands are not a whole number of triples, or there are none or too many; detail: their length,
    /// bytes.
    Operands,
    /// The chip's program or its on-chip memory is defective; detail: number of the [`Invariant`].
    Internal,
    /// The device of card memory failed, or its lines are read-only; detail: index of a line.
    Memory,
}

/// Conditions that hold in a correct chip, numbered as in the detail of [`FaultCode::Internal`]. If a
/// condition is violated, the card sends a fault instead of a wrong picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u32)]
pub enum Invariant {
    /// Every step of work (pass over pixels, completion of a pixel, gather) must belong to a tile in flight.
    Flight,
    /// A tile in flight that begins its next block (part of a tile) must have a block left.
    Block,
    /// A block whose irradiance records exceed the cache must have several pixels, so that it can be halved.
    Halves,
    /// The buffers of a tile must have room for all pixels of a block.
    Pixels,
    /// The buffer of sums must have room for each pixel with gather rays.
    Sums,
    /// The buffer of gather points must have room for each point of a pass over pixels, and each point must
    /// have rays.
    Points,
    /// An irradiance record must be in the state that a step of its survey or gather expects.
    Record,
    /// When a gather ends, its tile in flight must count at least one waiting gather.
    Waiting,
    /// An eye path that ended at a surface must end at a surface when it is traced again.
    Surface,
    /// A bundle (rays that are cast together) must have room for each ray that is added.
    Bundle,
    /// A reply must have room for each pixel, checksum or result that is added to it.
    Reply,
    /// Card memory must have room for all lines of gathers, results and blocks for which it was reserved.
    Room,
    /// A card of a relay must send only replies that a card sends. The relay cannot revoke what the card has
    /// rendered.
    Relayed,
}

impl Invariant {
    /// Returns the fault that reports a violation of this invariant.
    pub const fn fault(self) -> Fault {
        Fault { code: FaultCode::Internal, detail: self as u32 }
    }
}

/// Fields of [`FrameParameters`](super::FrameParameters), numbered as in the detail of
/// [`FaultCode::Parameter`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
    /// Number of samples per pixel in the frame.
    Samples,
    /// Planned number of samples per pixel in all frames of the picture.
    PlannedSamples,
    /// Number of final gather rays.
    GatherRays,
    /// Number of shadow rays of a sample.
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
    /// Parameters of gathers in the caustic map.
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
    /// Blackness of the environment that eye rays see.
    Transparent,
    /// Sums of positions.
    Position,
    /// Sums of coverage.
    Coverage,
    /// Coverage by identity.
    Identities,
    /// Number of light groups.
    LightGroups,
    /// Whiteness of the surfaces that eye rays meet first.
    Irradiance,
    /// Length below which gather rays go on.
    NearDistance,
}

impl Parameter {
    /// All parameters, in the order of their numbers.
    pub const ALL: [Self; 30] = [
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
        Self::Transparent,
        Self::Position,
        Self::Coverage,
        Self::Identities,
        Self::LightGroups,
        Self::Irradiance,
        Self::NearDistance,
    ];

    /// Returns the fault that reports that the card cannot render with the parameter's value.
    pub const fn fault(self) -> Fault {
        Fault { code: FaultCode::Parameter, detail: self as u32 }
    }

    /// Name of the parameter in error messages.
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
            Self::Transparent => "blackness of the environment that eye rays see",
            Self::Position => "sums of positions",
            Self::Coverage => "sums of coverage",
            Self::Identities => "coverage by identity",
            Self::LightGroups => "light groups",
            Self::Irradiance => "whiteness of the surfaces that eye rays meet first",
            Self::NearDistance => "length below which gather rays go on",
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
            FaultCode::Memory => {
                write!(
                    f,
                    "line {detail} of the card's memory cannot be read or written: its device failed, or it is read-only"
                )
            }
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
