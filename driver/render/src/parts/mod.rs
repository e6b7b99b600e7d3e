//! Parts of a picture, rendered anywhere, and their merge to the picture that one render gives, to the bit.
//!
//! A part is a share of the picture's pixels, dealt by a fixed rule ([`Part`]). Its file has all that the
//! picture's does, but for the other parts' pixels:
//!
//! ```text
//! photoncard part 1\n
//! { part, settings, command and units as JSON }\n
//! CRC-32C of all bytes before: u32
//! records of patches, as in a partial render
//! ```
//!
//! Position and size of each record follow from the head, so that a file is exactly as long as its head says,
//! and none is read that is not. Files of equal parts differ in the recorded command alone.

mod dealing;
mod error;
mod file;
mod head;
mod merge;
#[cfg(test)]
mod tests;

pub use self::dealing::{MAX_PARTS, Part};
pub use self::error::PartError;
pub use self::file::write;
pub use self::head::PartHead;
pub use self::merge::{Merged, Parts};
