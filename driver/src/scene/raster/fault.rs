//! Faults of image files.

use crate::allocation::{self, OutOfMemory};

/// Error of an image file: reason and remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::scene) struct Fault {
    /// Description of the fault.
    pub(in crate::scene) reason: String,
    /// Remedy.
    pub(in crate::scene) remedy: &'static str,
}

const COPY_AGAIN: &str = "export the image again, or copy it again: it is damaged or was cut off on the way";

impl Fault {
    /// Error of an image whose memory the process cannot have.
    pub(in crate::scene) fn memory(error: OutOfMemory) -> Self {
        Self { reason: format!("decoding it takes much memory: {error}"), remedy: allocation::REMEDY }
    }

    pub(super) fn damaged(reason: impl std::fmt::Display) -> Self {
        Self { reason: format!("the image cannot be decoded: {reason}"), remedy: COPY_AGAIN }
    }
}
