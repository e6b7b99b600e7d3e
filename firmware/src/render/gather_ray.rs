//! End of a gather ray: emission and reflecting surface, by way of specular surfaces and narrow lobes.

use glam::Vec3;
use photoncard_shared::message::Fault;

use super::specular_path::{Carried, Passes, PathEnd, SpecularPath, surface_choice};
use super::{Context, GatherPoint, direct};
use crate::importance::GatherDirection;
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::MemoryPort;
use crate::scene::light::environment_radiance;
use crate::scene::{Detail, Hit, Ray, Reflector, Surface, read_surface_with};

/// Light and end of a gather ray.
pub(super) struct Arrived {
    /// Weighted emission, and light of punctual lights that narrow lobes on the way reflect, in the card
    /// image's radiance units.
    pub(super) direct: GroupedLight,
    /// End at a reflecting surface; `None` without one.
    pub(super) reached: Option<Reached>,
}

/// End of a gather ray at a reflecting surface.
#[derive(Clone, Copy)]
pub(super) struct Reached {
    /// Weight of the light that the surface reflects.
    pub(super) weight: Vec3,
    /// Length of the whole path from the gather point, metres.
    pub(super) length: f32,
}

impl Arrived {
    fn without_surface(direct: GroupedLight) -> Self {
        Self { direct, reached: None }
    }
}

/// Light and end of ray `index` of a gather point, from its sampled direction, its weight and its hit. The
/// surface at its end is read into `met`, with the geometric normal as normal.
#[inline(always)]
pub(super) fn arrive<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    (index, sampled, weight): (u32, &GatherDirection, Vec3),
    (ray, hit): (&Ray, &mut Option<Hit>),
    met: &mut Surface,
) -> Result<Arrived, Fault> {
    let mut path = SpecularPath::new(*ray, Carried::Radiance, Passes::NarrowLobes);
    let Some(hit) = hit else {
        return escaped(context, point, &path, sampled, weight);
    };
    let random = |choice| point.pattern.choice(index, choice);
    let of_surface = |choice| random(surface_choice(0, choice));
    read_surface_with(context.scene, context.memory, ray, hit, Detail::Gathering, &of_surface, met)?;
    if path.may_pass(met) {
        match path.follow(context, met, hit, &random)? {
            PathEnd::Surface => {}
            PathEnd::Escaped => return escaped(context, point, &path, sampled, weight),
            PathEnd::Lost => {
                return Ok(Arrived::without_surface(collected(context, point, &path, sampled, weight)));
            }
        }
    }
    met.normal = met.geometric_normal;
    let length = path.travelled + met.distance;
    let emitted = if path.is_straight {
        met.distance = length;
        weight * direct::seen_by_gather_ray(context, point, ray, met, sampled.density)?
    } else {
        beyond_specular(context, point, sampled, weight) * met.emission
    };
    let mut direct = collected(context, point, &path, sampled, weight);
    let emitted = emitted * path.throughput * (1.0 / context.scene.header.radiance_unit);
    direct.add(LightGroups::of(context.frame).index(met.light_group), emitted);
    let reached =
        (!met.reflection.is_black()).then_some(Reached { weight: weight * path.throughput, length });
    Ok(Arrived { direct, reached })
}

/// Light of a gather ray that leaves the scene: that of the environment, and that collected on the path.
#[inline(never)]
fn escaped<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    path: &SpecularPath,
    sampled: &GatherDirection,
    weight: Vec3,
) -> Result<Arrived, Fault> {
    let mut direct = collected(context, point, path, sampled, weight);
    if context.scene.header.lights.texture.is_none() {
        return Ok(Arrived::without_surface(direct));
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
    Ok(Arrived::without_surface(direct))
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
