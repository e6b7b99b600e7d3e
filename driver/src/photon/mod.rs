//! The photon pass: light is traced from the emitters and stored where it arrives.
//!
//! It depends on the scene, the seed and the number of photons alone, never on threads, camera, tile or chip.

mod emit;
mod error;
mod stored;
mod trace;

pub use error::PhotonError;
pub use stored::Photons;
pub(crate) use stored::StoredPhoton;
pub use trace::{PhotonPass, trace, trace_caustics};
