//! What a session is given to do, and what it says has come of it.

use photoncard_shared::address::Line;
use photoncard_shared::message::{FrameParameters, Tile};

use super::PixelLimits;
use crate::sink::FinishedTile;

/// What a card is to do, the same for every card.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The card image.
    pub image: &'a [Line],
    /// [`photoncard_shared::checksum::image_checksum`] of the image.
    pub checksum: u64,
    /// The frame's parameters.
    pub frame: &'a FrameParameters,
    /// The values that its pixels can have.
    pub limits: PixelLimits,
}

/// A tile for a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// The tile.
    pub tile: Tile,
    /// Whether a card has crashed at it: if another does, that is not the card's fault.
    pub is_suspect: bool,
}

/// What has come of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// The card has image and frame.
    Ready,
    /// The card has rendered a tile; its values are possible ones.
    TileDone(FinishedTile),
    /// The card was reset or is lost: this tile is not at it any more.
    TileLost {
        /// The tile.
        tile: Tile,
        /// Whether the card was at work on it: it may be what the card crashes at.
        was_at_work: bool,
    },
}
