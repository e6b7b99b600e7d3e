//! The final gather: rays over the hemisphere, each ending in a gather of the photons nearest to its end.
//!
//! The emission of what a ray meets is not counted: it is direct light, which the shadow rays bring.

use glam::Vec3;
use heapless::VecView;
use photoncard_shared::message::Fault;

use super::{Context, PixelSample};
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
}

/// Casts gather ray `index` of a sample from the surface that the eye sees; `None` if nothing comes from there.
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
    let reflects = !surface.reflection.is_black();
    Ok(reflects.then_some(GatherPoint { surface, weight: sampled.weight / frame.gather_rays as f32 }))
}

/// The weighted radiance of a gather point, in the image's radiance units.
///
/// # Errors
/// If the image is not sound.
pub fn radiance<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    candidates: &mut VecView<Candidate>,
) -> Result<Vec3, Fault> {
    let frame = context.frame;
    let mut nearest = NearestPhotons::new(candidates, frame.neighbors, frame.max_distance);
    let tested = gather(context.scene, context.memory, point.surface.position, &mut nearest)?;
    context.counters.gathers += 1;
    context.counters.photons_tested += tested as u64;
    context.counters.photons_found += nearest.candidates().len() as u64;
    let header = &context.scene.header;
    let unit = header.photon_power_unit / header.radiance_unit;
    Ok(reflected_radiance(&nearest, &point.surface) * unit * point.weight)
}
