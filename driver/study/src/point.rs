//! Points: individual measurements, each with everything that its result depends on.

use photoncard_picture::choice::Choice;
use photoncard_render::emulator::EmulatedKind;
use photoncard_render::emulator::memory_model::CacheSettings;
use photoncard_render::{NamedSettings, PROGRAM, PhotonMaps, RenderError, RenderSettings};
use photoncard_shared::image::LAYOUT_VERSION;
use serde_json::{Value, json};

use super::measure::is_on_one_chip;
use super::sample::SampleRate;

/// Maximum number of characters of a scene's name within the name of a point's file.
const MAX_SCENE_NAME: usize = 60;

/// Name of the order of gathers along one curve through the whole frame.
pub const ALONG_CURVE: &str = "hilbert";

/// A measurement of a scene, with all settings that its result depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Name of the scene: its file in the folder of scenes, or the name under which it was added to the
    /// laboratory.
    pub scene: String,
    /// Assignments to the scene's materials, such as `floor.exponent=8`.
    pub assignments: Vec<String>,
    /// Settings of the render.
    pub settings: RenderSettings,
    /// True to do all gathers of the frame along one Hilbert curve instead of in the order of the settings.
    /// No chip can hold all gathers of a frame. The traffic along the curve is a bound for the orders of
    /// chips.
    pub is_along_curve: bool,
    /// Quantity to measure.
    pub task: Task,
}

/// Quantity that is measured at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Task {
    /// Work and memory traffic of tiles, with caches that are empty when a tile begins.
    Traffic {
        /// Kind of the chip.
        chip: EmulatedKind,
        /// Caches between chip and DRAM.
        caches: CacheSettings,
        /// Fraction of the tiles to render. A frame [along a curve](Point::is_along_curve), or with several
        /// tiles in flight, is always rendered as a whole.
        sample: SampleRate,
        /// Minimum number of tiles to render, if the picture has that many.
        least_tiles: usize,
        /// True to count the reuse of cache lines, which takes time.
        has_reuse: bool,
    },
    /// Error of indirect light, compared with a reference with many more gather rays.
    Quality {
        /// Number of tiles of 16x16 pixels that are compared.
        tiles: usize,
        /// Number of final gather rays per pixel of the reference.
        reference_rays: u32,
    },
}

impl Point {
    /// Kind of the chips that render the point.
    pub fn chip(&self) -> EmulatedKind {
        match self.task {
            Task::Traffic { chip, .. } => chip,
            Task::Quality { .. } => EmulatedKind::Reference,
        }
    }

    /// Returns whether one chip renders a whole frame, on one thread, to measure the point.
    pub(super) fn is_on_one_chip(&self) -> bool {
        let is_traffic = matches!(self.task, Task::Traffic { .. });
        is_traffic && !self.is_along_curve && is_on_one_chip(&self.settings, self.chip())
    }

    /// Checks the settings against each other, and against the kind of chip.
    ///
    /// # Errors
    /// If a setting is not possible. The error describes the first such setting.
    pub fn check(&self) -> Result<(), RenderError> {
        if self.is_along_curve && self.chip() != EmulatedKind::Reference {
            return Err(RenderError::Setting {
                field: "schedule.order",
                value: ALONG_CURVE.to_owned(),
                reason: format!(
                    "{} has no room for the gathers of a frame, and only reference chips leave them to the host",
                    self.chip().name()
                ),
                remedy: format!(
                    "use `cards.addresses` {}, or another `schedule.order`, such as sort",
                    EmulatedKind::Reference.name()
                ),
            });
        }
        if let (true, Task::Traffic { has_reuse: true, .. }) = (self.is_along_curve, &self.task) {
            return Err(RenderError::Setting {
                field: "schedule.order",
                value: ALONG_CURVE.to_owned(),
                reason: "the host does its gathers, and the reuse of lines is counted on chips".to_owned(),
                remedy: "measure it without reuse, or use another `schedule.order`, such as sort".to_owned(),
            });
        }
        self.settings.check()?;
        self.settings.check_budget(&self.chip().budget())
    }

    /// Name of the order of gathers.
    fn order(&self) -> &'static str {
        if self.is_along_curve { ALONG_CURVE } else { self.settings.schedule.order.name() }
    }

    /// Returns whether gathers wait in a chip's queue before they are performed.
    pub(super) fn has_queue(&self) -> bool {
        !self.is_along_curve && self.settings.schedule.order.has_queue()
    }

    /// Name of the point's file: task, scene and order. Points that differ only in other settings have the
    /// same name.
    pub fn name(&self) -> String {
        let task = match self.task {
            Task::Traffic { .. } => "traffic",
            Task::Quality { .. } => "quality",
        };
        let scene = self.scene.split('.').next().unwrap_or_default().chars().take(MAX_SCENE_NAME);
        let portable = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        let scene: String = scene.map(portable).collect();
        format!("{task}-{scene}-{}", self.order())
    }

    /// Key of the point in the store: everything that the result depends on. `scene` is the scene's checksum.
    pub fn key(&self, scene: &str) -> Value {
        let mut key = json!({
            "identity": identity(&self.settings, scene),
            "work": self.settings.of_work(),
            "chip": self.chip().emulated().to_json(),
            "scene": self.scene,
            "set": self.assignments,
        });
        key["work"]["order"] = self.order().into();
        key["task"] = match &self.task {
            Task::Traffic { chip: _, caches, sample, least_tiles, has_reuse } => {
                let caches = caches.to_string();
                json!({"traffic": {
                    "caches": caches, "sample": sample, "least_tiles": least_tiles, "reuse": has_reuse,
                }})
            }
            Task::Quality { tiles, reference_rays } => {
                json!({"quality of indirect light": {"tiles": tiles, "reference_rays": reference_rays}})
            }
        };
        key
    }

    /// Key of the point's card image. Points with equal keys share the image.
    pub fn image_key(&self) -> ImageKey {
        let RenderSettings { photons, integrator, .. } = &self.settings;
        ImageKey {
            scene: self.scene.clone(),
            assignments: self.assignments.clone(),
            seed: integrator.seed,
            photons: photons.clone(),
        }
    }
}

/// Everything that pixels depend on: the settings that change pixels, the versions of program and card image
/// layout, and the checksum `scene` of the scene.
pub(super) fn identity(settings: &RenderSettings, scene: &str) -> NamedSettings {
    let mut identity = settings.of_pixels();
    identity.insert("program".to_owned(), json!(PROGRAM));
    identity.insert("layout".to_owned(), json!(LAYOUT_VERSION));
    identity.insert("scene-checksum".to_owned(), json!(scene));
    identity
}

/// Everything that a point's card image depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageKey {
    scene: String,
    assignments: Vec<String>,
    seed: u32,
    photons: PhotonMaps,
}
