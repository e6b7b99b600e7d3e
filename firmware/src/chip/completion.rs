//! Completion of a pixel: adds its albedo, normal and depth, and the light that needs no gather rays.
//!
//! Pixels without gather rays are completed first, as soon as the irradiance records of their block are
//! gathered. Each of their paths is traced once. The same pass finds the pixels with gather rays. These are
//! completed when no gather of the block waits; each of their paths is then traced again, because a chip has
//! no memory to keep paths.
//!
//! Probes ([`super::adaptive`]) are traced here as well. For a pixel without gather rays, they are the first
//! samples of its completion. They are also traced if the frame begins with a later sample. Pixels with
//! gather rays have a separate pass for their probes.

use glam::Vec3;
use photoncard_shared::message::{Fault, FrameParameters, PROBES};

use super::adaptive::{self, Probes};
use super::buffers::Shared;
use super::finished_pixel::{Completion, FinishedPixel, FurtherSums, PixelView};
use super::flight::Flight;
use super::light::{Component, PixelLight};
use super::pixels::{allowed_error_at, direct_light, per_unit, pixel_point, seen_sample};
use super::position::{Pass, Position};
use crate::importance::DirectionTable;
use crate::irradiance_cache::IrradianceCache;
use crate::kind::ChipKind;
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::{MemoryPort, Stage};
use crate::render::eye::{FirstHit, Sight, View};
use crate::render::features::{Features, features};
use crate::render::{Context, PixelSample, Purpose, RenderJob, eye};
use crate::scene::read_identity;
use crate::slot::Slot;

/// Purpose for which the light of a path is computed.
#[derive(Clone, Copy)]
enum Use {
    /// The path is a term of the pixel's sum, with this weight. If the path has gather rays, [`Pass::Direct`]
    /// adds its light of shadow rays and caustics.
    Term(f32),
    /// The path's light is only used to determine the number of paths. It includes the light of shadow rays
    /// and caustics, but not of gather rays.
    Probe,
}

impl<K: ChipKind> Flight<K> {
    /// Returns the next pixel to be completed in the current pass; `None` after the last.
    pub(super) fn pixel_to_complete(&self) -> Option<u32> {
        let rest = self.position.index..self.block.pixels();
        match self.pass() {
            Pass::CompletePlain => (!rest.is_empty()).then_some(rest.start),
            _ => self.first_with_rays(rest),
        }
    }

