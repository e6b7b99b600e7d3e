//! A port: the bytes of one end of a link.

use core::time::Duration;

/// Permanent failure of a [`Port`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortError {
    /// The other end is gone.
    Closed,
    /// The device failed; the number is the device's own error code.
    Device(u32),
}

/// One end of a byte link. Every call returns within `wait`, whether or not a byte has moved.
pub trait Port {
    /// Reads 1 to `buffer.len()` bytes as soon as any are there and returns their number; 0 if none came
    /// within `wait`.
    ///
    /// # Errors
    /// If no more bytes can come.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError>;

    /// Writes as many of the first `bytes` as there is room for and returns their number; 0 if no room came
    /// within `wait`.
    ///
    /// # Errors
    /// If no more bytes can be sent.
    fn write(&mut self, bytes: &[u8], wait: Duration) -> Result<usize, PortError>;
}
