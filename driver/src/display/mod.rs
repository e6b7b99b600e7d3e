//! The display server: a window, perhaps on another machine, that shows tiles as they land.
//!
//! It speaks the protocol of tev, the viewer for pictures of high dynamic range (<https://github.com/Tom94/tev>), which other
//! renderers use as well: [`packet`] makes its packets, [`Display`] sends them. Nothing ever comes back. A display is there
//! for its looks: one that cannot be reached, goes away or takes its time is told of once, and neither stops a render nor
//! holds it up.

mod address;
mod error;
pub mod packet;
mod sender;
mod state;
#[cfg(test)]
mod tests;

pub use address::{DEFAULT_PORT, DisplayAddress};
pub use error::DisplayError;
pub use sender::{Display, DisplaySettings};