    /// Completes the next path of a pixel. Returns the finished pixel if that path was its last. A pixel that
    /// turns out to have gather rays is left for a later pass.
    ///
    /// # Errors
    /// If the card image is invalid.
    pub(super) fn complete<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
        (flight, pixel): (usize, u32),
    ) -> Result<Option<FinishedPixel>, Fault> {
        let frame = job.frame;
        self.position.index = pixel;
        let is_plain = self.pass() == Pass::CompletePlain;
        let stored = self.sum(pixel).map(|number| shared.sums.light(frame, (flight, number))).transpose()?;
        let begun = self.completion.take();
        if begun.is_none() {
            self.further = FurtherSums::of_frame(frame);
        }
        let mut completion = begun.unwrap_or_else(|| {
            let probes_first = is_plain && adaptive::needs_probes(frame);
            Completion::new(
                stored.unwrap_or(PixelLight::NONE),
                if probes_first { 0 } else { frame.first_sample },
            )
        });
        let sample = completion.sample;
        let is_term = sample >= frame.first_sample;
        let weight = self.paths(pixel).weight(frame, sample);
        let as_what = if is_term { Use::Term(weight) } else { Use::Probe };
        let has_rays = self.look_at(job, pixel, (as_what, &mut completion))?;
        if has_rays && is_plain && is_term {
            self.give_rays(pixel)?;
            self.position.index += 1;
            return Ok(None);
        }
        if is_plain && sample + 1 == PROBES {
            self.end_probes(frame, pixel, &completion.probes)?;
        }
        completion.next_path(self.paths(pixel).of_sample(sample));
        if completion.sample < frame.first_sample.saturating_add(frame.samples) {
            self.completion = Slot::Full(completion);
            return Ok(None);
        }
        self.position.index += 1;
        let Completion { light, seen, lambertian, interpolated, .. } = completion;
        let view = PixelView { seen, further: self.further };
        self.counters.lambertian_samples += u64::from(lambertian);
        self.counters.interpolated_samples += u64::from(interpolated);
        Ok(Some(FinishedPixel { tile: self.tile.id, index: self.index_in_tile(pixel), light, view }))
    }

    /// Traces the next probe of the next pixel with gather rays.
    ///
    /// # Errors
    /// If the card image is invalid.
    pub(super) fn probe<M: MemoryPort>(&mut self, job: &mut RenderJob<M>) -> Result<(), Fault> {
        let Some(pixel) = self.first_with_rays(self.position.index..self.block.pixels()) else {
            self.position = Position::at(Pass::Eye);
            return Ok(());
        };
        self.position.index = pixel;
        let mut completion = self.completion.take().unwrap_or_else(|| Completion::new(PixelLight::NONE, 0));
        self.look_at(job, pixel, (Use::Probe, &mut completion))?;
        completion.next_path(1);
        if completion.sample < PROBES {
            self.completion = Slot::Full(completion);
            return Ok(());
        }
        self.end_probes(job.frame, pixel, &completion.probes)?;
        self.position.index += 1;
        Ok(())
    }

    /// Sets a pixel's number of paths per sample from its probes, if samples of the frame depend on them.
    fn end_probes(&mut self, frame: &FrameParameters, pixel: u32, probes: &Probes) -> Result<(), Fault> {
        match frame.adaptive_threshold.filter(|_| adaptive::needs_probes(frame)) {
            Some(threshold) => self.set_paths(pixel, probes.paths(threshold)),
            None => Ok(()),
        }
    }

    /// Traces the current path of the pixel that is being completed, and adds its light. Returns whether the
    /// path has gather rays.
    fn look_at<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        pixel: u32,
        (as_what, completion): (Use, &mut Completion),
    ) -> Result<bool, Fault> {
        let at = self.path(pixel, completion.sample, completion.path);
        let paths = self.paths(pixel).of_sample(completion.sample);
        let pass = self.pass();
        let context = &mut job.context(&mut self.counters);
        let groups = LightGroups::of(context.frame);
        let has_rays = match eye::view(context, at)? {
            Sight::Background { radiance, hit } => {
                let light = radiance * per_unit(context);
                let light = groups.light(context.scene.header.lights.light_group, light);
                completion.add(context.frame, as_what, Component::Direct, &light);
                if let Some((depth, first)) = hit
                    && let Use::Term(weight) = as_what
                {
                    if completion.path == 0 {
                        completion.seen.add(&context.scene.header, &Features::NOTHING, depth);
                    }
                    add_hit(context, &mut self.further, (completion.path, weight), &first)?;
                }
                false
            }
            Sight::Surface(view) => {
                let path = (at, &view, paths);
                let has_rays = light_path::<K, M>(context, &self.cache, path, (as_what, &mut *completion))?;
                // A plain pass drops a pixel that has gather rays, and another pass completes it.
                let is_kept = !(has_rays && pass == Pass::CompletePlain);
                if is_kept && let Use::Term(weight) = as_what {
                    if completion.path == 0 {
                        let features = features(context, at, &view)?;
                        completion.seen.add(&context.scene.header, &features, view.depth);
                    }
                    add_hit(context, &mut self.further, (completion.path, weight), &view.first)?;
                }
                has_rays
            }
        };
        completion.end_light(context.scene.header.radiance_unit);
        Ok(has_rays)
    }
}

impl Completion {
    /// Advances to the next path. The current sample has `count` paths.
    fn next_path(&mut self, count: u32) {
        self.path += 1;
        if self.path >= count {
            self.path = 0;
            self.sample += 1;
        }
    }

    /// Adds light of the current path, in the card image's radiance units.
    fn add(&mut self, frame: &FrameParameters, as_what: Use, component: Component, light: &GroupedLight) {
        self.of_path += light.total(LightGroups::of(frame));
        if let Use::Term(weight) = as_what {
            self.light.add(frame, component, &(*light * weight));
        }
    }

