//! A complete pixel, and its sums while it is completed.

use glam::Vec3;
use photoncard_shared::message::{FrameParameters, Pixel, PixelLayers, PixelRecord};

use super::light::{PixelLight, light_of};
use crate::fixed_point::ColourSum;
use crate::render::eye::View;
use crate::scene::SceneImage;

/// A complete pixel.
#[derive(Clone, Copy, Debug)]
pub struct FinishedPixel {
    /// Number of its tile.
    pub tile: u32,
    /// Index in the tile, row-major.
    pub index: u32,
    /// Its light.
    pub light: PixelLight,
    /// Its other channels.
    pub view: PixelView,
}

impl FinishedPixel {
    /// The record of the pixel.
    pub fn record(&self, scene: &SceneImage, frame: &FrameParameters) -> PixelRecord {
        self.view.record(scene, frame, self.light.sums(frame))
    }
}

/// Sums of albedo, normal and depth over the samples of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelView {
    albedo: Vec3,
    normal: Vec3,
    depth: f32,
    /// Samples that see a surface.
    surfaces: u32,
}

impl PixelView {
    pub(super) const NOTHING: Self = Self { albedo: Vec3::ZERO, normal: Vec3::ZERO, depth: 0.0, surfaces: 0 };

    pub(super) fn add(&mut self, view: &View) {
        self.albedo += view.surface.reflector().albedo();
        self.normal += view.surface.normal;
        self.depth += view.depth;
        self.surfaces += 1;
    }

    /// The record of the pixel with its sums of light.
    pub fn record(&self, scene: &SceneImage, frame: &FrameParameters, sums: &[ColourSum]) -> PixelRecord {
        let per_sample = 1.0 / frame.samples.max(1) as f32;
        let per_surface = 1.0 / self.surfaces as f32;
        let unit = scene.header.radiance_unit;
        let (radiance, layers) = light_of(sums);
        let pixel = Pixel {
            radiance: (radiance * unit).to_array(),
            albedo: (self.albedo * per_sample).clamp(Vec3::ZERO, Vec3::ONE).to_array(),
            normal: (self.normal * per_sample).to_array(),
            depth: if self.surfaces > 0 { self.depth * per_surface } else { f32::INFINITY },
        };
        let scaled = |light: [f32; 3]| light.map(|component| component * unit);
        let layers = layers.map(|PixelLayers { direct, indirect, caustic, gathers }| PixelLayers {
            direct: scaled(direct),
            indirect: scaled(indirect),
            caustic: scaled(caustic),
            gathers,
        });
        PixelRecord { pixel, layers }
    }
}

/// The pixel that is being completed.
pub(super) struct Completion {
    pub(super) light: PixelLight,
    pub(super) view: PixelView,
    /// The next sample.
    pub(super) sample: u32,
}
