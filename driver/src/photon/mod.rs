//! The photon pass: light is traced from the emitters and stored where it arrives.
//!
//! It depends on the scene, the seed and the number of photons alone, never on threads, camera, tile or chip.

mod disc;
mod emit;
mod map;
mod trace;

pub use disc::{automatic_max_distance, measure_discs};
pub use map::PhotonMap;
pub use trace::{Arrival, PhotonPass, TraceError, trace};
