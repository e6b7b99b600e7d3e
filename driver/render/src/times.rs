//! Time of each phase of a render.

use serde::Serialize;

/// Seconds of each phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Reading the scene file.
    pub scene: f64,
    /// Pilot renders, by which settings are chosen.
    pub pilot: f64,
    /// Tracing photons.
    pub photons: f64,
    /// Building hierarchy, photon map and card image.
    pub pack: f64,
    /// Part of `pack`: the hierarchy and the other sections of the scene.
    pub hierarchy: f64,
    /// Part of `pack`: the photon map.
    pub photon_map: f64,
    /// Part of `pack`: the maximum distance of gathers, and disc fractions.
    pub discs: f64,
    /// Part of `pack`: irradiance points, if irradiance is precomputed.
    pub irradiance: f64,
    /// Loading the slowest card.
    pub load: f64,
    /// Rendering, after the last card was loaded.
    pub render: f64,
    /// Total.
    pub total: f64,
}
