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

use crate::emulator::direct::DirectError;
use crate::partial::PartialError;

/// Error of a card.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum CardError {
    /// An emulated card cannot be started.
    #[error("it could not be started: {0}")]
    #[diagnostic(help("use fewer cards"))]
    Start(#[source] std::io::Error),
    /// The link cannot be opened.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Link(#[from] LinkError),
    /// The link was closed before the card answered the greeting.
    #[error("it closed the link before it said hello")]
    #[diagnostic(help(
        "another host may be using the card: wait until it is done; or check that a card listens at the address"
    ))]
    Refused,
    /// The link was closed, and no other card is left.
    #[error("it was gone for {seconds} s, and no other card is left: {source}")]
    #[diagnostic(help(
        "plug the board in again and go on with `outputs.partial.resume`; `,wait=SECONDS` after the port's path \
         states a longer wait"
    ))]
    Gone {
        /// Time for which the render waited for the card, seconds.
        seconds: u64,
        /// Reason why the link could not be opened again.
        source: LinkError,
    },
    /// The card's budget is too small for the picture.
    #[error("{reason}")]
    #[diagnostic(help("{remedy}; or leave the card out"))]
    Budget {
        /// Description of what does not fit.
        reason: String,
        /// Suggestion how to make the picture fit the card.
        remedy: String,
    },
    /// The card was reset during its self-test.
    #[error("it was reset during its self-test")]
    #[diagnostic(help("watch the card's own messages, and check its power supply and its watchdog"))]
    Reset,
    /// The session failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
}

impl CardError {
    /// Error of a card whose budget failed the check of the settings with `error`.
    pub(super) fn of_budget(error: &RenderError) -> Self {
        let remedy = error.help().map_or("choose other settings".to_owned(), |help| help.to_string());
        Self::Budget { reason: error.to_string(), remedy }
    }
}

/// Error of a render.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum RenderError {
    /// A setting is not possible.
    #[error("`{field}` {value} is not possible: {reason}")]
    #[diagnostic(help("{remedy}"))]
    Setting {
        /// Path of the setting's field in [`RenderSettings`](crate::RenderSettings), such as
        /// `integrator.samples`. Error messages enclose such paths in backticks.
        field: &'static str,
        /// Value of the field.
        value: String,
        /// Reason why the value is not possible.
        reason: String,
        /// Suggestion how to correct the setting.
        remedy: String,
    },
    /// The scene lacks the camera of the settings, or the camera is orthographic.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// The size of the picture or its crop window is not possible.
    #[error(transparent)]
    #[diagnostic(help("change `picture.width` or `picture.crop`"))]
    Film(#[from] FilmError),
    /// The scene does not fit the card.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Pack(#[from] PackError),
    /// The photon pass failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Photons(PhotonError),
    /// The card image is malformed although it was just packed.
    #[error("the packed card image is malformed: {0}")]
    #[diagnostic(help("this is a fault of the program: please report it with the scene"))]
    Image(Fault),
    /// A sensor is not possible.
    #[error("sensor {number} is not possible: {reason}")]
    #[diagnostic(help("correct the point, or leave it out"))]
    Sensors {
        /// Number of the sensor, from 1 on.
        number: u64,
        /// Reason why it is not possible.
        reason: String,
    },
    /// The last remaining card failed.
    #[error("{card}: {source}")]
    Card {
        /// Name of the card: its number, and its address if it is remote.
        card: String,
        /// Error of the card.
        #[source]
        #[diagnostic_source]
        source: CardError,
    },
    /// Two cards rendered a tile differently, and no other card is left to decide which is right.
    #[error("{cards} render the tile {tile} differently: at least one of them lies")]
    #[diagnostic(help(
        "render with a third card, which decides; or with one that you trust. Tiles that only one of these cards has rendered are not kept"
    ))]
    Disagreement {
        /// Rectangle of the tile, `X0,X1,Y0,Y1`.
        tile: String,
        /// Names of the cards.
        cards: String,
    },
    /// A tile in the partial file differs from the same tile as rendered by two cards.
    #[error(
        "the tile {tile} in the file of finished tiles differs from what two cards render: a card has lied to the render that wrote it"
    )]
    #[diagnostic(help("remove that file, and render all tiles"))]
    KeptDiffers {
        /// Rectangle of the tile, `X0,X1,Y0,Y1`.
        tile: String,
    },
    /// A tile must be verified, but only one card is left.
    #[error("no second card is left to verify the tile {tile}")]
    #[diagnostic(help("go on with `outputs.partial.resume` and another card, or without `cards.verify`"))]
    Unverified {
        /// Rectangle of the tile, `X0,X1,Y0,Y1`.
        tile: String,
    },
    /// Cards repeatedly crashed at some tiles. All other tiles are done.
    #[error("cards were lost again and again at work on the tiles {tiles}; all others are done")]
    #[diagnostic(help(
        "each is X0,X1,Y0,Y1 as `picture.crop` takes it: watch the card's own messages while it renders one of them alone, or \
         go on with `outputs.partial.resume` and another kind of card"
    ))]
    Unrendered {
        /// Rectangles of the tiles, `X0,X1,Y0,Y1`, with "and" between them.
        tiles: String,
    },
    /// The partial file cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Partial(#[from] PartialError),
    /// The trace cannot be written.
    #[error(transparent)]
    Trace(#[from] OutputError),
    /// The observer stopped the render.
    #[error("stopped before the picture was complete")]
    Stopped,
}

impl From<DirectError> for RenderError {
    fn from(error: DirectError) -> Self {
        match error {
            DirectError::Fault(fault) => Self::Image(fault),
            DirectError::Stopped => Self::Stopped,
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
    /// Returns whether the cause of the error is in the settings, the scene or the files of the caller.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Setting { .. }
            | Self::Scene(_)
            | Self::Film(_)
            | Self::Pack(_)
            | Self::Photons(_)
            | Self::Sensors { .. } => true,
            Self::Partial(error) => !matches!(error, PartialError::File { .. }),
            Self::Trace(error) => !matches!(error, OutputError::Write { .. }),
            Self::Card { source, .. } => matches!(source, CardError::Budget { .. }),
            Self::Image(_)
            | Self::Disagreement { .. }
            | Self::KeptDiffers { .. }
            | Self::Unverified { .. }
            | Self::Unrendered { .. }
            | Self::Stopped => false,
        }
    }
}
