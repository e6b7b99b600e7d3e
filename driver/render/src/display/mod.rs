//! Client of a display server. The server is a viewer, possibly on another machine, that shows tiles as soon
//! as they are finished.
//!
//! The protocol is that of tev, a viewer for pictures of high dynamic range (<https://github.com/Tom94/tev>),
//! which other renderers support too. `packet` creates its packets, [`Display`] sends them, to a server or to
//! standard output, for a program that has started this one. The server never answers. A server that cannot
//! be reached, disconnects or is slow is reported once. It neither stops a render nor delays its tiles.

mod address;
mod packet;
mod queue;
mod sender;
#[cfg(test)]
mod tests;

pub use address::{DisplayAddress, DisplayError};
pub use sender::{Display, DisplaySettings};
