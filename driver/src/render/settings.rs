//! What a render is asked to do.

mod check;

use std::path::PathBuf;

use glam::Vec3;
pub use photoncard_firmware::card::MIN_IRRADIANCE_ERROR;
use photoncard_firmware::importance::ENTRIES;
use photoncard_firmware::kind::MICRO;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::{self, CausticGather, FrameParameters, Radiance, Sampling};
use serde_json::{Value, json};

use super::address::{CardAddress, first_remote, is_one_emulated_chip};
use super::error::RenderError;
use crate::display::DisplaySettings;
use crate::emulator::ChipKind;
use crate::emulator::memory_model::CacheSettings;
use crate::film::{Film, FilmError, Window};
use crate::layer::Layers;
use crate::link::LineFaults;
use crate::partial::PartialSettings;
use crate::photon_map::{PhotonLayout, PhotonSettings};
use crate::scene::{Camera, Scene};
use crate::scheduler::GatherOrder;

/// The settings of a render; each field is an option of the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderSettings {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The part to render; `None` for the whole.
    pub crop: Option<Window>,
    /// Name of the camera; `None` for the first.
    pub camera: Option<String>,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Photons in the map.
    pub photons: usize,
    /// How the photon map is laid out in card memory.
    pub photon_layout: PhotonLayout,
    /// Photons that a gather looks for.
    pub neighbors: u32,
    /// Greatest distance of a gather, metres; `None` for the one that the photons' density suggests.
    pub max_distance: Option<f32>,
    /// Photons in the caustic map; `None` for [`DEFAULT_CAUSTIC_PHOTONS`] if anything in the scene is perfectly specular, and
    /// no map otherwise.
    pub caustic_photons: Option<usize>,
    /// Photons that a gather of caustics looks for.
    pub caustic_neighbors: u32,
    /// Final gather rays a sample.
    pub gather_rays: u32,
    /// Shadow rays a sample.
    pub shadow_rays: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Side of a tile, pixels.
    pub tile: u32,
    /// The layers that the picture has besides radiance.
    pub layers: Layers,
    /// What the directions of gather rays are chosen by.
    pub sampling: Sampling,
    /// The relative error that interpolated irradiance may have; `None` to interpolate none.
    pub irradiance_error: Option<f32>,
    /// What tells the radiance at the ends of gather rays.
    pub radiance: Radiance,
    /// Order of the photon gathers.
    pub order: GatherOrder,
    /// Direction bins of the gather rays, where the order has any; `None` for the default.
    pub bins: Option<u32>,
    /// Gathers that may wait on a chip, where the order lets any; `None` for as many as it has room for.
    pub queue: Option<u32>,
    /// The cards to render on.
    pub cards: Vec<CardAddress>,
    /// What the links to the cards do to bytes, to try how that is repaired; `None` for nothing.
    pub faults: Option<LineFaults>,
    /// The share of the tiles that two cards render, to see whether they agree; `None` for no tile.
    pub verify: Option<f64>,
    /// The caches that a chip's memory is modelled with; `None` to model none, which costs nothing.
    pub caches: Option<CacheSettings>,
    /// Where finished tiles are kept until the picture is written; `None` to keep none. Not with the order `hilbert`, which has
    /// no finished tiles before the end.
    pub partial: Option<PartialSettings>,
    /// Where tiles are shown as they land; `None` to show none.
    pub display: Option<DisplaySettings>,
    /// The file that every read of the chip is written to. It takes one chip; without `caches` those of the default.
    pub trace: Option<PathBuf>,
}

impl Default for RenderSettings {
    /// The dissertation's nominal values (Table 7.1) on one emulated reference chip.
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            crop: None,
            camera: None,
            seed: 0,
            photons: 500_000,
            photon_layout: PhotonLayout::default(),
            neighbors: 100,
            max_distance: None,
            caustic_photons: None,
            caustic_neighbors: 50,
            gather_rays: 100,
            shadow_rays: 8,
            samples: 1,
            tile: 16,
            layers: Layers::default(),
            sampling: Sampling::Product,
            irradiance_error: None,
            radiance: Radiance::Density,
            order: GatherOrder::Sort,
            bins: None,
            queue: None,
            cards: vec![CardAddress::default()],
            faults: None,
            verify: None,
            partial: None,
            display: None,
            caches: None,
            trace: None,
        }
    }
}

/// Direction bins: three to an entry of the table that directions are sampled by.
const DEFAULT_BINS: u32 = 3 * ENTRIES as u32;

/// Photons of the caustic map of a scene with anything perfectly specular in it, unless others are asked for.
pub const DEFAULT_CAUSTIC_PHOTONS: usize = 200_000;

impl RenderSettings {
    /// All that the pixels depend on, by name.
    pub fn identity(&self, scene: &Scene) -> Value {
        let window = self.window();
        json!({
            "program": concat!("photoncard ", env!("CARGO_PKG_VERSION")),
            "layout": LAYOUT_VERSION,
            "scene": scene.checksum(),
            "size": [self.width, self.height],
            "crop": [window.x0, window.x1, window.y0, window.y1],
            "camera": self.camera,
            "seed": self.seed,
            "photons": self.photons,
            "neighbors": self.neighbors,
            "max-distance": self.max_distance,
            "caustic-photons": self.caustic_photons,
            "caustic-neighbors": self.caustic_neighbors,
            "gather-rays": self.gather_rays,
            "shadow-rays": self.shadow_rays,
            "spp": self.samples,
            "sampling": format!("{:?}", self.sampling),
            "irradiance-cache": self.irradiance_error,
            "radiance": format!("{:?}", self.radiance),
            "layers": self.layers.are_of_chip(),
        })
    }

