//! Errors of display servers.

use std::io;

use super::DisplayAddress;

/// Error that prevents a picture, or a part of it, from being shown. The render continues.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DisplayError {
    /// The server cannot be reached.
    #[error(
        "cannot reach the display server at {address}: {source}; start tev there, or leave `outputs.display` out"
    )]
    Connect {
        /// Address of the server.
        address: DisplayAddress,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The connection has ended.
    #[error("the display server at {address} is gone: {source}")]
    Gone {
        /// Address of the server.
        address: DisplayAddress,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The server did not take all packets in time.
    #[error("the display server at {address} takes no more: {packets} packets of the picture are not shown")]
    Slow {
        /// Number of packets that the server did not take.
        address: DisplayAddress,
        /// Packets that the server has not taken.
        packets: usize,
    },
}
