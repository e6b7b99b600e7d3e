//! The photon pass: paths are traced from the lights, and photons stored where they meet surfaces.
//!
//! Photons depend on the scene, the seed and their number alone, never on threads, camera, tile or chip.

mod emit;
mod error;
mod stored;
mod trace;

pub use error::PhotonError;
pub use stored::Photons;
pub(crate) use stored::StoredPhoton;
pub use trace::{PhotonPass, trace, trace_caustics};
