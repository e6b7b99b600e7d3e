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
    /// A card could not be started.
    #[error("card {card} could not be started: {source}")]
    #[diagnostic(help("use fewer cards"))]
    Start {
        /// Its number.
        card: usize,
        /// The system's error.
        source: std::io::Error,
    },
    /// A card could not be reached.
    #[error("card {card}: {source}")]
    Link {
        /// Its number.
        card: usize,
        /// What happened.
        #[source]
        #[diagnostic_source]
        source: LinkError,
    },
    /// A card's link was closed before the card had said hello.
    #[error("{card} closed the link before it said hello")]
    #[diagnostic(help(
        "another host may be using the card: wait until it is done; or what listens there is no card"
    ))]
    Refused {
        /// Its number, and its address if it is not emulated.
        card: String,
    },
    /// A card failed.
    #[error("{card}: {source}")]
    Card {
        /// Its number, and its address if it is not emulated.
        card: String,
        /// What happened.
        #[source]
        #[diagnostic_source]
        source: SessionError,
    },
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
            FrameError::Film(error) => Self::Film(error),
            FrameError::Start(source) => Self::Start { card: 0, source: std::io::Error::other(source) },
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
            | Self::Start { .. }
            | Self::Link { .. }
            | Self::Refused { .. }
            | Self::Card { .. }
            | Self::Stopped => false,
        }
    }
}
