//! Input and output of a session: jobs, tiles and events.

use std::sync::Arc;

use photoncard_picture::sink::FinishedTile;
use photoncard_shared::message::{FrameParameters, MemoryTest, Tile};

use super::{PixelLimits, Upload};

/// Work of all cards of a render.
#[derive(Clone)]
pub struct Job {
    /// The card image.
    pub upload: Arc<Upload>,
    /// Parameters of the frame.
    pub frame: FrameParameters,
    /// Range of valid pixel values.
    pub limits: PixelLimits,
}

/// Assignment of a tile to a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// The assigned tile.
    pub tile: Tile,
    /// True if a card has crashed at the tile before: another crash at it is not the card's fault.
    pub is_suspect: bool,
}

/// Event of a session.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "most events are finished tiles, and few wait")]
pub enum Event {
    /// The card has received image and frame.
    Ready,
    /// The card has rendered a tile with valid values.
    TileDone(FinishedTile),
    /// The card was reset or lost before it completed a tile.
    TileLost {
        /// The returned tile.
        tile: Tile,
        /// True if the card may have been working on the tile, which may be the cause.
        was_at_work: bool,
    },
    /// The card has computed the requested results.
    Computed(Vec<u8>),
    /// The card has tested a part of its memory.
    MemoryTested(MemoryTest),
}
