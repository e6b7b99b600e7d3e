//! Errors of studies.

use std::path::PathBuf;

use super::report::ReportError;
use super::store::StoreError;
use crate::error::SceneError;
use crate::render::RenderError;

/// Error that leaves a study without a report.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum StudyError {
    /// The folder of scenes lacks a scene.
    #[error("cannot find the scene {scene} in the folder {}", folder.display())]
    #[diagnostic(help(
        "give the folder of photoncard's own scenes with --scenes; they are in `scenes` of its sources"
    ))]
    NoScene {
        /// The scene's file.
        scene: &'static str,
        /// The folder of scenes.
        folder: PathBuf,
    },
    /// A scene cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// A point cannot be measured.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Render(#[from] RenderError),
    /// A finished point cannot be stored, or the store's folder cannot be made.
    #[error("{0}")]
    #[diagnostic(help("choose another folder with --out, or make room in it"))]
    Store(#[from] StoreError),
    /// The report cannot be written.
    #[error("{0}")]
    #[diagnostic(help("choose another folder with --out, or make room in it"))]
    Report(#[from] ReportError),
    /// The chips' threads cannot be started.
    #[error("the chips' threads could not be started: {0}")]
    #[diagnostic(help("use fewer with --threads"))]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The observer stopped the study.
    #[error("stopped before the study was complete")]
    Stopped,
}

impl StudyError {
    /// Returns whether the arguments or the scenes are at fault, rather than the work: the command's exit status 2, not
    /// 1.
    pub fn is_input(&self) -> bool {
        match self {
            Self::NoScene { .. } | Self::Scene(_) | Self::Store(StoreError::Folder { .. }) => true,
            Self::Render(error) => error.is_input(),
            Self::Store(_) | Self::Report(_) | Self::Threads(_) | Self::Stopped => false,
        }
    }
}
