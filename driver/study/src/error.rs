//! Errors of studies.

use std::path::PathBuf;

use photoncard_render::RenderError;
use photoncard_scene::error::SceneError;

use super::axes::AxisError;
use super::parts::PartError;
use super::report::ReportError;
use super::store::StoreError;

/// Error that prevents a report.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum StudyError {
    /// A scene is missing from the folder of scenes.
    #[error("cannot find the scene {scene} in the folder {}", folder.display())]
    #[diagnostic(help(
        "give the folder of photoncard's own scenes with --scenes; they are in `scenes` of its sources"
    ))]
    NoScene {
        /// Name of the scene's file.
        scene: String,
        /// Path of the folder of scenes.
        folder: PathBuf,
    },
    /// A scene cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// The axes cannot form a sweep.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Axes(#[from] AxisError),
    /// Parts cannot be united.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Part(#[from] PartError),
    /// A point cannot be measured.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Render(#[from] RenderError),
    /// A finished point cannot be stored, or the store's folder cannot be created.
    #[error("{0}")]
    #[diagnostic(help("choose another folder with --out, or make room in it"))]
    Store(#[from] StoreError),
    /// The report cannot be written.
    #[error("{0}")]
    #[diagnostic(help("choose another folder with --out, or make room in it"))]
    Report(#[from] ReportError),
    /// The threads that emulate chips cannot be started.
    #[error("the chips' threads could not be started: {0}")]
    #[diagnostic(help("use fewer with --threads"))]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The observer stopped the study.
    #[error("stopped before the study was complete")]
    Stopped,
}

impl StudyError {
    /// Returns whether the arguments or the scenes cause the error. The exit status of the command is then 2,
    /// otherwise 1.
    pub fn is_input(&self) -> bool {
        match self {
            Self::NoScene { .. }
            | Self::Scene(_)
            | Self::Axes(_)
            | Self::Store(StoreError::Folder { .. }) => true,
            Self::Part(PartError::Store(error)) => matches!(error, StoreError::Folder { .. }),
            Self::Part(_) => true,
            Self::Render(error) => error.is_input(),
            Self::Store(_) | Self::Report(_) | Self::Threads(_) | Self::Stopped => false,
        }
    }
}
