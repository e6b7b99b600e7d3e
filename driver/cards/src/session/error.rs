//! Errors of a session with a card.

use std::time::Duration;

use photoncard_shared::budget::Budget;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::link::PortError;
use photoncard_shared::message::{Fault, FaultCode, PROTOCOL_VERSION, Tile, Versions};

use super::line_fault::LineFault;

/// Error of a session with a card.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SessionError {
    /// Error of a card with another version of the protocol.
    #[error("the card speaks protocol {card}, this program {host}")]
    #[diagnostic(help("install the firmware and the program of one release"))]
    Protocol {
        /// Protocol version that the card speaks.
        card: u16,
        /// Protocol version that this program speaks.
        host: u16,
    },
    /// Error of a card with another version of the card image layout.
    #[error("the card reads card images of layout {card}, this program writes {host}")]
    #[diagnostic(help("install the firmware and the program of one release"))]
    Layout {
        /// Layout version of the card images that the card reads.
        card: u16,
        /// Layout version of the card images that this program writes.
        host: u16,
    },
    /// Error of a card whose budget (capacities) permits no tile command.
    #[error("the card says that it has room for no tile command at all")]
    #[diagnostic(help("correct `tiles` in the budget of the card's firmware"))]
    NoTiles,
    /// Error of a card that returns with another budget, because it or its firmware was replaced.
    #[error("the card has come back with another budget than it had at first")]
    #[diagnostic(help(
        "leave a card and its firmware as they are while a picture is rendered; to use it as it is now, begin again \
         with `outputs.partial.resume`"
    ))]
    OtherBudget,
    /// Error of a card whose memory cannot be read, or is in part a scene in flash.
    #[error("the card answers with a fault: {0}")]
    #[diagnostic(help(
        "a card with a scene in flash renders that scene alone, with `--prepared` and the file that it was made \
         from, and has no self-test of its memory; otherwise check the memory and its device"
    ))]
    Memory(Fault),
    /// Error of a command that the card reports as failed.
    #[error("the card answers with a fault: {0}")]
    #[diagnostic(help(
        "this is a fault of the program or of the card: please report it with the command used"
    ))]
    Fault(Fault),
    /// Error of a message that violates the protocol.
    #[error("the card's answer is out of order: {0}")]
    #[diagnostic(help("install the firmware and the program of one release"))]
    Unexpected(&'static str),
    /// Error of a card that was silent for this long.
    #[error("the card has not answered for {} s", .0.as_secs())]
    #[diagnostic(help(
        "check that the card is powered, its firmware runs, and its address and bit rate are right: a card answers \
         nothing that reaches it damaged"
    ))]
    Silent(Duration),
    /// Error of a line on which bytes arrive but no valid frames.
    #[error("{bytes} bytes have come from the card in {} s, and no message among them: {fault}", time.as_secs())]
    #[diagnostic(help("{}", fault.remedy()))]
    Garbled {
        /// Time without a valid frame.
        time: Duration,
        /// Number of bytes since the last valid frame.
        bytes: u64,
        /// Probable cause.
        fault: LineFault,
    },
    /// Error of a line that damages so much that the card comes no further.
    #[error("the card comes no further on a bad line: {0}")]
    #[diagnostic(help("{}", .0.remedy()))]
    BadLine(LineFault),
    /// Error of a line that returns what the host sends.
    #[error("the card's answer is an echo of the host's own bytes")]
    #[diagnostic(help(
        "a plug or a solder bridge joins TX and RX, or an adapter or console with an echo is at the address"
    ))]
    Echo,
    /// Error of a card that answers without progress.
    #[error("the card answers, but has come no further for {} s", .0.as_secs())]
    #[diagnostic(help(
        "its line may damage nearly all (--stats counts `damaged_frames`): check cable and speed; if it does not, this is a \
         fault of the card's firmware: please report it with the command used"
    ))]
    Standstill(Duration),
    /// Error of a card that was reset, or made no progress, too many times.
    #[error("the card was reset or came no further {0} times without completing a tile")]
    #[diagnostic(help(
        "it may crash at a tile, lack power, or have a line that damages nearly all (--stats counts `damaged_frames`): \
         watch the card's own messages, check the cable; then try another card, or `picture.crop`"
    ))]
    Failures(u32),
    /// Error of a link that was closed, or whose device failed.
    #[error("the link to the card {}", ending(.0))]
    #[diagnostic(help(
        "the card's process or the machine between has ended, another host has taken the card, or a cable \
         was pulled: check them, and begin the command again"
    ))]
    Port(PortError),
    /// Error of a pixel value that no chip can produce.
    #[error(
        "the card lies: pixel ({x}, {y}) of the tile {},{},{},{} has {channel} {value}, which no chip can render",
        .tile.x, .tile.x + .tile.width, .tile.y, .tile.y + .tile.height
    )]
    #[diagnostic(help(
        "the memory of the card may be bad, or its firmware altered: what it has rendered is not used; check it with \
         `cards.verify` beside cards that you trust"
    ))]
    Value {
        /// Tile of the pixel.
        tile: Tile,
        /// Column of the pixel.
        x: u32,
        /// Row of the pixel.
        y: u32,
        /// Name of the channel.
        channel: &'static str,
        /// Value that no chip can produce.
        value: f64,
    },
    /// Error of a tile that other cards render differently.
    #[error(
        "the card lies: its tile {},{},{},{} differs from what other cards render",
        .tile.x, .tile.x + .tile.width, .tile.y, .tile.y + .tile.height
    )]
    #[diagnostic(help(
        "the memory of the card may be bad, or its firmware altered: its tiles are rendered again by other cards"
    ))]
    Outvoted {
        /// The disputed tile.
        tile: Tile,
    },
}

/// Returns a verb phrase for the cause of a link's end; its subject is the name of the link.
fn ending(error: &PortError) -> String {
    match error {
        PortError::Closed => "was closed by the other end".to_owned(),
        PortError::Device(code) => format!("has failed (error {code} of its device)"),
    }
}

/// Checks the versions of a card. They are decoded before the rest of a hello, whose format may differ
/// between versions.
pub(super) fn check_versions(card: Versions) -> Result<(), SessionError> {
    if card.protocol != PROTOCOL_VERSION {
        return Err(SessionError::Protocol { card: card.protocol, host: PROTOCOL_VERSION });
    }
    if card.layout != LAYOUT_VERSION {
        return Err(SessionError::Layout { card: card.layout, host: LAYOUT_VERSION });
    }
    Ok(())
}

/// Checks that a card accepts tile commands, and that its budget equals the one in its first hello. Settings,
/// image and tiles were checked against the first budget.
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
    /// Tile of which the card sent wrong pixels; `None` for other errors. If there is such a tile, none of
    /// the card's pixels can be trusted.
    pub fn lie(&self) -> Option<Tile> {
        match *self {
            Self::Value { tile, .. } | Self::Outvoted { tile } => Some(tile),
            _ => None,
        }
    }

    /// Returns whether nothing that the card has rendered can be trusted: it sent wrong pixels or invalid
    /// messages, or its chip reported a fault of its own.
    pub fn is_wrong(&self) -> bool {
        self.lie().is_some()
            || matches!(self, Self::Unexpected(_) | Self::Fault(Fault { code: FaultCode::Internal, .. }))
    }

    /// Returns whether the card may be retried: it was silent, slow or disconnected, but not wrong.
    pub fn may_pass(&self) -> bool {
        matches!(
            self,
            Self::Silent(_) | Self::Garbled { .. } | Self::BadLine(_) | Self::Standstill(_) | Self::Port(_)
        )
    }
}
