//! Prepared scenes: files with everything that pictures of a scene need. To render a prepared scene, no glTF
//! file is read, no pilot is run and no photons are traced.
//!
//! ```text
//! photoncard prepared scene 4\n
//! { cameras, cameras of frames, checksums, settings, parameters of the photon map and notes as JSON }\n
//! CRC-32C of all bytes before: u32
//! zeros up to a multiple of 4096 bytes
//! lines of the card image, whose CRC-32C is in the JSON
//! ```
//!
//! The lines are read into memory and checked there, so that later changes of the file have no effect.

mod file;
mod head;
mod scene;
#[cfg(test)]
mod tests;

pub use self::file::PreparedError;
pub use self::scene::PreparedScene;
