//! Passes of a block's pixels with gather rays, stripe by stripe and sample by sample. They cast the gather
//! rays and compute direct light, which is weighted against these rays by the balance heuristic.

use core::ops::Range;

use photoncard_shared::message::{Fault, FrameParameters, Invariant};

use super::buffers::Shared;
use super::flight::{Flight, allowed_error};
use super::light::Component;
use super::position::Pass;
use super::stored_point::{StoredPoint, StoredRays, pattern};
use crate::gather::PointIndex;
use crate::irradiance_cache::{IrradianceCache, SeenSample};
use crate::kind::{Capacity, ChipKind};
use crate::light_groups::GroupedLight;
use crate::memory::{MemoryPort, Stage};
use crate::render::eye::View;
use crate::render::{
    Context, GatherPoint, PixelSample, Purpose, RenderJob, caustic, direct, eye, final_gather,
};
use crate::scene::Seen;

/// Gather point at the end of an eye path whose sample has `paths` paths. Its direction table is not chosen
/// yet.
pub(super) fn pixel_point(
    frame: &FrameParameters,
    at: PixelSample,
    view: &View,
    purpose: Purpose,
    paths: u32,
) -> GatherPoint {
    let pattern = pattern(frame, at);
    // The frame's number of gather rays is per pixel with the irradiance cache, and per sample without it.
    let is_of_pixel = allowed_error(frame).is_some();
    let samples = if is_of_pixel { frame.planned_samples.max(1) } else { 1 };
    // The paths of a Lambertian surface share the gather rays of a sample. On other surfaces each path casts
    // as many rays as a sample: paths are added to reduce noise of direct light and highlights, and gather
    // rays find highlights too.
    let sharing = if view.surface.reflection.is_lambertian() { paths.max(1) } else { 1 };
    let rays = frame.gather_rays.div_ceil(samples).div_ceil(sharing);
    if purpose == Purpose::Lobe {
        GatherPoint::lobe(view.surface, pattern, rays)
    } else {
        GatherPoint::sample(view.surface, pattern, rays)
    }
}

/// Error bound of a sample's interpolated irradiance; `None` if irradiance records must not light the sample.
pub(super) fn allowed_error_at(frame: &FrameParameters, view: &View) -> Option<f32> {
    // Records lie where eye rays meet surfaces, not behind mirrors and glass.
    allowed_error(frame).filter(|_| view.is_first && view.surface.reflection.has_lambertian())
}

/// Converts a view to a sample for the irradiance cache.
pub(super) fn seen_sample(at: PixelSample, view: &View) -> SeenSample<'_> {
    SeenSample { pixel: [at.x, at.y], film: view.sample.film, surface: &view.surface }
}

/// Gather point at the end of an eye path whose sample has `paths` paths. If irradiance records cover the
/// sample, by their geometry alone, the point is for the lobe only. Its direction table is not chosen yet.
fn gather_point<M, R: Capacity>(
    context: &Context<M>,
    cache: &IrradianceCache<R>,
    at: PixelSample,
    view: &View,
    paths: u32,
) -> GatherPoint {
    let allowed = allowed_error_at(context.frame, view);
    let is_interpolated = allowed.is_some_and(|allowed| cache.covers(&seen_sample(at, view), allowed));
    let purpose = if is_interpolated { Purpose::Lobe } else { Purpose::Sample };
    pixel_point(context.frame, at, view, purpose, paths)
}

impl<K: ChipKind> Flight<K> {
    /// Number of pixels of the current stripe, that is, of pixels whose gather points are stored together. It
    /// is at most `points`, the number of gather points that can be stored.
    fn stripe(&self, points: u32) -> u32 {
        self.block.pixels().saturating_sub(self.position.first).min(points)
    }

    /// Returns true if the pixel of the next eye ray has a sum, or there is room for one.
    pub(super) fn has_room(&self, frame: &FrameParameters, shared: &Shared<K>) -> bool {
        let next = || self.next_pixel(frame, self.stripe(shared.points.capacity()));
        shared.sums.has_room(frame) || next().is_none_or(|pixel| self.sum(pixel).is_some())
    }

    /// Index in the block of the stripe's next pixel to trace; `None` after the last. Such a pixel has gather
    /// rays and, in its current sample, a path with the current number. The stripe has `stripe` pixels.
    fn next_pixel(&self, frame: &FrameParameters, stripe: u32) -> Option<u32> {
        let first = self.position.first;
        self.first_with_path(frame, first + self.position.index..first + stripe)
    }

