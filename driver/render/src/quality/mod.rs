//! Qualities of a picture: settings for what it is needed for.
//!
//! Settings that depend on the scene are found by a pilot render ([`Quality::fit`]): few pixels, from photon
//! maps of few photons.

mod fit;
mod kept;
mod level;
mod paths;
mod pilot;
mod spread;

pub use self::fit::{Beyond, Fit, Measured, Stated};
pub use self::level::Quality;
