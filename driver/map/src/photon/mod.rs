//! Photon pass: traces paths from the lights and stores photons where they hit surfaces.
//!
//! Photons depend only on the scene, the seed and their number, not on threads, tiles or chips. They depend
//! on the camera only if paths are guided towards surfaces that its picture uses.

mod crevices;
mod emit;
mod error;
mod guide;
mod importons;
mod pilot;
mod stored;
mod trace;
mod tracer;

pub use error::PhotonError;
pub(crate) use importons::{ImportonGrid, Importons};
pub use pilot::Guiding;
pub use stored::Photons;
pub(crate) use stored::StoredPhoton;
pub use trace::{PhotonPass, trace, trace_caustics};
pub(crate) use trace::{trace_caustics_for, trace_for};
