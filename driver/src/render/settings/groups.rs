//! The groups of settings. Defaults are the dissertation's nominal values (Table 7.1) on one emulated reference chip.

use std::path::PathBuf;

use photoncard_shared::message::{Radiance, Sampling};

use crate::display::DisplaySettings;
use crate::emulator::memory_model::CacheSettings;
use crate::film::Window;
use crate::layer::Layers;
use crate::link::LineFaults;
use crate::partial::PartialSettings;
use crate::photon_map::PhotonLayout;
use crate::render::address::CardAddress;
use crate::scheduler::GatherOrder;

/// The picture and the camera that sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The part to render; `None` for the whole.
    pub crop: Option<Window>,
    /// Name of the camera; `None` for the first.
    pub camera: Option<String>,
    /// The layers that the picture has besides radiance.
    pub layers: Layers,
}

impl Default for Picture {
    fn default() -> Self {
        Self { width: 512, height: 512, crop: None, camera: None, layers: Layers::default() }
    }
}

/// The photon map and the caustic map.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotonMaps {
    /// Photons in the map.
    pub count: usize,
    /// Layout of the photon map in card memory; no pixel depends on it.
    pub layout: PhotonLayout,
    /// Photons that a gather looks for.
    pub neighbors: u32,
    /// Greatest distance of a gather, metres; `None` for the one that the photons' density suggests.
    pub max_distance: Option<f32>,
    /// Photons in the caustic map; `None` for [`DEFAULT_CAUSTIC_PHOTONS`](super::DEFAULT_CAUSTIC_PHOTONS) if anything in
    /// the scene is perfectly specular, and no map otherwise.
    pub caustic_photons: Option<usize>,
    /// Photons that a gather of caustics looks for.
    pub caustic_neighbors: u32,
    /// Estimate of the radiance at the ends of gather rays.
    pub radiance: Radiance,
}

impl Default for PhotonMaps {
    fn default() -> Self {
        Self {
            count: 500_000,
            layout: PhotonLayout::default(),
            neighbors: 100,
            max_distance: None,
            caustic_photons: None,
            caustic_neighbors: 50,
            radiance: Radiance::Density,
        }
    }
}

/// The estimate of light by rays.
#[derive(Clone, Debug, PartialEq)]
pub struct Integrator {
    /// Seed of all random numbers, those of photon paths included.
    pub seed: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Final gather rays a sample.
    pub gather_rays: u32,
    /// Shadow rays a sample.
    pub shadow_rays: u32,
    /// Density by which the directions of gather rays are sampled.
    pub sampling: Sampling,
    /// Relative error that interpolated irradiance may have; `None` to interpolate none.
    pub irradiance_error: Option<f32>,
}

impl Default for Integrator {
    fn default() -> Self {
        Self {
            seed: 0,
            samples: 1,
            gather_rays: 100,
            shadow_rays: 8,
            sampling: Sampling::Product,
            irradiance_error: None,
        }
    }
}

/// The order of the work. No pixel depends on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// Side of a tile, pixels.
    pub tile: u32,
    /// Order of the photon gathers.
    pub order: GatherOrder,
    /// Direction bins of the gather rays, where the order has any; `None` for the default.
    pub bins: Option<u32>,
    /// Gathers that may wait on a chip, where the order lets any; `None` for as many as it has room for.
    pub queue: Option<u32>,
}

impl Default for Schedule {
    fn default() -> Self {
        Self { tile: 16, order: GatherOrder::Sort, bins: None, queue: None }
    }
}

/// The cards that render, and the tests that they are put to. No pixel depends on them.
#[derive(Clone, Debug, PartialEq)]
pub struct CardSet {
    /// Addresses of the cards.
    pub addresses: Vec<CardAddress>,
    /// Faults of the links to the cards, to try their repair; `None` for nothing.
    pub faults: Option<LineFaults>,
    /// Share of the tiles that two cards render, to see whether they agree; `None` for no tile.
    pub verify: Option<f64>,
    /// Caches that a chip's memory is modelled with; `None` to model none, which costs nothing.
    pub caches: Option<CacheSettings>,
    /// File that every read of the chip is written to. It takes one chip; without `caches` those of the default.
    pub trace: Option<PathBuf>,
}

impl Default for CardSet {
    fn default() -> Self {
        Self {
            addresses: vec![CardAddress::default()],
            faults: None,
            verify: None,
            caches: None,
            trace: None,
        }
    }
}

/// Destinations of finished tiles besides the film. No pixel depends on them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileOutputs {
    /// File in which finished tiles are kept until the picture is written; `None` to keep none. Not with the order
    /// [`Hilbert`](GatherOrder::Hilbert), which has no finished tiles before the end.
    pub partial: Option<PartialSettings>,
    /// Viewer that shows tiles as they land; `None` to show none.
    pub display: Option<DisplaySettings>,
}
