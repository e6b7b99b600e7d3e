//! Errors of the denoiser.

use std::path::PathBuf;

use thiserror::Error;

use crate::places::{FILE, VARIABLE};

/// Error of loading or running the denoiser.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DenoiseError {
    /// No place has the library.
    #[error(
        "Open Image Denoise 2 is not on this machine; install it, such as by: pip install pyoidn, or name its file {} by {VARIABLE}",
        FILE
    )]
    Missing,
    /// The file is no library for this machine, or lacks a function of version 2.
    #[error("cannot load Open Image Denoise from {}: {reason}; version 2 for this processor is needed", path.display())]
    Unusable {
        /// Path of the library.
        path: PathBuf,
        /// Error of the operating system's loader.
        reason: String,
    },
    /// The library has failed.
    #[error(
        "Open Image Denoise has failed: {reason}; leave out the denoiser, or use another version of its library"
    )]
    Failed {
        /// Error message of the library.
        reason: String,
    },
    /// Pixels of the film were never written.
    #[error("{missing} pixels of the picture are missing; it is denoised when it is complete")]
    Incomplete {
        /// Number of the pixels.
        missing: usize,
    },
}
