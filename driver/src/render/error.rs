//! Why a render did not end in a picture.

use photoncard_shared::message::Fault;

use crate::emulator::whole_frame::FrameError;
use crate::error::SceneError;
use crate::film::FilmError;
use crate::link::LinkError;
use crate::output::OutputError;
use crate::pack::PackError;
use crate::partial::PartialError;
use crate::photon::PhotonError;
use crate::session::SessionError;

/// Why a card cannot be used, or no more.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum CardError {
    /// It could not be started.
    #[error("it could not be started: {0}")]
    #[diagnostic(help("use fewer cards"))]
    Start(#[source] std::io::Error),
    /// It could not be reached.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Link(#[from] LinkError),
    /// Its link was closed before it had said hello.
    #[error("it closed the link before it said hello")]
    #[diagnostic(help(
        "another host may be using the card: wait until it is done; or check that a card listens at the address"
    ))]
    Refused,
    /// It does not do what it should.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
}

/// Why a render did not end in a picture.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum RenderError {
    /// A setting is not possible.
    #[error("{option} {value} is not possible: {reason}")]
    #[diagnostic(help("{remedy}"))]
    Setting {
        /// The option of the command line.
        option: &'static str,
        /// Its value.
        value: String,
        /// What is wrong with it.
        reason: String,
        /// What to do.
        remedy: String,
    },
    /// The camera is not in the scene.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// The picture's size or crop is not possible.
    #[error(transparent)]
    #[diagnostic(help("change --size or --crop"))]
    Film(#[from] FilmError),
    /// The scene does not fit the card.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Pack(#[from] PackError),
    /// There are no photons.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Photons(PhotonError),
    /// The image that was just packed is not sound.
    #[error("the packed card image is not sound: {0}")]
    #[diagnostic(help("this is a fault of the program: please report it with the scene"))]
    Image(Fault),
    /// A card failed, and none is left.
    #[error("{card}: {source}")]
    Card {
        /// Its number, and its address if it is not emulated.
        card: String,
        /// What happened.
        #[source]
        #[diagnostic_source]
        source: CardError,
    },
    /// Cards contradict each other, and there is none to decide.
    #[error("{cards} render the tile {tile} differently: at least one of them lies")]
    #[diagnostic(help(
        "render with a third card, which decides; or with one that you trust. Tiles that only one of these cards has rendered are not kept"
    ))]
    Disagreement {
        /// The tile, as `--crop` takes it.
        tile: String,
        /// The cards.
        cards: String,
    },
    /// Cards contradict the file of an earlier render.
    #[error(
        "the tile {tile} in the file of finished tiles differs from what two cards render: a card has lied to the render that wrote it"
    )]
    #[diagnostic(help("render without --resume"))]
    KeptDiffers {
        /// The tile, as `--crop` takes it.
        tile: String,
    },
    /// A tile that is to be verified was rendered by one card, and no other is left.
    #[error("no second card is left to verify the tile {tile}")]
    #[diagnostic(help("go on with --resume and another card, or without --verify"))]
    Unverified {
        /// The tile, as `--crop` takes it.
        tile: String,
    },
    /// Cards crash at some tiles; all others are done.
    #[error("cards were lost again and again at work on the tiles {tiles}; all others are done")]
    #[diagnostic(help(
        "each is X0,X1,Y0,Y1 as --crop takes it: watch the card's own messages while it renders one of them alone, or go on with \
         --resume and another kind of card"
    ))]
    Unrendered {
        /// The tiles, as `--crop` takes them.
        tiles: String,
    },
    /// The chips of a whole frame could not be started.
    #[error("the chips could not be started: {0}")]
    #[diagnostic(help("use fewer cards"))]
    Chips(rayon::ThreadPoolBuildError),
    /// Finished tiles cannot be kept, or gone on with.
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

impl From<PhotonError> for RenderError {
    fn from(error: PhotonError) -> Self {
        match error {
            PhotonError::Stopped => Self::Stopped,
            PhotonError::Unsound(fault) => Self::Image(fault),
            PhotonError::Pack(error) => Self::Pack(error),
            error @ (PhotonError::Lost { .. } | PhotonError::TooWide { .. }) => Self::Photons(error),
        }
    }
}

impl RenderError {
    /// Whether the arguments or the scene are at fault, rather than the work.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Setting { .. } | Self::Scene(_) | Self::Film(_) | Self::Pack(_) | Self::Photons(_) => true,
            Self::Partial(error) => !matches!(error, PartialError::File { .. }),
            Self::Trace(error) => !matches!(error, OutputError::Write { .. }),
            Self::Image(_)
            | Self::Card { .. }
            | Self::Disagreement { .. }
            | Self::KeptDiffers { .. }
            | Self::Unverified { .. }
            | Self::Unrendered { .. }
            | Self::Chips(_)
            | Self::Stopped => false,
        }
    }
}
