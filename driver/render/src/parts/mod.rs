//! Parts of a picture that can be rendered on different machines, and their merge. The merged picture equals,
//! bit for bit, that of a single render.
//!
//! A part is a set of the picture's pixels, assigned by a fixed rule ([`Part`]). Its file has everything that
//! the picture's file has, except for the pixels of other parts:
//!
//! ```text
//! photoncard part 2\n
//! { part, settings, layers, command and units as JSON }\n
//! CRC-32C of all bytes before: u32
//! records of patches, as in a partial render
//! ```
//!
//! Positions and sizes of the records follow from the head. A file with another length than its head implies
//! is refused. Files of the same part differ only in the recorded command.

mod dealing;
mod error;
mod file;
mod head;
mod merge;
#[cfg(test)]
mod tests;

pub(crate) use self::dealing::named;
pub use self::dealing::{MAX_PARTS, Part};
pub use self::error::PartError;
pub use self::file::write;
pub use self::head::PartHead;
pub use self::merge::{Merged, Parts};
