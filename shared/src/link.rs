//! A port: the bytes of one end of a link.

use core::time::Duration;

/// Why a port cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortError {
    /// The other end is gone.
    Closed,
    /// The device failed, with a number of its own.
    Device(u32),
}

/// One end of a byte link. Every call returns within `wait`, whether or not a byte has moved.
pub trait Port {
    /// Reads up to `buffer.len()` bytes, as soon as there is one; 0 if none came within `wait`.
    ///
    /// # Errors
    /// If no more byte can come.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError>;

    /// Writes the first of `bytes`, as many as there is room for; 0 if there was none within `wait`.
    ///
    /// # Errors
    /// If no more byte can go.
    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError>;
}
