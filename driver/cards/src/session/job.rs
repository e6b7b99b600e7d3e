//! Input, output and states of a session: jobs, assignments, restarts and events.

use std::sync::Arc;

use photoncard_picture::sink::FinishedTile;
use photoncard_shared::message::{Board, Fault, FrameParameters, MemoryTest, Tile};

use super::{PixelLimits, Upload};

/// Work that all cards of a render share: card image, frame and limits.
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
    /// True if a card has crashed at the tile before. Another crash at it is not counted against the card.
    pub is_suspect: bool,
}

/// Reason to greet a card with a new session number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restart {
    /// The session begins, or the card has other work to do. Its tiles are dropped.
    NewWork,
    /// The card was reset or silent, or its link was closed. Its tiles are returned as events.
    Lost,
}

/// Board of a card, in the words of its firmware: arbitrary text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardInfo {
    /// Name of the board; may be empty.
    pub name: String,
    /// Serial number of the board; may be empty.
    pub serial_number: String,
    /// Clock rate of its counter of cycles, Hz; 0 if unknown.
    pub clock_hz: u32,
}

impl From<Board<'_>> for BoardInfo {
    fn from(board: Board) -> Self {
        let [name, serial_number] = [board.name, board.serial_number].map(str::to_owned);
        Self { name, serial_number, clock_hz: board.clock_hz }
    }
}

/// Event that a session reports.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "most events are finished tiles, and few wait")]
pub enum Event {
    /// The card has received card image and frame.
    Ready,
    /// The card has rendered a tile, and all pixel values are in the ranges that a chip can produce.
    TileDone(FinishedTile),
    /// The card was reset or lost before it completed the tile.
    TileLost {
        /// The returned tile.
        tile: Tile,
        /// True if the card may have been working on the tile, which may have caused the loss.
        was_at_work: bool,
    },
    /// A relayed card has computed the requested checksums, eight bytes each.
    Checksums(Vec<u8>),
    /// A relayed card has accepted a card image.
    ImageAccepted,
    /// A relayed card has refused a card image or a frame.
    Refused(Fault),
    /// Results of the self-test's arithmetic for each requested triple of operands, in order.
    Computed(Vec<u8>),
    /// Progress or result of a memory test.
    MemoryTested(MemoryTest),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// The hello is sent.
    Greeting,
    /// The card has answered the greeting, and has no job.
    Ready,
    /// Checksums of the card's chunks are requested.
    Comparing,
    /// Lines of the card image are being sent.
    Loading,
    /// All lines are sent, and the card checks the image.
    Accepting,
    /// Parameters of the frame are sent, and the card is to accept them.
    Framing,
    /// The card has image and frame, and accepts tiles.
    Rendering,
    /// A part of the self-test is requested.
    Testing,
}
