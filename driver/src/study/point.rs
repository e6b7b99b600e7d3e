//! Points: single measurements, each with everything that its result depends on.

use photoncard_firmware::kind::REFERENCE;
use serde_json::{Value, json};

use super::sample::SampleRate;
use crate::choice::Choice;
use crate::emulator::memory_model::CacheSettings;
use crate::render::{PhotonMaps, RenderSettings};

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
        format!("{task}-{scene}-{}", self.settings.schedule.order.name())
    }

    /// Key of the point in the store: everything that the result depends on. `scene` is the scene's checksum.
    pub fn key(&self, scene: &str) -> Value {
        let mut key = json!({
            "identity": self.settings.identity_with(scene),
            "work": self.settings.of_work(),
            "chip": REFERENCE,
            "scene": self.scene,
            "set": self.assignments,
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
        let RenderSettings { photons, integrator, .. } = &self.settings;
        ImageKey {
            scene: self.scene,
            assignments: self.assignments.clone(),
            seed: integrator.seed,
            photons: photons.clone(),
        }
    }
}

/// Everything that a point's card image depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageKey {
    scene: &'static str,
    assignments: Vec<String>,
    seed: u32,
    photons: PhotonMaps,
}