    /// The part to render.
    pub fn window(&self) -> Window {
        self.crop.unwrap_or(Window::full(self.width, self.height))
    }

    /// The side of a tile where none is asked for, pixels: one that the cards have room for, as far as that is known
    /// without asking them.
    pub fn default_tile(layers: &Layers, cards: &[CardAddress]) -> u32 {
        let are_large =
            cards.iter().all(|card| matches!(card, CardAddress::Emulated { kind: ChipKind::Reference, .. }));
        let side = Self::default().tile;
        if are_large { side } else { side.min(MICRO.pixels_of_tile(layers.are_of_chip()).isqrt()) }
    }

    /// An empty film for the picture.
    ///
    /// # Errors
    /// If its size or its crop is not possible.
    pub fn film(&self) -> Result<Film, FilmError> {
        let new = if self.layers.are_of_chip() { Film::with_layers } else { Film::new };
        new(self.width, self.height, self.window())
    }

    /// The caches that memory is modelled with, if it is.
    pub fn modelled_caches(&self) -> Option<CacheSettings> {
        self.caches.or_else(|| self.trace.as_ref().map(|_| CacheSettings::default()))
    }

    /// Checks that the reads of the cards can be traced, if they are to be.
    ///
    /// # Errors
    /// If there is no one order of them.
    pub fn check_trace(&self) -> Result<(), RenderError> {
        let Some(trace) = &self.trace else { return Ok(()) };
        let refuse = |reason: &str, remedy: &str| {
            let value = trace.display().to_string();
            Err(RenderError::Setting {
                option: "--trace",
                value,
                reason: reason.into(),
                remedy: remedy.into(),
            })
        };
        if self.order == GatherOrder::Hilbert {
            return refuse(
                "with --order hilbert no one chip reads the photon map",
                "use another --order, such as sort",
            );
        }
        if !is_one_emulated_chip(&self.cards) {
            return refuse(
                "several chips read in no one order, and a chip that is not emulated tells nothing of its reads",
                "use --card emulated:1 or --card emulated-micro:1",
            );
        }
        Ok(())
    }

    /// Checks that the memory of every card can be modelled, if it is to be.
    ///
    /// # Errors
    /// If a card is not emulated in this process.
    pub fn check_memory_model(&self) -> Result<(), RenderError> {
        match first_remote(&self.cards).filter(|_| self.modelled_caches().is_some()) {
            None => Ok(()),
            Some(address) => Err(RenderError::Setting {
                option: "--counters",
                value: format!("with --card {address}"),
                reason: "only the memory of cards that are emulated in this process is modelled".into(),
                remedy: "use --card emulated:CHIPS, or leave --counters and --cache out".into(),
            }),
        }
    }

    /// Checks that there are tiles to go on with: gathers along a curve through the frame complete all tiles at once.
    pub(super) fn check_resume(&self) -> Result<(), RenderError> {
        if !self.partial.as_ref().is_some_and(|partial| partial.resume) {
            return Ok(());
        }
        Err(RenderError::Setting {
            option: "--resume",
            value: "with --order hilbert".into(),
            reason: "that order completes all tiles at the end, and keeps none".into(),
            remedy: "use another --order, the picture is the same; or leave --resume out".into(),
        })
    }

    /// What the photon maps of a scene are to be.
    pub fn photon_settings(&self, scene: &Scene) -> PhotonSettings {
        let of_scene = || if scene.is_specular() { DEFAULT_CAUSTIC_PHOTONS } else { 0 };
        PhotonSettings {
            caustic_photons: self.caustic_photons.unwrap_or_else(of_scene),
            caustic_neighbors: self.caustic_neighbors,
            seed: self.seed,
            photons: self.photons,
            neighbors: self.neighbors,
            max_distance: self.max_distance,
            layout: self.photon_layout,
            radiance: self.radiance,
        }
    }

    /// The frame's parameters for a camera of the scene.
    pub fn frame(
        &self,
        camera: &Camera,
        max_distance: f32,
        caustics: Option<CausticGather>,
    ) -> FrameParameters {
        FrameParameters {
            width: self.width,
            height: self.height,
            camera: self.pinhole(camera),
            seed: self.seed,
            samples: self.samples,
            gather_rays: self.gather_rays,
            shadow_rays: self.shadow_rays,
            neighbors: self.neighbors,
            max_distance,
            sampling: self.sampling,
            irradiance_error: self.irradiance_error,
            bins: if self.order.has_bins() { self.bins.unwrap_or(DEFAULT_BINS) } else { 1 },
            drain: self.order.drain(),
            queue: self.queue.unwrap_or(u32::MAX),
            radiance: self.radiance,
            caustics,
            layers: self.layers.are_of_chip(),
        }
    }

    /// The vertical field of view is the camera's, the horizontal one follows from the size.
    fn pinhole(&self, camera: &Camera) -> message::Camera {
        let half_height = libm::tanf(0.5 * camera.vertical_fov);
        let half_width = half_height * self.width as f32 / self.height as f32;
        let scaled = |axis: Vec3, length: f32| (axis * length).to_array();
        message::Camera {
            origin: camera.origin.to_array(),
            forward: camera.forward.to_array(),
            right: scaled(camera.right, half_width),
            up: scaled(camera.up, half_height),
        }
    }
}
