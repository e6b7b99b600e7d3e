//! Stands in for `libloading` where programs load no libraries: in browsers.
#![expect(unsafe_code, reason = "functions as unsafe as those that they stand in for")]

use std::ffi::OsStr;

use thiserror::Error;

/// A library that is never loaded.
pub(crate) enum Library {}

/// Error of loading a library.
#[derive(Debug, Error)]
#[error("a browser loads no libraries")]
pub(crate) struct Error;

impl Library {
    /// Fails.
    ///
    /// # Safety
    /// Nothing is loaded.
    pub(crate) unsafe fn new(_: impl AsRef<OsStr>) -> Result<Self, Error> {
        Err(Error)
    }

    /// Is never called: there is no library.
    ///
    /// # Safety
    /// Nothing is called.
    pub(crate) unsafe fn get<T>(&self, _: &[u8]) -> Result<&'static T, Error> {
        Err(Error)
    }
}
