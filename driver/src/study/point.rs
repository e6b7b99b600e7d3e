//! Points: single measurements, each with everything that its result depends on.

use photoncard_shared::budget::REFERENCE;
use photoncard_shared::image::LAYOUT_VERSION;
use serde_json::{Value, json};

use super::sample::SampleRate;
use crate::choice::Choice;
use crate::emulator::memory_model::CacheSettings;
use crate::photon_map::PhotonLayout;
use crate::render::{Radiance, RenderSettings};

/// One measurement of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// File name of the scene in the folder of scenes.
    pub scene: &'static str,
    /// Assignments to the scene's materials, such as `floor.exponent=8`.
    pub assignments: Vec<String>,
    /// Settings of the render.
    pub settings: RenderSettings,
    /// Quantity that is measured.
    pub task: Task,
}

/// Quantity that is measured at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Task {
    /// Work and memory traffic of tiles behind caches that are empty when a tile begins.
    Traffic {
        /// The caches between chip and DRAM.
        caches: CacheSettings,
        /// Share of the tiles; [`Hilbert`](crate::scheduler::GatherOrder::Hilbert) renders the whole frame whatever it is.
        sample: SampleRate,
        /// Minimum number of tiles, as far as the picture has that many.
        least_tiles: usize,
    },
    /// Error of pixels against a reference with many more gather rays.
    Quality {
        /// Tiles of 16x16 pixels that are compared.
        tiles: usize,
        /// Final gather rays per pixel of the reference.
        reference_rays: u32,
    },
}

impl Point {
    /// Name of the point's file: task, scene and order. Points that differ in other settings share it.
    pub fn name(&self) -> String {
        let task = match self.task {
            Task::Traffic { .. } => "traffic",
            Task::Quality { .. } => "quality",
        };
        let scene = self.scene.split('.').next().unwrap_or_default();
        format!("{task}-{scene}-{}", self.settings.order.name())
    }

    /// Key of the point in the store: everything that the result depends on. `scene` is the scene's checksum.
    pub fn key(&self, scene: &str) -> Value {
        let mut key = json!({
            "program": PROGRAM,
            "layout_version": LAYOUT_VERSION,
            "chip": REFERENCE,
            "scene": self.scene,
            "scene_content": scene,
            "set": self.assignments,
            "settings": settings(&self.settings),
        });
        key["task"] = match &self.task {
            Task::Traffic { caches, sample, least_tiles } => {
                json!({"traffic": {"caches": caches.to_string(), "sample": sample, "least_tiles": least_tiles}})
            }
            Task::Quality { tiles, reference_rays } => {
                json!({"quality": {"tiles": tiles, "reference_rays": reference_rays}})
            }
        };
        key
    }

    /// Key of the point's card image; points of equal keys share the image.
    pub fn image_key(&self) -> ImageKey {
        let settings = &self.settings;
        ImageKey {
            scene: self.scene,
            assignments: self.assignments.clone(),
            seed: settings.seed,
            photons: settings.photons,
            neighbors: settings.neighbors,
            max_distance: settings.max_distance,
            layout: settings.photon_layout,
            radiance: settings.radiance,
        }
    }
}

/// Name and version of this program.
pub(super) const PROGRAM: &str = concat!("photoncard ", env!("CARGO_PKG_VERSION"));

/// Everything that a point's card image depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageKey {
    scene: &'static str,
    assignments: Vec<String>,
    seed: u32,
    photons: usize,
    neighbors: u32,
    max_distance: Option<f32>,
    layout: PhotonLayout,
    radiance: Radiance,
}

/// All settings but the cards as JSON: a point is always measured on reference chips.
fn settings(settings: &RenderSettings) -> Value {
    let crop = settings.crop.map(|window| [window.x0, window.x1, window.y0, window.y1]);
    json!({
        "size": [settings.width, settings.height],
        "crop": crop,
        "camera": settings.camera,
        "seed": settings.seed,
        "photons": settings.photons,
        "photon_map": settings.photon_layout.name(),
        "neighbors": settings.neighbors,
        "max_distance": settings.max_distance,
        "gather_rays": settings.gather_rays,
        "shadow_rays": settings.shadow_rays,
        "spp": settings.samples,
        "tile": settings.tile,
        "sampling": settings.sampling.name(),
        "ic_error": settings.irradiance_error,
        "radiance": settings.radiance.name(),
        "order": settings.order.name(),
        "bins": settings.bins,
        "queue": settings.queue,
    })
}