    /// Traces one path from the eye: the path with the current number, of the stripe's next pixel that has
    /// gather rays. Stores the gather point at its end, if that point has rays.
    pub(super) fn look<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
        flight: usize,
    ) -> Result<(), Fault> {
        if self.position.index == 0 {
            shared.points.clear();
        }
        let [first, stripe] = [self.position.first, self.stripe(shared.points.capacity())];
        let next = self.next_pixel(job.frame, stripe);
        self.position.index = next.map_or(stripe, |pixel| pixel - first);
        if let Some(pixel) = next {
            self.store_point(job, shared, (flight, pixel))?;
        }
        if self.position.next_index(stripe) {
            if shared.points.len() > 0 {
                self.position.pass = Pass::Direct;
            } else {
                self.end_path(job.frame, shared.points.capacity());
            }
        }
        Ok(())
    }

    /// Index in the block of the first pixel to trace among `pixels`; `None` if there is none. Such a pixel
    /// has gather rays and, in its current sample, a path with the current number.
    fn first_with_path(&self, frame: &FrameParameters, pixels: Range<u32>) -> Option<u32> {
        let Range { mut start, end } = pixels;
        let sample = self.position.sample_of(frame);
        loop {
            let pixel = self.first_with_rays(start..end)?;
            if self.position.path < self.paths(pixel).of_sample(sample) {
                return Some(pixel);
            }
            start = pixel + 1;
        }
    }

    /// Traces a pixel's current path from the eye. Stores the gather point at its end if the point has rays.
    fn store_point<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
        (flight, pixel): (usize, u32),
    ) -> Result<(), Fault> {
        let (at, _) = self.present_path(job.frame, pixel);
        let frame = job.frame;
        let paths = self.paths(pixel).of_sample(self.position.sample_of(frame));
        let context = &mut job.context(&mut self.counters);
        if let Some(view) = eye::view(context, at)?.surface() {
            let mut point = gather_point(context, &self.cache, at, &view, paths);
            if point.rays > 0 {
                point.choose_directions(context, shared.gathers.candidates())?;
                if self.sum(pixel).is_none() {
                    self.set_sum(pixel, shared.sums.push(frame, flight)?)?;
                }
                let stored = StoredPoint {
                    seen: view.seen.unwrap_or(Seen::ELSEWHERE),
                    directions: point.directions,
                    rays: StoredRays::new(&point),
                };
                let bin = stored.first_bin(point.pattern, frame.bins);
                shared.points.push(pixel as u16, stored, bin)?;
            }
        }
        Ok(())
    }

    /// Adds the light of shadow rays and caustics at the current gather point to the point's pixel, with the
    /// weight of its path.
    pub(super) fn gather_direct_light<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
        flight: usize,
    ) -> Result<(), Fault> {
        let (pixel, stored) = shared.points.get(self.position.index)?;
        let number = self.sum(pixel.into()).ok_or(Invariant::Sums.fault())?;
        let (at, weight) = self.present_path(job.frame, pixel.into());
        let context = &mut job.context(&mut self.counters);
        context.memory.enter(Stage::Shadow);
        let mut point = stored.point(pattern(context.frame, at));
        stored.read_surface(context, at, &mut point.surface)?;
        for (component, light) in direct_light(context, at, &point)? {
            shared.sums.add(context.frame, (flight, number), component, &(light * weight))?;
        }
        if self.position.next_index(shared.points.len()) {
            self.position.pass = Pass::Rays;
        }
        Ok(())
    }

    /// Casts gather rays of the next gather point that has rays in the current direction bin.
    pub(super) fn cast_for_pixel<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
        flight: usize,
    ) -> Result<(), Fault> {
        let Some((index, pixel)) = shared.points.next(&self.position) else {
            if self.position.end_bin(job.frame.bins) {
                self.end_path(job.frame, shared.points.capacity());
            }
            return Ok(());
        };
        let (at, weight) = self.present_path(job.frame, pixel.into());
        let pattern = pattern(job.frame, at);
        let rays = shared.points.take_rays(&mut self.position, index, pattern, job.frame)?;
        let (_, stored) = shared.points.get(index)?;
        let number = self.sum(pixel.into()).ok_or(Invariant::Sums.fault())?;
        let index_in_tile = self.index_in_tile(pixel.into());
        let target = self.target(flight, PointIndex::Pixel(number));
        let (context, outlet) = &mut job.context_and_outlet(&mut self.counters);
        context.memory.enter(Stage::GatherRay);
        let mut point = stored.point(pattern);
        point.weight = weight;
        stored.read_surface(context, at, &mut point.surface)?;
        let mut ends = final_gather::GatherRayEnds::new();
        for bundle in final_gather::bundles(rays) {
            final_gather::cast(context, &point, target, bundle, &mut ends)?;
            for end in &ends {
                let sum = (flight, number);
                let component = if end.is_near { Component::Indirect } else { Component::Direct };
                shared.sums.add(context.frame, sum, component, &end.light)?;
                match (end.request, outlet.as_deref_mut()) {
                    (None, _) => {}
                    (Some(request), Some(outlet)) => outlet.take(index_in_tile, request),
                    (Some(request), None) => {
                        match shared.gathers.submit(context, &mut shared.rounds, request)? {
                            None => self.waiting += 1,
                            Some(brought) => {
                                shared.sums.add(context.frame, sum, Component::Indirect, &brought)?;
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Advances to the next path of the stripe's current sample, to its next sample, or to the next stripe of
    /// up to `points` pixels.
    fn end_path(&mut self, frame: &FrameParameters, points: u32) {
        self.position.pass = Pass::Eye;
        self.position.path += 1;
        let first = self.position.first;
        if self.first_with_path(frame, first..first + self.stripe(points)).is_some() {
            return;
        }
        let position = &mut self.position;
        if position.next_sample(frame) {
            position.first += points;
            if position.first >= self.block.pixels() {
                position.pass = Pass::Wait;
            }
        }
    }
}

/// Light that the gather point of a path reflects, in the card image's radiance units: direct light found by
/// shadow rays, and caustics.
pub(super) fn direct_light<M: MemoryPort>(
    context: &mut Context<M>,
    at: PixelSample,
    point: &GatherPoint,
) -> Result<[(Component, GroupedLight); 2], Fault> {
    let reflected = direct::reflected(context, at, point)?;
    let direct = reflected * per_unit(context);
    let caustic = caustic::reflected(context, point)?;
    Ok([(Component::Direct, direct), (Component::Caustic, caustic)])
}

/// Factor that converts radiance, W/(sr m^2), to the radiance units of pixel sums.
#[inline(always)]
pub(super) fn per_unit<M>(context: &Context<M>) -> f32 {
    1.0 / context.scene.header.radiance_unit
}
