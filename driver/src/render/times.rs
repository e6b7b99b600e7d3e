//! Time of each phase of a render.

use serde::Serialize;

/// Seconds of each phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Reading the scene file.
    pub scene: f64,
    /// Tracing photons.
    pub photons: f64,
    /// Building hierarchy, photon map and card image.
    pub pack: f64,
    /// Of these, the hierarchy and the other parts of the scene.
    pub hierarchy: f64,
    /// Of these, the photon map.
    pub photon_map: f64,
    /// Of these, how far gathers look, and how much of the discs around photons is surface.
    pub discs: f64,
    /// Of these, irradiance at photons, if it is precomputed.
    pub irradiance: f64,
    /// Loading the slowest card.
    pub load: f64,
    /// Rendering, after the last card was loaded.
    pub render: f64,
    /// All of it.
    pub total: f64,
}
