//! The completion of a pixel, once no gather of its block waits: light that needs no gather rays, albedo, normal and depth.
//!
//! Every sample is looked at again, as no chip has room to keep them.

use photoncard_shared::message::Fault;

use super::buffers::Shared;
use super::finished_pixel::{Completion, FinishedPixel, PixelView};
use super::flight::Flight;
use super::light::{Component, PixelLight};
use super::pixels::{allowed_error_at, direct_light, per_unit, pixel_point, seen_sample};
use crate::irradiance_cache::IrradianceCache;
use crate::kind::ChipKind;
use crate::memory::{MemoryPort, Stage};
use crate::render::eye::{Sight, View};
use crate::render::{Context, PixelSample, Purpose, RenderJob, eye};

impl<K: ChipKind> Flight<K> {
    /// Completes the next sample of the present pixel. Returns the pixel with its last sample.
    ///
    /// # Errors
    /// If the image is not sound.
    pub(super) fn complete<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
        flight: usize,
    ) -> Result<Option<FinishedPixel>, Fault> {
        let pixel = self.position.index;
        let stored = self.sum(pixel).map(|number| shared.sums.light(job.frame, (flight, number)));
        let mut completion = self.completion.take().unwrap_or_else(|| Completion {
            light: stored.unwrap_or(PixelLight::NONE),
            view: PixelView::NOTHING,
            sample: 0,
        });
        let at = self.sample(job.frame, pixel, completion.sample);
        let context = &mut job.context(&mut self.counters);
        match eye::view(context, at)? {
            Sight::Background(radiance) => {
                completion.light.add(context.frame, Component::Direct, radiance * per_unit(context));
            }
            Sight::Surface(view) => {
                completion.view.add(&context.scene.header, &view);
                light_sample(context, &self.cache, shared, (at, &view), &mut completion.light)?;
            }
        }
        completion.sample += 1;
        if completion.sample < context.frame.samples {
            self.completion = Some(completion);
            return Ok(None);
        }
        let Completion { light, view, .. } = completion;
        Ok(Some(FinishedPixel { tile: self.tile.id, index: self.index_in_tile(pixel), light, view }))
    }
}

/// Adds emission and interpolated irradiance of a sample and, without gather rays, its light by shadow rays and caustics.
fn light_sample<K: ChipKind, M: MemoryPort>(
    context: &mut Context<M>,
    cache: &IrradianceCache<K::IrradianceRecords>,
    shared: &mut Shared<K>,
    (at, view): (PixelSample, &View),
    light: &mut PixelLight,
) -> Result<(), Fault> {
    let frame = context.frame;
    let per_unit = per_unit(context);
    let surface = &view.surface;
    light.add(frame, Component::Direct, surface.emission * per_unit);
    let allowed = allowed_error_at(frame, view);
    let interpolated =
        allowed.and_then(|allowed| cache.interpolate(&seen_sample(context, at, view), allowed));
    if let Some(irradiance) = interpolated {
        let reflected = surface.reflector().lambertian_albedo() * irradiance;
        light.add(frame, Component::Indirect, reflected * per_unit);
    }
    let purpose = if interpolated.is_some() { Purpose::Lobe } else { Purpose::Sample };
    let mut point = pixel_point(frame, at, view, purpose);
    if point.rays > 0 {
        if purpose == Purpose::Sample {
            light.count_gather(frame);
        }
        return Ok(());
    }
    context.memory.enter(Stage::Shadow);
    // The bits of a surface depend on the way it is read.
    if let Some(seen) = &view.seen {
        let film = eye::film_position(context, at);
        eye::surface(context, film, seen, &mut point.surface)?;
    }
    for (component, brought) in direct_light(context, at, &point, shared)? {
        light.add(frame, component, brought);
    }
    Ok(())
}
