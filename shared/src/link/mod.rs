//! A port: one end of a byte link.

#[cfg(feature = "embedded-io")]
mod io;

use core::fmt;
use core::time::Duration;

#[cfg(feature = "embedded-io")]
pub use io::IoPort;

/// Permanent failure of a [`Port`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PortError {
    /// The other end is gone.
    Closed,
    /// The device failed with this device-specific error code.
    Device(u32),
}

impl fmt::Display for PortError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Closed => f.write_str("the other end of the link is gone"),
            Self::Device(code) => write!(f, "the device of the link has failed (error {code})"),
        }
    }
}

impl core::error::Error for PortError {}

/// One end of a byte link. Every call returns within the time `wait`, whether or not bytes were moved.
pub trait Port {
    /// Reads 1 to `buffer.len()` bytes as soon as any have arrived, and returns their number. Returns 0 if
    /// none arrived within `wait`.
    ///
    /// # Errors
    /// If no more bytes can arrive.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError>;

    /// Writes as many of the first bytes of `bytes` as the device has room for, and returns their number.
    /// Returns 0 if there was no room within `wait`.
    ///
    /// # Errors
    /// If no more bytes can be sent.
    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError>;
}
