//! Client of a display server: a viewer, perhaps on another machine, that shows tiles as they are finished.
//!
//! The protocol is that of tev, the viewer for pictures of high dynamic range
//! (<https://github.com/Tom94/tev>), which other renderers use as well: [`packet`] makes its packets,
//! [`Display`] sends them. The server never answers. A server that cannot be reached, disconnects or is slow
//! is reported once, and neither stops a render nor holds up its tiles.

mod address;
mod error;
pub mod packet;
mod queue;
mod sender;
#[cfg(test)]
mod tests;

pub use address::{DEFAULT_PORT, DisplayAddress};
pub use error::DisplayError;
pub use sender::{Display, DisplaySettings};
