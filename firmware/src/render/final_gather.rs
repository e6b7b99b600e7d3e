//! The final gather: rays over the hemisphere, each ending in a gather of the photons nearest to its end.
//!
//! What a ray meets may emit as well: that is direct light, weighted against the shadow rays that bring it too
//! ([`super::direct`]).

use glam::Vec3;
use heapless::VecView;
use photoncard_shared::message::Fault;

use super::{Context, PixelSample, direct};
use crate::importance::sample_reflection;
use crate::memory::MemoryPort;
use crate::photon::{Candidate, NearestPhotons, gather, reflected_radiance};
use crate::sampler::{Dimension, Pattern};
use crate::scene::{Ray, Surface, closest_hit, offset_origin, read_surface};

/// Where a final gather ray ended, and what the radiance from there counts at the eye's surface.
#[derive(Clone, Copy, Debug)]
pub struct GatherPoint {
    /// The surface that the ray met.
    pub surface: Surface,
    /// Weight of its radiance, for one ray of the sample's `gather_rays`.
    pub weight: Vec3,
    /// Direct light that the ray found, weighted, in the image's radiance units.
    pub direct: Vec3,
}

/// Casts gather ray `index` of a sample from the surface that the eye sees; `None` if it meets nothing.
///
/// # Errors
/// If the image is not sound.
pub fn cast<M: MemoryPort>(
    context: &mut Context<M>,
    pixel: PixelSample,
    surface: &Surface,
    index: u32,
) -> Result<Option<GatherPoint>, Fault> {
    let frame = context.frame;
    let pattern = Pattern::new(frame.seed, pixel.x, pixel.y, pixel.sample, Dimension::Gather);
    let point = pattern.point(index, frame.gather_rays);
    let Some(sampled) = sample_reflection(surface, point) else { return Ok(None) };
    let ray = Ray::new(offset_origin(surface.position, surface.normal), sampled.direction);
    context.counters.gather_rays += 1;
    let Some(hit) = closest_hit(context.scene, context.memory, &ray)? else { return Ok(None) };
    let surface = read_surface(context.scene, context.memory, &ray, &hit)?;
    let weight = sampled.weight / frame.gather_rays as f32;
    let emitted = direct::seen_by_gather_ray(context, &ray, &surface, sampled.density);
    let direct = emitted * weight * (1.0 / context.scene.header.radiance_unit);
    Ok(Some(GatherPoint { surface, weight, direct }))
}

/// The weighted radiance of a gather point, reflected and direct, in the image's radiance units.
///
/// # Errors
/// If the image is not sound.
pub fn radiance<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    candidates: &mut VecView<Candidate>,
) -> Result<Vec3, Fault> {
    if point.surface.reflection.is_black() {
        return Ok(point.direct);
    }
    let frame = context.frame;
    let mut nearest = NearestPhotons::new(candidates, frame.neighbors, frame.max_distance);
    let tested = gather(context.scene, context.memory, point.surface.position, &mut nearest)?;
    context.counters.gathers += 1;
    context.counters.photons_tested += tested as u64;
    context.counters.photons_found += nearest.candidates().len() as u64;
    let header = &context.scene.header;
    let unit = header.photon_power_unit / header.radiance_unit;
    Ok(reflected_radiance(&nearest, &point.surface) * unit * point.weight + point.direct)
}
