//! The completion of a pixel: its albedo, normal and depth.
//!
//! They are computed again from all samples, as no chip has room to keep them; in steps, as a pixel may have thousands.

use glam::Vec3;
use photoncard_shared::message::{Fault, Pixel, PixelLayers, PixelRecord};

use super::light::light_of;
use crate::fixed_point::ColourSum;
use crate::memory::MemoryPort;
use crate::render::{Context, PixelSample, eye};

/// Samples of one step.
const SAMPLES_PER_STEP: u32 = 64;

/// Sums over the samples of a pixel so far.
#[derive(Clone, Copy)]
pub struct Completion {
    albedo: Vec3,
    normal: Vec3,
    depth: f32,
    /// Samples that see a surface.
    surfaces: u32,
    /// The next sample to look at.
    next: u32,
}

impl Completion {
    /// Sums of no sample.
    pub const NOTHING: Self =
        Self { albedo: Vec3::ZERO, normal: Vec3::ZERO, depth: 0.0, surfaces: 0, next: 0 };

    /// Adds the next samples of the pixel in column `x` and row `y` of the picture. `true` if they were the last.
    ///
    /// # Errors
    /// If the image is not sound.
    pub fn step<M: MemoryPort>(&mut self, context: &mut Context<M>, x: u32, y: u32) -> Result<bool, Fault> {
        let samples = context.frame.samples;
        let end = samples.min(self.next.saturating_add(SAMPLES_PER_STEP));
        for sample in self.next..end {
            let sight = eye::view(context, PixelSample { x, y, sample })?;
            let Some(view) = sight.surface() else { continue };
            let surface = &view.surface;
            self.albedo += surface.reflector().albedo();
            self.normal += surface.normal;
            self.depth += view.depth;
            self.surfaces += 1;
        }
        self.next = end;
        Ok(end >= samples)
    }

    /// The pixel, after the last step, from its sums of light.
    pub fn pixel<M>(&self, context: &Context<M>, sums: &[ColourSum]) -> PixelRecord {
        let per_sample = 1.0 / context.frame.samples.max(1) as f32;
        let per_surface = 1.0 / self.surfaces as f32;
        let unit = context.scene.header.radiance_unit;
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
