//! Final gather: rays over the hemisphere, with a photon gather at the end of each ray.
//!
//! Emission at the end of a ray is direct light, weighted against shadow rays ([`super::direct`]).

use core::ops::Range;

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::message::{Fault, Invariant, Radiance};

use super::search::count_reflection;
use super::specular_path::{Carried, Passes, PathEnd, SpecularPath, surface_choice};
use super::{Context, GatherPoint, direct};
use crate::gather::{GatherRequest, GatherTarget, HilbertCode};
use crate::importance::GatherDirection;
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::{MemoryPort, Stage};
use crate::photon::{
    Candidates, GatherLimits, NearestPhotons, Reflected, gathered_radiance, nearest_irradiance,
};
use crate::scene::light::environment_radiance;
use crate::scene::{
    BUNDLE_RAYS, Detail, Hit, PartialReflection, Ray, RayKind, Reflector, Surface, closest_hits,
    read_surface_with,
};

/// Contribution of one final gather ray.
#[derive(Clone, Copy, Debug)]
pub struct GatherRayEnd {
    /// Cell of the gather point's hemisphere that contains the ray's direction.
    pub cell: u8,
    /// Weighted emission of the surface or environment that the ray hits, in the card image's radiance units,
    /// by light group.
    pub direct: GroupedLight,
    /// Request for the photon gather at the end of the ray; `None` if no reflecting surface is there.
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
        if let Some(end) =
            arrive(context, point, target.in_cell(sampled.cell), (*index, sampled), (ray, hit))?
        {
            ends.push(end).map_err(|_| Invariant::Bundle.fault())?;
        }
    }
    Ok(())
}

/// Contribution of ray `index` of a gather point, from its sampled direction and its hit.
fn arrive<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    target: GatherTarget,
    (index, sampled): (u32, &GatherDirection),
    (ray, hit): (&Ray, &mut Option<Hit>),
) -> Result<Option<GatherRayEnd>, Fault> {
    let mut path = SpecularPath::new(*ray, Carried::Radiance, Passes::NarrowLobes);
    // The weight is divided by the number of rays here, so that sums stay within the fixed-point range.
    let weight = sampled.weight * (point.weight / point.rays as f32);
    let Some(hit) = hit else {
        return escaped(context, point, &path, sampled, weight);
    };
    let random = |choice| point.pattern.choice(index, choice);
    let of_surface = |choice| random(surface_choice(0, choice));
    let mut met = Surface::NOWHERE;
    read_surface_with(context.scene, context.memory, ray, hit, Detail::Gathering, &of_surface, &mut met)?;
    if path.may_pass(&met) {
        match path.follow(context, &mut met, hit, &random)? {
            PathEnd::Surface => {}
            PathEnd::Escaped => return escaped(context, point, &path, sampled, weight),
            PathEnd::Lost => {
                let direct = collected(context, point, &path, sampled, weight);
                return Ok(Some(GatherRayEnd { cell: sampled.cell, direct, request: None }));
            }
        }
    }
    met.normal = met.geometric_normal;
    let emitted = if path.is_straight {
        met.distance += path.travelled;
        weight * direct::seen_by_gather_ray(context, point, ray, &met, sampled.density)?
    } else {
        beyond_specular(context, point, sampled, weight) * met.emission
    };
    let mut direct = collected(context, point, &path, sampled, weight);
    let emitted = emitted * path.throughput * (1.0 / context.scene.header.radiance_unit);
    direct.add(LightGroups::of(context.frame).index(met.light_group), emitted);
    let weight = weight * path.throughput;
    let header = &context.scene.header;
    let request = (!met.reflection.is_black()).then(|| GatherRequest {
        position: HilbertCode::new(&header.photon_grid, met.position.to_array())
            .with_length(&header.photon_grid, met.distance),
        reflection: PartialReflection::encode(
            &met.reflector(),
            weight * (header.photon_power_unit / header.radiance_unit),
            point.pattern.dither(index),
        ),
        target,
    });
    Ok(Some(GatherRayEnd { cell: sampled.cell, direct, request }))
}

/// Contribution of a gather ray that leaves the scene: light of the environment, and light collected on the
/// path. `None` if there is neither.
#[inline(never)]
fn escaped<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    path: &SpecularPath,
    sampled: &GatherDirection,
    weight: Vec3,
) -> Result<Option<GatherRayEnd>, Fault> {
    let mut direct = collected(context, point, path, sampled, weight);
    if context.scene.header.lights.texture.is_none() {
        let end = GatherRayEnd { cell: sampled.cell, direct, request: None };
        return Ok((!direct.is_none()).then_some(end));
    }
    let emitted = if path.is_straight {
        weight * direct::escaped(context, point, path.ray.direction, sampled.density)?
    } else {
        let radiance = environment_radiance(context.scene, context.memory, path.ray.direction)?;
        beyond_specular(context, point, sampled, weight) * radiance
    };
    let lights = &context.scene.header.lights;
    let emitted = emitted * path.throughput * (1.0 / context.scene.header.radiance_unit);
    direct.add(LightGroups::of(context.frame).index(lights.light_group), emitted);
    Ok(Some(GatherRayEnd { cell: sampled.cell, direct, request: None }))
}

/// Light of point, spot and distant lights that narrow lobes on the path reflect, times the ray's weight, in
/// the card image's radiance units. Zero if the gather point takes this light from the caustic map.
#[inline(always)]
fn collected<M>(
    context: &Context<M>,
    point: &GatherPoint,
    path: &SpecularPath,
    sampled: &GatherDirection,
    weight: Vec3,
) -> GroupedLight {
    if path.bounces == 0 {
        GroupedLight::NONE
    } else {
        collected_by_lobes(context, point, path, sampled, weight)
    }
}

#[inline(never)]
fn collected_by_lobes<M>(
    context: &Context<M>,
    point: &GatherPoint,
    path: &SpecularPath,
    sampled: &GatherDirection,
    weight: Vec3,
) -> GroupedLight {
    let is_by_map = context.frame.caustics.is_some() && point.surface.reflection.gathers_caustics();
    if path.collected.is_none() || is_by_map {
        return GroupedLight::NONE;
    }
    path.collected
        * beyond_specular(context, point, sampled, weight)
        * (1.0 / context.scene.header.radiance_unit)
}

/// Weight of emission at the end of a gather ray that passed more than flat glass: specular surfaces or
/// narrow lobes. No shadow ray finds this light. Without a caustic map the weight is `weight`. With a caustic
/// map, it is the part of `weight` that belongs to the gather point's narrow lobe: the map lights all other
/// reflection.
fn beyond_specular<M>(
    context: &Context<M>,
    point: &GatherPoint,
    sampled: &GatherDirection,
    weight: Vec3,
) -> Vec3 {
    if context.frame.caustics.is_none() {
        return weight;
    }
    let reflector = point.reflector();
    let lobe = Reflector { reflection: reflector.reflection.narrow_lobe(), ..reflector };
    if lobe.reflection.is_black() {
        return Vec3::ZERO;
    }
    let [part, whole] = [lobe, reflector].map(|reflector| reflector.evaluate(sampled.direction));
    weight * Vec3::select(whole.cmpgt(Vec3::ZERO), part / whole, Vec3::ZERO)
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
