//! Faults of image files.

use crate::allocation::{self, OutOfMemory};

/// Why an image is not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::scene) struct Fault {
    /// What is wrong.
    pub(in crate::scene) reason: String,
    /// What to do.
    pub(in crate::scene) remedy: &'static str,
}

const COPY_AGAIN: &str = "export the image again, or copy it again: it is damaged or was cut off on the way";

impl Fault {
    /// A file for which there is no memory.
    pub(in crate::scene) fn memory(error: OutOfMemory) -> Self {
        Self { reason: format!("decoding it takes much memory: {error}"), remedy: allocation::REMEDY }
    }

    pub(super) fn damaged(reason: impl std::fmt::Display) -> Self {
        Self { reason: format!("the image cannot be decoded: {reason}"), remedy: COPY_AGAIN }
    }
}
