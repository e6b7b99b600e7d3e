//! The final gather: rays over the hemisphere, each ending in a gather of the photons nearest to its end.
//!
//! What a ray meets may emit as well: that is direct light, weighted against the shadow rays that bring it too
//! ([`super::direct`]).

use glam::Vec3;
use photoncard_shared::message::{Fault, Radiance};

use super::specular_path::{PathEnd, follow};
use super::{Context, GatherPoint, direct};
use crate::gather::{GatherRequest, PartialReflection, Place};
use crate::memory::{MemoryPort, Stage};
use crate::photon::{Candidates, NearestPhotons, PhotonMap, gather, nearest_irradiance, reflected_radiance};
use crate::scene::Ray;

/// What the end of a final gather ray brings.
#[derive(Clone, Copy, Debug)]
pub struct GatherRayEnd {
    /// The cell of the hemisphere that the ray went through.
    pub cell: u8,
    /// Direct light of the emitter it met, weighted, in the image's radiance units.
    pub direct: Vec3,
    /// The gather of what is reflected there, if anything is.
    pub request: Option<GatherRequest>,
}

/// Casts ray `index` of a gather point; `None` if it meets nothing. What it brings is its share of the mean over all
/// rays of the point, times `share`; the request's results go to `target`.
///
/// # Errors
/// If the image is not sound.
pub fn cast<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    target: u16,
    share: f32,
    index: u32,
) -> Result<Option<GatherRayEnd>, Fault> {
    context.memory.enter(Stage::GatherRay);
    let sampled = point.directions.sample(&point.reflector(), point.pattern, index, point.rays);
    let Some(sampled) = sampled.filter(|sampled| point.surface.is_above(sampled.direction)) else {
        return Ok(None);
    };
    let ray = Ray::new(point.surface.offset_origin(), sampled.direction);
    context.counters.gather_rays += 1;
    let (path, end) = follow(context, ray, |bounce| point.pattern.choice(index, bounce))?;
    // The mean is taken here, so that the sum stays small.
    let weight = sampled.weight * path.throughput * (share / point.rays as f32);
    let PathEnd::Surface(met, _) = end else { return Ok(None) };
    let met = met.flat();
    let emitted = if path.bounces == 0 {
        direct::seen_by_gather_ray(context, point, &ray, &met, sampled.density)
    } else if context.frame.caustics.is_none() {
        // Neither a shadow ray nor a photon of a caustic brings it.
        met.emission
    } else {
        Vec3::ZERO
    };
    let header = &context.scene.header;
    let request = (!met.reflection.is_black()).then(|| GatherRequest {
        place: Place::new(&header.photon_grid, met.position.to_array()),
        reflection: PartialReflection::new(
            &met,
            weight * (header.photon_power_unit / header.radiance_unit),
            point.pattern.dither(index),
        ),
        target,
        cell: sampled.cell,
    });
    Ok(Some(GatherRayEnd {
        cell: sampled.cell,
        direct: emitted * weight * (1.0 / header.radiance_unit),
        request,
    }))
}

/// Does a gather: what it adds to its target, in the image's radiance units.
///
/// # Errors
/// If the image is not sound.
pub fn gathered<M: MemoryPort>(
    context: &mut Context<M>,
    request: &GatherRequest,
    candidates: Candidates,
) -> Result<Vec3, Fault> {
    context.memory.enter(Stage::Gather);
    let position = request.place.position(&context.scene.header.photon_grid).into();
    // Irradiance does not tell where the light came from, which a lobe asks for.
    if context.frame.radiance == Radiance::Precomputed && !request.reflection.has_lobe() {
        return Ok(request.reflection.diffuse() * irradiance(context, position, request.reflection.normal())?);
    }
    let nearest = nearest_photons(context, position, candidates)?;
    Ok(reflected_radiance(&nearest, position, &request.reflection))
}

/// The precomputed irradiance of a surface near a place, photon power units a square metre; zero where none is known.
#[inline(always)]
fn irradiance<M: MemoryPort>(context: &mut Context<M>, position: Vec3, normal: u8) -> Result<Vec3, Fault> {
    let max_distance = context.frame.max_distance;
    let found = nearest_irradiance(context.scene, context.memory, position, normal, max_distance)?;
    context.counters.lookups += 1;
    context.counters.points_tested += u64::from(found.tested);
    Ok(found.irradiance)
}

/// The frame's number of photons nearest to a place.
#[inline(always)]
pub(super) fn nearest_photons<'a, M: MemoryPort>(
    context: &mut Context<M>,
    position: Vec3,
    candidates: Candidates<'a>,
) -> Result<NearestPhotons<'a>, Fault> {
    let frame = context.frame;
    let mut nearest = NearestPhotons::new(candidates, frame.neighbors, frame.max_distance);
    let tested = gather(context.scene, context.memory, PhotonMap::Indirect, position, &mut nearest)?;
    context.counters.gathers += 1;
    context.counters.photons_tested += tested as u64;
    context.counters.photons_taken += nearest.taken() as u64;
    context.counters.photons_selected += nearest.selected() as u64;
    context.counters.photons_found += nearest.len() as u64;
    Ok(nearest)
}
