//! Errors of a render.

use miette::Diagnostic;
use photoncard_cards::link::LinkError;
use photoncard_cards::session::SessionError;
use photoncard_map::pack::PackError;
use photoncard_map::photon::PhotonError;
use photoncard_picture::film::FilmError;
use photoncard_picture::output::OutputError;
use photoncard_scene::error::SceneError;
use photoncard_shared::message::Fault;

use crate::emulator::direct::TileError;
use crate::emulator::whole_frame::FrameError;
use crate::partial::PartialError;

/// Error of a card.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum CardError {
    /// Error of starting an emulated card.
    #[error("it could not be started: {0}")]
    #[diagnostic(help("use fewer cards"))]
    Start(#[source] std::io::Error),
    /// Error of opening the link.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Link(#[from] LinkError),
    /// Error of a link that was closed before the card answered the greeting.
    #[error("it closed the link before it said hello")]
    #[diagnostic(help(
        "another host may be using the card: wait until it is done; or check that a card listens at the address"
    ))]
    Refused,
    /// Error of a card whose budget is too small for the picture.
    #[error("{reason}")]
    #[diagnostic(help("{remedy}; or leave the card out"))]
    Budget {
        /// Description of what has no room.
        reason: String,
        /// Remedy.
        remedy: String,
    },
    /// Error of a card that was reset during its self-test.
    #[error("it was reset during its self-test")]
    #[diagnostic(help("watch the card's own messages, and check its power supply and its watchdog"))]
    Reset,
    /// Error of the session.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
}

impl CardError {
    /// Error of a card whose budget fails a check.
    pub(super) fn of_budget(error: &RenderError) -> Self {
        let remedy = error.help().map_or("choose other settings".to_owned(), |help| help.to_string());
        Self::Budget { reason: error.to_string(), remedy }
    }
}

/// Error of a render.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum RenderError {
    /// Error of a setting that is not possible.
    #[error("{option} {value} is not possible: {reason}")]
    #[diagnostic(help("{remedy}"))]
    Setting {
        /// Option of the command line.
        option: &'static str,
        /// Value of the option.
        value: String,
        /// Description of the fault.
        reason: String,
        /// Remedy.
        remedy: String,
    },
    /// Error of a camera that is not in the scene.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// Error of the picture's size or crop window.
    #[error(transparent)]
    #[diagnostic(help("change --size or --crop"))]
    Film(#[from] FilmError),
    /// Error of a scene that does not fit the card.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Pack(#[from] PackError),
    /// Error of the photon pass.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Photons(PhotonError),
    /// Error of a malformed image, though it was just packed.
    #[error("the packed card image is malformed: {0}")]
    #[diagnostic(help("this is a fault of the program: please report it with the scene"))]
    Image(Fault),
    /// Error of the last card that was left.
    #[error("{card}: {source}")]
    Card {
        /// Number of the card, and its address if it is not emulated.
        card: String,
        /// Error of the card.
        #[source]
        #[diagnostic_source]
        source: CardError,
    },
    /// Error of cards that render a tile differently, with no other card left to decide.
    #[error("{cards} render the tile {tile} differently: at least one of them lies")]
    #[diagnostic(help(
        "render with a third card, which decides; or with one that you trust. Tiles that only one of these cards has rendered are not kept"
    ))]
    Disagreement {
        /// The tile as an argument of `--crop`.
        tile: String,
        /// Names of the cards.
        cards: String,
    },
    /// Error of a tile in the partial file that differs from the one that two cards render.
    #[error(
        "the tile {tile} in the file of finished tiles differs from what two cards render: a card has lied to the render that wrote it"
    )]
    #[diagnostic(help("remove that file, and render all tiles"))]
    KeptDiffers {
        /// The tile as an argument of `--crop`.
        tile: String,
    },
    /// Error of a tile to be verified when only one card is left.
    #[error("no second card is left to verify the tile {tile}")]
    #[diagnostic(help("go on with --resume and another card, or without --verify"))]
    Unverified {
        /// The tile as an argument of `--crop`.
        tile: String,
    },
    /// Error of tiles at which cards crash; all others are done.
    #[error("cards were lost again and again at work on the tiles {tiles}; all others are done")]
    #[diagnostic(help(
        "each is X0,X1,Y0,Y1 as --crop takes it: watch the card's own messages while it renders one of them alone, or go on with \
         --resume and another kind of card"
    ))]
    Unrendered {
        /// The tiles as arguments of `--crop`.
        tiles: String,
    },
    /// Error of starting the chips of whole-frame reordering.
    #[error("the chips could not be started: {0}")]
    #[diagnostic(help("use fewer cards"))]
    Chips(rayon::ThreadPoolBuildError),
    /// Error of the partial file.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Partial(#[from] PartialError),
    /// Error of writing the trace.
    #[error(transparent)]
    Trace(#[from] OutputError),
    /// The observer stopped the render.
    #[error("stopped before the picture was complete")]
    Stopped,
}

impl From<FrameError> for RenderError {
    fn from(error: FrameError) -> Self {
        match error {
            FrameError::Stopped => Self::Stopped,
            FrameError::Image(fault) => Self::Image(fault),
            FrameError::Start(source) => Self::Chips(source),
            FrameError::TooManyGathers { .. } => Self::Setting {
                option: "--order",
                value: "hilbert".into(),
                reason: error.to_string(),
                remedy: "render a part with --crop, fewer --spp or --gather-rays, or use --order sort".into(),
            },
        }
    }
}

impl From<TileError> for RenderError {
    fn from(error: TileError) -> Self {
        match error {
            TileError::Fault(fault) => Self::Image(fault),
            TileError::Stopped => Self::Stopped,
        }
    }
}

impl From<PhotonError> for RenderError {
    fn from(error: PhotonError) -> Self {
        match error {
            PhotonError::Stopped => Self::Stopped,
            PhotonError::Unsound(fault) => Self::Image(fault),
            PhotonError::Pack(error) => Self::Pack(error),
            error @ PhotonError::TooWide { .. } => Self::Photons(error),
        }
    }
}

impl RenderError {
    /// Returns whether the arguments or the scene are at fault.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Setting { .. } | Self::Scene(_) | Self::Film(_) | Self::Pack(_) | Self::Photons(_) => true,
            Self::Partial(error) => !matches!(error, PartialError::File { .. }),
            Self::Trace(error) => !matches!(error, OutputError::Write { .. }),
            Self::Card { source, .. } => matches!(source, CardError::Budget { .. }),
            Self::Image(_)
            | Self::Disagreement { .. }
            | Self::KeptDiffers { .. }
            | Self::Unverified { .. }
            | Self::Unrendered { .. }
            | Self::Chips(_)
            | Self::Stopped => false,
        }
    }
}
