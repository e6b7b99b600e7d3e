//! Qualities of a picture: settings for its purpose.
//!
//! Settings that depend on the scene are found by a pilot render ([`Quality::fit`]) of few pixels, with
//! photon maps of few photons.

mod fit;
mod kept;
mod level;
mod paths;
mod pilot;
mod spread;

pub use self::fit::{Beyond, Fit, Measured, Stated, TimeOfPicture};
pub use self::level::{Finish, Quality};
