//! The completion of a pixel: light that needs no gather rays, albedo, normal and depth.
//!
//! Pixels without gather rays of their own are completed first, once the irradiance records of their block are gathered: each sample is
//! looked at once. Those with gather rays are found by it. They are completed when no gather of the block waits, and every sample is
//! looked at again, as no chip has room to keep them.

use photoncard_shared::message::Fault;

use super::buffers::Shared;
use super::finished_pixel::{Completion, FinishedPixel};
use super::flight::Flight;
use super::light::{Component, PixelLight};
use super::pixels::{allowed_error_at, direct_light, per_unit, pixel_point, seen_sample};
use super::position::Pass;
use crate::irradiance_cache::IrradianceCache;
use crate::kind::ChipKind;
use crate::memory::{MemoryPort, Stage};
use crate::render::eye::{Sight, View};
use crate::render::{Context, PixelSample, Purpose, RenderJob, eye};

impl<K: ChipKind> Flight<K> {
    /// Next pixel to be completed in the present pass; `None` after the last.
    pub(super) fn pixel_to_complete(&self) -> Option<u32> {
        let rest = self.position.index..self.block.pixels();
        match self.pass() {
            Pass::CompletePlain => (!rest.is_empty()).then_some(rest.start),
            _ => self.first_with_rays(rest),
        }
    }

    /// Completes the next sample of a pixel. Returns the pixel with its last sample. A pixel with gather rays is left for a later pass if it
    /// is not known to have any.
    ///
    /// # Errors
    /// If the image is not sound.
    pub(super) fn complete<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
        (flight, pixel): (usize, u32),
    ) -> Result<Option<FinishedPixel>, Fault> {
        self.position.index = pixel;
        let stored = self.sum(pixel).map(|number| shared.sums.light(job.frame, (flight, number)));
        let mut completion =
            self.completion.take().unwrap_or_else(|| Completion::new(stored.unwrap_or(PixelLight::NONE)));
        let at = self.sample(job.frame, pixel, completion.sample);
        let is_plain = self.pass() == Pass::CompletePlain;
        let context = &mut job.context(&mut self.counters);
        match eye::view(context, at)? {
            Sight::Background(radiance) => {
                completion.light.add(context.frame, Component::Direct, radiance * per_unit(context));
            }
            Sight::Surface(view) => {
                completion.view.add(&context.scene.header, &view);
                let has_rays = light_sample(context, &self.cache, shared, (at, &view), &mut completion)?;
                if has_rays && is_plain {
                    self.give_rays(pixel);
                    self.position.index += 1;
                    return Ok(None);
                }
            }
        }
        completion.sample += 1;
        if completion.sample < context.frame.samples {
            self.completion = Some(completion);
            return Ok(None);
        }
        self.position.index += 1;
        let Completion { light, view, lambertian, interpolated, .. } = completion;
        self.counters.lambertian_samples += u64::from(lambertian);
        self.counters.interpolated_samples += u64::from(interpolated);
        Ok(Some(FinishedPixel { tile: self.tile.id, index: self.index_in_tile(pixel), light, view }))
    }
}

/// Adds emission and interpolated irradiance of a sample and, without gather rays, its light by shadow rays and caustics. Returns whether
/// it has gather rays.
fn light_sample<K: ChipKind, M: MemoryPort>(
    context: &mut Context<M>,
    cache: &IrradianceCache<K::IrradianceRecords>,
    shared: &mut Shared<K>,
    (at, view): (PixelSample, &View),
    completion: &mut Completion,
) -> Result<bool, Fault> {
    let Completion { light, lambertian, interpolated: interpolated_samples, .. } = completion;
    let frame = context.frame;
    let per_unit = per_unit(context);
    let surface = &view.surface;
    light.add(frame, Component::Direct, surface.emission * per_unit);
    let allowed = allowed_error_at(frame, view);
    let interpolated = allowed.and_then(|allowed| cache.interpolate(&seen_sample(at, view), allowed));
    *lambertian += u32::from(frame.gather_rays > 0 && surface.reflection.has_lambertian());
    if let Some(irradiance) = interpolated {
        *interpolated_samples += 1;
        let reflected = surface.reflector().lambertian_albedo() * irradiance;
        light.add(frame, Component::Indirect, reflected * per_unit);
    }
    let purpose = if interpolated.is_some() { Purpose::Lobe } else { Purpose::Sample };
    let mut point = pixel_point(frame, at, view, purpose);
    if point.rays > 0 {
        if purpose == Purpose::Sample {
            light.count_gather(frame);
        }
        return Ok(true);
    }
    context.memory.enter(Stage::Shadow);
    // The bits of a surface depend on the way it is read.
    if let Some(seen) = &view.seen {
        eye::surface(context, view.film, seen, &mut point.surface)?;
    }
    for (component, brought) in direct_light(context, at, &point, shared)? {
        light.add(frame, component, brought);
    }
    Ok(false)
}
