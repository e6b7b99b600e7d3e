//! Time of each phase of a render.

use serde::Serialize;

/// Times of the phases, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Time to read the scene file.
    pub scene: f64,
    /// Time of pilot renders, from which settings are chosen.
    pub pilot: f64,
    /// Time to trace photons.
    pub photons: f64,
    /// Time to build the hierarchy, the photon map and the card image.
    pub pack: f64,
    /// Part of `pack` for the hierarchy and the other sections of the scene.
    pub hierarchy: f64,
    /// Part of `pack` for the photon map.
    pub photon_map: f64,
    /// Part of `pack` to measure the maximum distance of gathers, and disc fractions.
    pub discs: f64,
    /// Part of `pack` for irradiance points, if irradiance is precomputed.
    pub irradiance: f64,
    /// Time until the slowest card was loaded.
    pub load: f64,
    /// Time of rendering, after the last card was loaded.
    pub render: f64,
    /// Total time.
    pub total: f64,
}
