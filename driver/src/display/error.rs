//! Why a picture is not shown.

use std::io;

use super::DisplayAddress;

/// Why a picture, or a part of it, is not shown. The render does without.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DisplayError {
    /// There is no connection.
    #[error(
        "cannot reach the display server at {address}: {source}; start tev there, or leave --display-server out"
    )]
    Connect {
        /// Where it is to be.
        address: DisplayAddress,
        /// What the system says.
        source: io::Error,
    },
    /// The connection is no more.
    #[error("the display server at {address} is gone: {source}")]
    Gone {
        /// Where it was.
        address: DisplayAddress,
        /// What the system says.
        source: io::Error,
    },
    /// It did not take all in time.
    #[error("the display server at {address} takes no more: {packets} packets of the picture are not shown")]
    Slow {
        /// Where it is.
        address: DisplayAddress,
        /// Packets that it has not taken.
        packets: usize,
    },
}