    /// Ends the current path: adds its light to the sums of the probes if its sample is a probe. `unit` is
    /// the radiance unit, W/(sr m^2).
    fn end_light(&mut self, unit: f32) {
        let light = core::mem::replace(&mut self.of_path, Vec3::ZERO);
        if self.sample < PROBES {
            self.probes.add(light * unit);
        }
    }
}

/// Adds the first surface that an eye ray hits to the sums that the frame asks for: the position, of a
/// sample's first path alone, and the coverage. `path` is the number of the path in its sample, and its
/// weight.
#[inline(always)]
fn add_hit<M: MemoryPort>(
    context: &mut Context<M>,
    further: &mut FurtherSums,
    path: (u32, f32),
    hit: &FirstHit,
) -> Result<(), Fault> {
    let FrameParameters { position, coverage, identities, .. } = *context.frame;
    if position || coverage || identities { add_asked(context, further, path, hit) } else { Ok(()) }
}

/// Does [`add_hit`] in a frame that asks for positions, coverage or identities.
#[cold]
#[inline(never)]
fn add_asked<M: MemoryPort>(
    context: &mut Context<M>,
    further: &mut FurtherSums,
    (path, weight): (u32, f32),
    hit: &FirstHit,
) -> Result<(), Fault> {
    if path == 0 {
        further.add_position(&context.scene.header, hit.position);
    }
    let identity = match context.frame.identities {
        true => Some(read_identity(context.scene, context.memory, hit.id)?),
        false => None,
    };
    further.cover(weight, identity);
    Ok(())
}

/// Adds emission and interpolated irradiance of a path whose sample has `paths` paths. For a probe, or a path
/// without gather rays, also adds the light of shadow rays and caustics. Returns whether the path has gather
/// rays.
fn light_path<K: ChipKind, M: MemoryPort>(
    context: &mut Context<M>,
    cache: &IrradianceCache<K::IrradianceRecords>,
    (at, view, paths): (PixelSample, &View, u32),
    (as_what, completion): (Use, &mut Completion),
) -> Result<bool, Fault> {
    let frame = context.frame;
    let per_unit = per_unit(context);
    let surface = &view.surface;
    let is_term = matches!(as_what, Use::Term(_));
    let emission = LightGroups::of(frame).light(surface.light_group, surface.emission * per_unit);
    completion.add(frame, as_what, Component::Direct, &emission);
    let allowed = allowed_error_at(frame, view);
    let interpolated = allowed.and_then(|allowed| cache.interpolate(&seen_sample(at, view), allowed));
    if is_term {
        let is_lambertian = frame.gather_rays > 0 && surface.reflection.has_lambertian();
        completion.lambertian += u32::from(is_lambertian);
        completion.interpolated += u32::from(interpolated.is_some());
    }
    if let Some(irradiance) = interpolated {
        let reflected = irradiance * surface.reflector().lambertian_albedo() * per_unit;
        completion.add(frame, as_what, Component::Indirect, &reflected);
    }
    let purpose = if interpolated.is_some() { Purpose::Lobe } else { Purpose::Sample };
    let mut point = pixel_point(frame, at, view, purpose, paths);
    let has_rays = point.rays > 0;
    if has_rays && is_term {
        if purpose == Purpose::Sample && completion.path == 0 {
            completion.light.count_gather(frame);
        }
        return Ok(true);
    }
    if has_rays {
        // The directions do not follow photons, which would take a search.
        point.directions = DirectionTable::of_reflection(&point.reflector());
    }
    context.memory.enter(Stage::Shadow);
    // The surface is read as in [`Pass::Direct`], because the last bits of its values depend on the way in
    // which it is read.
    if let Some(seen) = &view.seen {
        eye::surface(context, &view.sample, seen, &mut point.surface)?;
    }
    for (component, light) in direct_light(context, at, &point)? {
        completion.add(frame, as_what, component, &light);
    }
    Ok(has_rays)
}
