//! Faults of image files.

use photoncard_picture::allocation::{self, OutOfMemory};

/// Error of an image file: reason and remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    pub(crate) reason: String,
    /// Advice on how to mend or replace the image.
    pub(crate) remedy: &'static str,
    /// True if the image exceeds a limit or the memory of the process; false if it cannot be read.
    pub(crate) is_limit: bool,
}

const COPY_AGAIN: &str = "export the image again, or copy it again: it is damaged or was cut off on the way";

impl Fault {
    /// Creates the error of memory that an image needs and the system refuses.
    pub(crate) fn memory(error: OutOfMemory) -> Self {
        Self {
            reason: format!("decoding it takes much memory: {error}"),
            remedy: allocation::REMEDY,
            is_limit: true,
        }
    }

    /// Creates the error of an image that is damaged or unsupported, not too large.
    pub(crate) fn unreadable(reason: impl Into<String>, remedy: &'static str) -> Self {
        Self { reason: reason.into(), remedy, is_limit: false }
    }

    pub(super) fn damaged(reason: impl std::fmt::Display) -> Self {
        Self::unreadable(format!("the image cannot be decoded: {reason}"), COPY_AGAIN)
    }
}
