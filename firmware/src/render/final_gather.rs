//! The final gather: rays over the hemisphere, each ending in a gather of the photons nearest to its end.
//!
//! What a ray meets may emit as well: that is direct light, weighted against the shadow rays that bring it too
//! ([`super::direct`]).

use glam::Vec3;
use heapless::VecView;
use photoncard_shared::message::Fault;

use super::{Context, PixelSample, direct};
use crate::gather::{GatherRequest, PartialReflection};
use crate::importance::sample_reflection;
use crate::memory::MemoryPort;
use crate::photon::{Candidate, NearestPhotons, gather, reflected_radiance};
use crate::sampler::{Dimension, Pattern};
use crate::scene::{Ray, Surface, closest_hit, read_surface};

/// What the end of a final gather ray brings.
#[derive(Clone, Copy, Debug)]
pub struct GatherRayEnd {
    /// Direct light of the emitter it met, weighted, in the image's radiance units.
    pub direct: Vec3,
    /// The gather of what is reflected there, if anything is.
    pub request: Option<GatherRequest>,
}

/// Casts gather ray `index` of a sample from the surface that the eye sees; `None` if it meets nothing. `pixel_index` is
/// the pixel's in its tile.
///
/// # Errors
/// If the image is not sound.
pub fn cast<M: MemoryPort>(
    context: &mut Context<M>,
    pixel: PixelSample,
    pixel_index: u16,
    surface: &Surface,
    index: u32,
) -> Result<Option<GatherRayEnd>, Fault> {
    let frame = context.frame;
    let pattern = Pattern::new(frame.seed, pixel.x, pixel.y, pixel.sample, Dimension::Gather);
    let point = pattern.point(index, frame.gather_rays);
    let Some(sampled) = sample_reflection(surface, point) else { return Ok(None) };
    let ray = Ray::new(surface.offset_origin(), sampled.direction);
    context.counters.gather_rays += 1;
    let Some(hit) = closest_hit(context.scene, context.memory, &ray)? else { return Ok(None) };
    let met = read_surface(context.scene, context.memory, &ray, &hit)?;
    let header = &context.scene.header;
    // The mean over rays and samples is taken here, so that the pixel's sum stays small.
    let weight = sampled.weight / (frame.gather_rays as f32 * frame.samples as f32);
    let emitted = direct::seen_by_gather_ray(context, &ray, &met, sampled.density);
    let request = (!met.reflection.is_black()).then(|| GatherRequest {
        position: met.position.to_array(),
        reflection: PartialReflection::new(
            &met,
            weight * (header.photon_power_unit / header.radiance_unit),
            pattern.dither(index),
        ),
        pixel: pixel_index,
    });
    Ok(Some(GatherRayEnd { direct: emitted * weight * (1.0 / header.radiance_unit), request }))
}

/// Does a gather: what it adds to its pixel, in the image's radiance units.
///
/// # Errors
/// If the image is not sound.
pub fn gathered<M: MemoryPort>(
    context: &mut Context<M>,
    request: &GatherRequest,
    candidates: &mut VecView<Candidate>,
) -> Result<Vec3, Fault> {
    let frame = context.frame;
    let mut nearest = NearestPhotons::new(candidates, frame.neighbors, frame.max_distance);
    let tested = gather(context.scene, context.memory, request.position.into(), &mut nearest)?;
    context.counters.gathers += 1;
    context.counters.photons_tested += tested as u64;
    context.counters.photons_found += nearest.candidates().len() as u64;
    Ok(reflected_radiance(&nearest, request))
}
