//! Combinations of techniques, their settings and the points that measure them.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_map::photon_map::PhotonLayout;
use photoncard_render::{Radiance, RenderSettings, Sampling};

use super::super::super::point::Point;
use super::super::super::scale::{IRRADIANCE_ERROR, REFERENCE_TILE, Scale, TILE};
use super::super::flights::{IN_CARD_MEMORY, LARGE_IN_FLIGHT, Setup};

/// A combination of techniques.
pub(super) struct Technique {
    pub(super) name: &'static str,
    pub(super) order: GatherOrder,
    pub(super) sampling: Sampling,
    /// Error bound of the irradiance cache; `None` without the cache.
    pub(super) irradiance_error: Option<f32>,
    pub(super) radiance: Radiance,
    pub(super) layout: PhotonLayout,
    pub(super) tile: u32,
    /// Chip that renders all tiles, several of which wait together, to measure the technique. `None` to
    /// measure a sample of the tiles on reference chips, one at a time.
    pub(super) in_flight: Option<Setup>,
}

/// Maximum number of gather rays at which bytes are measured.
pub(super) const MAX_TRAFFIC_RAYS: u32 = 100;
pub(super) const NAIVE: Technique = Technique {
    name: "naive",
    order: GatherOrder::Naive,
    sampling: Sampling::Reflection,
    irradiance_error: None,
    radiance: Radiance::Density,
    layout: PhotonLayout::Jensen,
    tile: TILE,
    in_flight: None,
};
pub(super) const TILED: Technique = Technique { name: "tiled", order: GatherOrder::Tiled, ..NAIVE };
pub(super) const CACHE: Technique =
    Technique { name: "irradiance cache, tiled", irradiance_error: Some(IRRADIANCE_ERROR), ..TILED };
pub(super) const COMBINED: Technique =
    Technique { name: "combined sampling", sampling: Sampling::Product, ..NAIVE };
/// The data structure alone.
pub(super) const LINES: Technique = Technique { name: "lines", layout: PhotonLayout::Lines, ..NAIVE };
pub(super) const EXACT: Technique = Technique {
    name: "sort, lines, largest tiles",
    order: GatherOrder::Sort,
    layout: PhotonLayout::Lines,
    tile: REFERENCE_TILE,
    ..NAIVE
};
pub(super) const ALL: Technique = Technique {
    name: "all techniques, jensen",
    order: GatherOrder::Sort,
    sampling: Sampling::Product,
    irradiance_error: Some(IRRADIANCE_ERROR),
    radiance: Radiance::Density,
    layout: PhotonLayout::Jensen,
    tile: REFERENCE_TILE,
    in_flight: None,
};
pub(super) const ALL_IN_LINES: Technique =
    Technique { name: "all techniques, lines", layout: PhotonLayout::Lines, ..ALL };
pub(super) const ALL_ON_LARGE: Technique = Technique {
    name: "all techniques, lines, tiles in flight, large chip",
    in_flight: Some(LARGE_IN_FLIGHT),
    ..ALL_IN_LINES
};
pub(super) const ALL_IN_CARD_MEMORY: Technique = Technique {
    name: "all techniques, lines, gathers in card memory",
    in_flight: Some(IN_CARD_MEMORY),
    ..ALL_IN_LINES
};
/// All techniques with gathers in card memory, by ascending error bound of the irradiance cache.
pub(super) const BY_CACHE_ERROR: [Technique; 3] = [
    ALL_IN_CARD_MEMORY,
    Technique {
        name: "all techniques, lines, gathers in card memory, cache error 0.1",
        irradiance_error: Some(0.1),
        ..ALL_IN_CARD_MEMORY
    },
    Technique {
        name: "all techniques, lines, gathers in card memory, cache error 0.2",
        irradiance_error: Some(0.2),
        ..ALL_IN_CARD_MEMORY
    },
];
/// Combinations with gathers on the chip. Those with the irradiance cache have square tiles, because the
/// pixels of a row share few irradiance records.
const ON_CHIP: [Technique; 13] = [
    NAIVE,
    Technique { name: "sort", order: GatherOrder::Sort, ..NAIVE },
    TILED,
    CACHE,
    COMBINED,
    LINES,
    EXACT,
    Technique {
        name: "sort, lines, largest tiles, precomputed irradiance",
        radiance: Radiance::Precomputed,
        ..EXACT
    },
    ALL,
    ALL_IN_LINES,
    Technique { name: "all techniques, lines, cache error 0.1", irradiance_error: Some(0.1), ..ALL_IN_LINES },
    Technique {
        name: "all techniques, lines, precomputed irradiance",
        radiance: Radiance::Precomputed,
        ..ALL_IN_LINES
    },
    ALL_ON_LARGE,
];

