//! Why a card could not be used.

use std::time::Duration;

use photoncard_shared::budget::Budget;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::link::PortError;
use photoncard_shared::message::{Fault, PROTOCOL_VERSION, Tile, Versions};

/// Why a card could not be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SessionError {
    /// The card speaks another protocol.
    #[error("the card speaks protocol {card}, this program {host}")]
    #[diagnostic(help("install the firmware and the program of one release"))]
    Protocol {
        /// The card's version.
        card: u16,
        /// This program's version.
        host: u16,
    },
    /// The card reads other images.
    #[error("the card reads card images of layout {card}, this program writes {host}")]
    #[diagnostic(help("install the firmware and the program of one release"))]
    Layout {
        /// The card's version.
        card: u16,
        /// This program's version.
        host: u16,
    },
    /// The card takes no tile.
    #[error("the card says that it has room for no tile command at all")]
    #[diagnostic(help("correct `tiles` in the budget of the card's firmware"))]
    NoTiles,
    /// It is another card than at first, or has another firmware.
    #[error("the card has come back with another budget than it had at first")]
    #[diagnostic(help(
        "leave a card and its firmware as they are while a picture is rendered; to use it as it is now, begin again with \
         --resume"
    ))]
    OtherBudget,
    /// The card could not do a command.
    #[error("the card answers with a fault: {0}")]
    #[diagnostic(help(
        "this is a fault of the program or of the card: please report it with the command used"
    ))]
    Fault(Fault),
    /// A message is not what the session expects.
    #[error("the card's answer is out of order: {0}")]
    #[diagnostic(help("install the firmware and the program of one release"))]
    Unexpected(&'static str),
    /// Nothing came for too long.
    #[error("the card has not answered for {} s", .0.as_secs())]
    #[diagnostic(help("check that the card is powered and its firmware runs"))]
    Silent(Duration),
    /// It answers, and comes no further.
    #[error("the card answers, but has come no further for {} s", .0.as_secs())]
    #[diagnostic(help(
        "its line may damage nearly all (--stats counts `damaged_frames`): check cable and speed; if it does not, this is a \
         fault of the card's firmware: please report it with the command used"
    ))]
    Standstill(Duration),
    /// It was reset or came no further, again and again.
    #[error("the card was reset or came no further {0} times without completing a tile")]
    #[diagnostic(help(
        "it may crash at a tile, lack power, or have a line that damages nearly all (--stats counts `damaged_frames`): \
         watch the card's own messages, check the cable; then try another card, or --crop"
    ))]
    Failures(u32),
    /// The link failed.
    #[error("the link to the card is closed ({0:?})")]
    Port(PortError),
    /// A pixel has a value that no chip can give it.
    #[error(
        "the card lies: pixel ({x}, {y}) of the tile {},{},{},{} has {channel} {value}, which no chip can render",
        .tile.x, .tile.x + .tile.width, .tile.y, .tile.y + .tile.height
    )]
    #[diagnostic(help(
        "the memory of the card may be bad, or its firmware altered: what it has rendered is not used; check it with --verify \
         beside cards that you trust"
    ))]
    Value {
        /// The tile.
        tile: Tile,
        /// The pixel's column.
        x: u32,
        /// The pixel's row.
        y: u32,
        /// What has the value.
        channel: &'static str,
        /// The value.
        value: f32,
    },
    /// Other cards render a tile otherwise.
    #[error(
        "the card lies: its tile {},{},{},{} differs from what two other cards render",
        .tile.x, .tile.x + .tile.width, .tile.y, .tile.y + .tile.height
    )]
    #[diagnostic(help(
        "the memory of the card may be bad, or its firmware altered: its tiles are rendered again by other cards"
    ))]
    Outvoted {
        /// The tile.
        tile: Tile,
    },
}

/// Compares a card's versions with this program's. They are read before the rest of a hello, which another version of the
/// protocol may have changed.
pub(super) fn check_versions(card: Versions) -> Result<(), SessionError> {
    if card.protocol != PROTOCOL_VERSION {
        return Err(SessionError::Protocol { card: card.protocol, host: PROTOCOL_VERSION });
    }
    if card.layout != LAYOUT_VERSION {
        return Err(SessionError::Layout { card: card.layout, host: LAYOUT_VERSION });
    }
    Ok(())
}

/// Checks that a card can be used with its budget. Settings, image and tiles were checked against the one that it said first.
pub(super) fn check_budget(budget: &Budget, first: Option<&Budget>) -> Result<(), SessionError> {
    if budget.tiles == 0 {
        return Err(SessionError::NoTiles);
    }
    if first.is_some_and(|first| first != budget) {
        return Err(SessionError::OtherBudget);
    }
    Ok(())
}

impl SessionError {
    /// The tile that the card has lied about, if it has: nothing that it has rendered can be trusted.
    pub fn lie(&self) -> Option<Tile> {
        match *self {
            Self::Value { tile, .. } | Self::Outvoted { tile } => Some(tile),
            _ => None,
        }
    }

    /// Whether the card may be used again once it answers: nothing that it has said is wrong.
    pub fn may_pass(&self) -> bool {
        matches!(self, Self::Silent(_) | Self::Standstill(_) | Self::Port(_))
    }
}
