//! Qualities of a picture: sets of settings for a purpose, such as a draft.
//!
//! [`Quality::fit`] finds the settings that depend on the scene. It renders few pixels with few photons as a
//! pilot.

mod fit;
mod kept;
mod level;
mod paths;
mod pilot;
mod spread;

pub use self::fit::{Beyond, Fit, Measured, Stated, TimeOfPicture};
pub use self::level::{Finish, Quality};