/// Combinations that are measured.
pub(super) fn techniques() -> impl Iterator<Item = &'static Technique> {
    ON_CHIP.iter().chain(&BY_CACHE_ERROR)
}

impl Technique {
    pub(super) fn settings(&self, scale: &Scale, gather_rays: u32) -> RenderSettings {
        scale.settings(self.order).with(|s| {
            s.photons.radiance = self.radiance;
            s.photons.layout = self.layout;
            s.integrator.gather_rays = gather_rays;
            s.integrator.sampling = self.sampling;
            s.integrator.irradiance_error = self.irradiance_error;
            s.schedule.tile = Some(self.tile);
        })
    }

    pub(super) fn traffic(&self, scale: &Scale, scene: &'static str, rays: u32) -> Point {
        let settings = self.settings(scale, rays);
        match self.in_flight {
            Some(setup) => setup.point(scale, scene, settings),
            None => scale.traffic(scene, settings),
        }
    }

    /// Points that measure the technique's error, one for each seed. Techniques that differ only in order,
    /// layout or tiles share the points, because these do not change pixels.
    pub(super) fn quality(&self, scale: &Scale, scene: &'static str, rays: u32) -> Vec<Point> {
        let settings = self.settings(scale, rays);
        let shared = scale.settings(GatherOrder::Sort);
        let settings = settings.with(|s| {
            s.photons.layout = shared.photons.layout;
            s.schedule.order = shared.schedule.order;
            s.schedule.tile = shared.schedule.tile;
        });
        scale.quality(scene, &settings)
    }

    /// Returns whether the technique's pixels differ from those of the naive render.
    pub(super) fn changes_pixels(&self) -> bool {
        self.irradiance_error.is_some() || self.sampling != NAIVE.sampling || self.radiance != NAIVE.radiance
    }

    /// Numbers of gather rays at which the technique's error is measured, ascending. Combined sampling by
    /// itself has a narrow range, because it needs about as many rays as the naive render for the same error.
    /// Techniques with interpolated or precomputed light may need fewer or more rays.
    pub(super) fn sweep(&self, scale: &Scale) -> Vec<u32> {
        if !self.changes_pixels() {
            return vec![scale.gather_rays];
        }
        if self.irradiance_error.is_none() && self.radiance == NAIVE.radiance {
            return with_equal_rays(scale, scale.pick(&[50, 100, 200], &[12, 25, 50, 100]));
        }
        with_equal_rays(scale, scale.pick(&[12, 25, 50, 100, 200, 400], &[6, 12, 25, 50, 100]))
    }

    /// Numbers of gather rays at which the technique's bytes are measured, ascending. The logarithm of the
    /// bytes is nearly linear in that of the rays, within these numbers and beyond.
    pub(super) fn traffic_sweep(&self, scale: &Scale) -> Vec<u32> {
        if !self.changes_pixels() {
            return vec![scale.gather_rays];
        }
        with_equal_rays(scale, scale.pick(&[50, MAX_TRAFFIC_RAYS], &[12, 50]))
    }
}

/// Returns `rays` and the scale's own number of gather rays, ascending and without duplicates.
fn with_equal_rays(scale: &Scale, mut rays: Vec<u32>) -> Vec<u32> {
    rays.push(scale.gather_rays);
    rays.sort_unstable();
    rays.dedup();
    rays
}
