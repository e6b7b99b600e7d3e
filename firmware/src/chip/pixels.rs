//! The stages of a block's pixels, sample by sample.

use glam::Vec3;
use photoncard_shared::message::{Fault, FrameParameters, Pixel};

use super::position::Stage;
use super::{Chip, allowed_error};
use crate::fixed_point::ColourSum;
use crate::irradiance_cache::SeenSample;
use crate::memory::MemoryPort;
use crate::render::{Context, GatherPoint, direct, eye, final_gather};
use crate::sampler::{Dimension, Pattern};
use crate::scene::SceneImage;

/// What is known of a pixel so far: sums over its samples.
#[derive(Clone, Copy, Debug)]
pub struct PixelSum {
    /// Emission, what shadow rays bring and what is interpolated, W/(sr m^2); samples come in their order.
    radiance: Vec3,
    /// The mean of what gather rays bring, in radiance units; they come in any order.
    gathered: ColourSum,
    albedo: Vec3,
    normal: Vec3,
    depth: f32,
    surfaces: u32,
}

impl PixelSum {
    pub(super) const ZERO: Self = Self {
        radiance: Vec3::ZERO,
        gathered: ColourSum::ZERO,
        albedo: Vec3::ZERO,
        normal: Vec3::ZERO,
        depth: 0.0,
        surfaces: 0,
    };

    /// Adds what a gather brought, in radiance units.
    #[inline]
    pub fn add_gathered(&mut self, brought: Vec3) {
        self.gathered.add(brought);
    }

    /// The pixel of a complete sum.
    pub fn pixel(&self, scene: &SceneImage, frame: &FrameParameters) -> Pixel {
        let per_sample = 1.0 / frame.samples.max(1) as f32;
        let gathered = self.gathered.value() * scene.header.radiance_unit;
        let per_surface = 1.0 / self.surfaces as f32;
        Pixel {
            radiance: (self.radiance * per_sample + gathered).to_array(),
            albedo: (self.albedo * per_sample).to_array(),
            normal: (self.normal * per_sample).to_array(),
            depth: if self.surfaces > 0 { self.depth * per_surface } else { f32::INFINITY },
        }
    }
}

/// Adds what a gather brought to the pixel that it is for.
#[inline]
pub(super) fn add_gathered(sums: &mut [PixelSum], target: u16, brought: Vec3) {
    if let Some(sum) = sums.get_mut(target as usize) {
        sum.add_gathered(brought);
    }
}

impl<const TILE_PIXELS: usize, const CANDIDATES: usize, const QUEUE: usize, const RECORDS: usize>
    Chip<TILE_PIXELS, CANDIDATES, QUEUE, RECORDS>
{
    /// What the present pixel sees in the present sample, and what of that goes straight into the picture.
    pub(super) fn look<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let (index, at) = self.present();
        let place = eye::place(context, at);
        let surface = eye::see(context, place)?;
        let sum = self.sums.get_mut(index);
        let mut point = None;
        if let (Some(surface), Some(sum)) = (surface, sum) {
            sum.radiance += surface.emission;
            sum.albedo += surface.reflection.diffuse + surface.reflection.specular;
            sum.normal += surface.normal;
            sum.depth += eye::depth(context, &surface);
            sum.surfaces += 1;
            let frame = context.frame;
            let pattern = Pattern::new(frame.seed, at.x, at.y, at.sample, Dimension::Gather);
            let allowed = allowed_error(frame);
            let is_lambertian = frame.gather_rays > 0 && surface.reflection.has_lambertian();
            let sample = SeenSample { pixel: [at.x, at.y], place, surface: &surface };
            // With the cache the rays are those of a record, and of a pixel; without it those of a sample.
            let (interpolated, rays) = match allowed {
                Some(allowed) if is_lambertian => (
                    self.cache.interpolate(&sample, allowed),
                    frame.gather_rays.div_ceil(frame.samples.max(1)),
                ),
                _ => (None, frame.gather_rays),
            };
            context.counters.lambertian_samples += u64::from(is_lambertian);
            context.counters.interpolated_samples += u64::from(interpolated.is_some());
            let mut begun = match interpolated {
                Some(irradiance) => {
                    sum.radiance += surface.reflection.diffuse * irradiance;
                    GatherPoint::lobe(surface, pattern, rays)
                }
                None => GatherPoint::sample(surface, pattern, rays),
            };
            begun.choose_directions(context, &mut self.gathers.candidates)?;
            point = Some(begun);
        }
        if let Some(slot) = self.points.get_mut(index) {
            *slot = point;
        }
        if self.position.next_index(self.block.pixels()) {
            self.position.stage = Stage::Direct;
        }
        Ok(())
    }

    /// What shadow rays bring the present pixel.
    pub(super) fn light_directly<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let (index, at) = self.present();
        if let (Some(Some(point)), Some(sum)) = (self.points.get(index), self.sums.get_mut(index)) {
            sum.radiance += direct::reflected(context, at, point)?;
        }
        if self.position.next_index(self.block.pixels()) {
            self.position.stage = Stage::Rays;
        }
        Ok(())
    }

    /// The gather rays of the present bin and pixel.
    pub(super) fn cast_for_pixel<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let (index, _) = self.present();
        let Self { points, sums, gathers, position, .. } = self;
        if let Some(Some(point)) = points.get(index) {
            let frame = context.frame;
            let share = 1.0 / frame.samples as f32;
            for ray in point.directions.rays(point.pattern, point.rays, position.bin, frame.bins) {
                // A tile has at most TILE_PIXELS pixels, which 16 bits tell apart.
                let end = final_gather::cast(context, point, index as u16, share, ray)?;
                let Some(end) = end else { continue };
                add_gathered(sums, index as u16, end.direct);
                match (end.request, &mut context.outlet) {
                    (None, _) => {}
                    (Some(request), Some(outlet)) => {
                        outlet.take(gathers.key(context.frame, &request), request);
                    }
                    (Some(request), None) => {
                        gathers.submit(context, request, &mut |request, brought| {
                            add_gathered(sums, request.target, brought);
                        })?;
                    }
                }
            }
        }
        let frame = context.frame;
        if position.next_index(self.block.pixels()) && position.next_bin(frame.bins) {
            let is_last = position.next_sample(frame.samples);
            position.stage = if is_last { Stage::Done } else { Stage::Eye };
        }
        Ok(())
    }
}
