//! Errors of studies.

use std::path::PathBuf;

use photoncard_render::RenderError;
use photoncard_scene::error::SceneError;

use super::axes::AxisError;
use super::report::ReportError;
use super::store::StoreError;

/// Error that prevents a report.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum StudyError {
    /// Error of a scene that is missing from the folder of scenes.
    #[error("cannot find the scene {scene} in the folder {}", folder.display())]
    #[diagnostic(help(
        "give the folder of photoncard's own scenes with --scenes; they are in `scenes` of its sources"
    ))]
    NoScene {
        /// The scene's file.
        scene: String,
        /// The folder of scenes.
        folder: PathBuf,
    },
    /// Error of a scene that cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// Error of axes that make no sweep.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Axes(#[from] AxisError),
    /// Error of a point that cannot be measured.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Render(#[from] RenderError),
    /// Error of a finished point that cannot be stored, or of the store's folder.
    #[error("{0}")]
    #[diagnostic(help("choose another folder with --out, or make room in it"))]
    Store(#[from] StoreError),
    /// Error of writing the report.
    #[error("{0}")]
    #[diagnostic(help("choose another folder with --out, or make room in it"))]
    Report(#[from] ReportError),
    /// Error of starting the chips' threads.
    #[error("the chips' threads could not be started: {0}")]
    #[diagnostic(help("use fewer with --threads"))]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The observer stopped the study.
    #[error("stopped before the study was complete")]
    Stopped,
}

impl StudyError {
    /// Returns whether the arguments or the scenes are at fault, rather than the work: the command's exit
    /// status 2, not 1.
    pub fn is_input(&self) -> bool {
        match self {
            Self::NoScene { .. }
            | Self::Scene(_)
            | Self::Axes(_)
            | Self::Store(StoreError::Folder { .. }) => true,
            Self::Render(error) => error.is_input(),
            Self::Store(_) | Self::Report(_) | Self::Threads(_) | Self::Stopped => false,
        }
    }
}
