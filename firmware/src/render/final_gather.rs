//! Final gather: rays over the hemisphere, with a photon gather at the end of each ray.
//!
//! Emission at the end of a ray is direct light, weighted against shadow rays ([`super::direct`]). A ray that
//! ends near goes on from its end (Jensen 2001, section 9.3).

use core::ops::Range;

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::message::{Fault, Invariant, Radiance};

use super::gather_ray::{Arrived, Reached, arrive};
use super::search::count_reflection;
use super::{Context, GatherPoint, near};
use crate::gather::{GatherRequest, GatherTarget, HilbertCode};
use crate::importance::GatherDirection;
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::{MemoryPort, Stage};
use crate::photon::{
    Candidates, GatherLimits, NearestPhotons, Reflected, gathered_radiance, nearest_irradiance,
};
use crate::scene::{BUNDLE_RAYS, PartialReflection, Ray, RayKind, Surface, closest_hits};

/// Contribution of one final gather ray.
#[derive(Clone, Copy, Debug)]
pub struct GatherRayEnd {
    /// Cell of the gather point's hemisphere that contains the ray's direction.
    pub cell: u8,
    /// Weighted light, in the card image's radiance units, by light group: emission of the surface or
    /// environment that the ray hits, or light that a near end and those after it reflect.
    pub light: GroupedLight,
    /// True if `light` is that of near ends.
    pub is_near: bool,
    /// Request for the photon gather at the end of the ray, or of its last continuation; `None` if no
    /// reflecting surface is there.
    pub request: Option<GatherRequest>,
}

/// Contributions of the rays of a bundle.
pub type GatherRayEnds = Vec<GatherRayEnd, BUNDLE_RAYS>;

/// Divides a range of rays into bundles of at most [`BUNDLE_RAYS`] rays. [`cast`] casts one bundle.
pub fn bundles(rays: Range<u32>) -> impl Iterator<Item = Range<u32>> {
    let Range { start, end } = rays;
    (start..end).step_by(BUNDLE_RAYS).map(move |first| first..end.min(first + BUNDLE_RAYS as u32))
}

/// Casts at most [`BUNDLE_RAYS`] rays of a gather point and stores their contributions in `ends`. Rays that
/// hit neither a surface nor the environment have no contribution. Each contribution is already divided by
/// the number of the point's rays. `target` is the sum to which the gathers' results are to be added.
///
/// # Errors
/// If the card image is invalid, or there are more than [`BUNDLE_RAYS`] rays.
pub fn cast<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    target: GatherTarget,
    rays: Range<u32>,
    ends: &mut GatherRayEnds,
) -> Result<(), Fault> {
    ends.clear();
    context.memory.enter(Stage::GatherRay);
    let mut aimed = Vec::<(u32, GatherDirection), BUNDLE_RAYS>::new();
    let mut bundle = Vec::<Ray, BUNDLE_RAYS>::new();
    for index in rays {
        let sampled = point.directions.sample(&point.reflector(), point.pattern, index, point.rays);
        if let Some(sampled) = sampled.filter(|sampled| point.surface.is_above(sampled.direction)) {
            aimed.push((index, sampled)).map_err(|_| Invariant::Bundle.fault())?;
            let ray = Ray::new(RayKind::Radiance, point.surface.offset_origin(), sampled.direction);
            bundle.push(ray).map_err(|_| Invariant::Bundle.fault())?;
        }
    }
    context.counters.gather_rays += bundle.len() as u64;
    let mut hits = [None; BUNDLE_RAYS];
    closest_hits(context.scene, context.memory, &bundle, &mut hits)?;
    for (((index, sampled), ray), hit) in aimed.iter().zip(&bundle).zip(&mut hits) {
        // The weight is divided by the number of rays here, so that sums stay within the fixed-point range.
        let weight = sampled.weight * (point.weight / point.rays as f32);
        let mut met = Surface::NOWHERE;
        let Arrived { direct, reached } =
            arrive(context, point, (*index, sampled, weight), (ray, hit), &mut met)?;
        let (mut pattern, mut index) = (point.pattern, *index);
        let mut light = direct;
        let mut gathered = reached.map(|reached| reached.weight);
        // One sum for both kinds of light: a ray that brings direct light ends where it meets a surface.
        let near = reached.filter(|end| direct.is_none() && near::is_near(context.frame, end));
        if let Some(Reached { weight, .. }) = near {
            (pattern, index) = (pattern.of_continuations(index), 0);
            gathered = near::follow(context, pattern, weight, &mut met, &mut light)?;
        }
        let header = &context.scene.header;
        let request = gathered.map(|weight| GatherRequest {
            position: HilbertCode::new(&header.photon_grid, met.position.to_array())
                .with_length(&header.photon_grid, met.distance),
            reflection: PartialReflection::encode(
                &met.reflector(),
                weight * (header.photon_power_unit / header.radiance_unit),
                pattern.dither(index),
            ),
            target: target.in_cell(sampled.cell),
        });
        if request.is_some() || !light.is_none() {
            let end = GatherRayEnd { cell: sampled.cell, light, is_near: near.is_some(), request };
            ends.push(end).map_err(|_| Invariant::Bundle.fault())?;
        }
    }
    Ok(())
}

/// Executes a gather. Returns the radiance that it contributes to its target, in the card image's radiance
/// units, by light group. Irradiance points do not distinguish light groups: their light is in the first.
///
/// # Errors
/// If the card image is invalid.
pub fn gathered<M: MemoryPort>(
    context: &mut Context<M>,
    request: &GatherRequest,
    candidates: Candidates,
) -> Result<GroupedLight, Fault> {
    let groups = LightGroups::of(context.frame);
    context.memory.enter(Stage::Gather);
    let position = request.position.position(&context.scene.header.photon_grid).into();
    // A lobe needs the directions of photons, which precomputed irradiance lacks.
    if context.frame.radiance == Radiance::Precomputed && request.reflection.is_lambertian() {
        let irradiance = irradiance(context, position, request.reflection.normal())?;
        return Ok(groups.light(0, request.reflection.lambertian() * irradiance));
    }
    let Context { scene, memory, frame, counters, .. } = context;
    let limits = GatherLimits {
        neighbors: frame.neighbors,
        max_distance: frame.max_distance,
        free_within: request.position.upper_length(&scene.header.photon_grid),
        groups,
    };
    let reflection = &request.reflection;
    let mut count = |tested: u32, nearest: &NearestPhotons, reflected: &Reflected| {
        counters.count_gather(tested, nearest.taken(), nearest.selections(), nearest.len() as u32);
        count_reflection(counters, reflection, nearest, reflected);
    };
    gathered_radiance((scene, *memory), position, reflection, limits, candidates, &mut count)
}

/// Irradiance at the nearest irradiance point of the surface, photon power units/m^2; 0 if there is none
/// within the maximum distance of gathers.
#[inline(always)]
fn irradiance<M: MemoryPort>(context: &mut Context<M>, position: Vec3, normal: u8) -> Result<Vec3, Fault> {
    let max_distance = context.frame.max_distance;
    let found = nearest_irradiance(context.scene, context.memory, position, normal, max_distance)?;
    context.counters.lookups += 1;
    context.counters.points_tested += u64::from(found.tested);
    Ok(found.irradiance)
}
