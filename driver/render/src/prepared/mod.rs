//! Prepared scenes: files with all that pictures of a scene need, so that no render of it reads a glTF file,
//! runs a pilot or traces photons.
//!
//! ```text
//! photoncard prepared scene 3\n
//! { cameras, those of frames, checksums, settings, parameters of the photon map and notes as JSON }\n
//! CRC-32C of all bytes before: u32
//! zeros up to a multiple of 4096 bytes
//! lines of the card image, whose CRC-32C is in the JSON
//! ```
//!
//! The lines are read into memory, and checked there: what becomes of the file later has no effect.

mod error;
mod file;
mod head;
mod scene;
#[cfg(test)]
mod tests;

pub use self::error::PreparedError;
pub use self::scene::PreparedScene;
