//! Direct light, paths `L D S* E`, by shadow rays to lights ([`crate::scene::light`]) and by final gather
//! rays that hit a light.
//!
//! Shadow rays are noisy near an emitter, as their contribution grows with the inverse square of the
//! distance; gather rays are noisy where the emitter is small. Gather rays are cast in any case, and both
//! techniques are combined by the balance heuristic (Veach, Guibas 1995). With `n` rays of density `p` in one
//! technique and `m` rays of density `q` in the other, a path has the weight `n p / (n p + m q)` in the
//! first. The two weights of a path add up to 1, so that direct light is counted once.
//!
//! The emission hit by the rays of an irradiance record is interpolated for the samples around the record;
//! the samples' shadow rays add the remainder. Record and samples must agree on the weights, but samples do
//! not know the record's direction table. The weights therefore assume the density `cos(theta) / pi` for the
//! record's rays, and the shadow rays of all planned samples of a pixel. Here the power heuristic is used: it
//! leaves small emitters, which would make a record noisy, to shadow rays, and a sky to records.
//!
//! No gather ray hits point, spot and distant lights, so that only shadow rays contribute their light.
//!
//! Flat glass does not hide lights: a shadow ray that passes flat glass is multiplied by the glass's
//! transmittance. A gather ray that has passed only flat glass hits a light with the same weights as if it
//! had passed nothing.
//!
//! Light samples are stratified over all samples of a pixel: many samples with one or two shadow rays each
//! are as good as one sample with many.

use core::f32::consts::FRAC_1_PI;

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::message::{Fault, Invariant};

use super::{Context, GatherPoint, PixelSample, Purpose, SHORTER};
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::{MemoryPort, Stage};
use crate::sampler::Dimension;
use crate::scene::light::{
    LightChoices, LightSample, Receiver, emitter_density, environment_density, environment_radiance,
    sample_light,
};
use crate::scene::{BUNDLE_RAYS, Passed, Ray, Surface, transmittance, transmittances};
use crate::vector::max_component;

/// Direct light that a gather point reflects, W/(sr m^2), by light group, estimated by shadow rays and
/// weighted against gather rays.
///
/// # Errors
/// If the card image is invalid.
pub fn reflected<M: MemoryPort>(
    context: &mut Context<M>,
    pixel: PixelSample,
    point: &GatherPoint,
) -> Result<GroupedLight, Fault> {
    if point.surface.reflection.is_black() || context.frame.shadow_rays == 0 {
        return Ok(GroupedLight::NONE);
    }
    context.memory.enter(Stage::Shadow);
    let frame = context.frame;
    let (pattern, sample) = pixel.stratified(frame, Dimension::Emitter);
    let receiver = Receiver::new(&point.surface);
    let mut choices = LightChoices::new(receiver);
    let mut sum = GroupedLight::NONE;
    let mut rays = ShadowRays::new();
    for index in 0..frame.shadow_rays {
        let index = sample.wrapping_mul(frame.shadow_rays).wrapping_add(index);
        let (place, dither) = (pattern.point(index), pattern.dither(index));
        let light = sample_light(context.scene, context.memory, &mut choices, place, dither)?;
        if let Some(light) = light
            && point.surface.is_above(light.direction)
            && max_component(light.irradiance) > 0.0
        {
            rays.push(receiver.origin, light)?;
            if rays.is_full() {
                rays.cast(context, point, &mut sum)?;
            }
        }
    }
    rays.cast(context, point, &mut sum)?;
    Ok(sum / frame.shadow_rays as f32)
}

/// Direct light that the near end of a gather ray reflects, W/(sr m^2), by light group, estimated by one
/// shadow ray and weighted against the gather ray that goes on.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub fn reflected_at_near_end<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
) -> Result<GroupedLight, Fault> {
    context.memory.enter(Stage::Shadow);
    let receiver = Receiver::new(&point.surface);
    let mut choices = LightChoices::new(receiver);
    let (place, dither) = (point.pattern.point(0), point.pattern.dither(0));
    let light = sample_light(context.scene, context.memory, &mut choices, place, dither)?;
    let meets = |light: &LightSample| {
        point.surface.is_above(light.direction) && max_component(light.irradiance) > 0.0
    };
    let Some(light) = light.filter(meets) else { return Ok(GroupedLight::NONE) };
    context.counters.shadow_rays += 1;
    let ray = Ray::of_light(receiver.origin, light.direction, light.distance * SHORTER);
    let share = transmittance(context.scene, context.memory, &ray)?;
    if share == Vec3::ZERO {
        return Ok(GroupedLight::NONE);
    }
    let reflected = from_light(context, point, &light) * share;
    Ok(LightGroups::of(context.frame).light(light.light_group, reflected))
}

/// Shadow rays of a point that are cast together, each with its light sample.
struct ShadowRays {
    rays: Vec<Ray, BUNDLE_RAYS>,
    lights: Vec<LightSample, BUNDLE_RAYS>,
}

impl ShadowRays {
    fn new() -> Self {
        Self { rays: Vec::new(), lights: Vec::new() }
    }

    /// Adds the shadow ray of a light sample.
    fn push(&mut self, origin: Vec3, light: LightSample) -> Result<(), Fault> {
        let LightSample { direction, distance, .. } = light;
        let ray = Ray::of_light(origin, direction, distance * SHORTER);
        self.rays.push(ray).map_err(|_| Invariant::Bundle.fault())?;
        self.lights.push(light).map_err(|_| Invariant::Bundle.fault())
    }

    fn is_full(&self) -> bool {
        self.rays.is_full()
    }

    /// Casts the rays. Adds the radiance that the point reflects, W/(sr m^2), to `sum`.
    fn cast<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        point: &GatherPoint,
        sum: &mut GroupedLight,
    ) -> Result<(), Fault> {
        let groups = LightGroups::of(context.frame);
        context.counters.shadow_rays += self.rays.len() as u64;
        let passed = transmittances(context.scene, context.memory, &self.rays)?;
        for (light, Passed(share)) in self.lights.iter().zip(passed) {
            if share != Vec3::ZERO {
                sum.add(groups.index(light.light_group), from_light(context, point, light) * share);
            }
        }
        self.rays.clear();
        self.lights.clear();
        Ok(())
    }
}

/// Radiance, W/(sr m^2), that a gather point reflects from an unoccluded light sample, weighted against
/// gather rays.
fn from_light<M>(context: &Context<M>, point: &GatherPoint, light: &LightSample) -> Vec3 {
    let surface = &point.surface;
    let LightSample { direction, irradiance, density, .. } = *light;
    let cosine = surface.normal.dot(direction);
    let reflector = point.reflector();
    // No gather ray meets a light without extent: weight 1.
    let weight = density.map_or(1.0, |density| {
        let by_gather_rays = (point.rays, point.directions.density(&reflector, direction));
        balance((point.shadow_rays(context.frame), density), by_gather_rays)
    });
    let shared = reflector.evaluate(direction);
    let mut reflected = shared * weight;
    if point.purpose == Purpose::Lobe {
        let weight = density.map_or(1.0, |density| {
            power(shadow_rays_for_records(context, density), rays_of_record(context, cosine))
        });
        reflected += surface.reflector().lambertian() * weight;
    }
    reflected * irradiance * cosine
}

/// Emission of the surface that a gather ray hits, times the ray's weight against shadow rays, W/(sr m^2).
/// `met.distance` is the distance from the point, `gather_density` the ray's probability density, 1/sr.
///
/// # Errors
/// If the card image is invalid.
#[inline(always)]
pub fn seen_by_gather_ray<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    ray: &Ray,
    met: &Surface,
    gather_density: f32,
) -> Result<Vec3, Fault> {
    if max_component(met.emission) <= 0.0 {
        return Ok(Vec3::ZERO);
    }
    // An emissive surface that is too dark for the light tree is found by gather rays only: weight 1.
    let density = match met.emitter {
        Some(emitter) => {
            let receiver = Receiver::new(&point.surface);
            let cosine = -met.geometric_normal.dot(ray.direction);
            let met_at = (met.distance, cosine);
            emitter_density(context.scene, context.memory, &receiver, emitter, met_at)?
        }
        None => 0.0,
    };
    Ok(met.emission * weight_of_gather_ray(context, point, ray.direction, gather_density, density))
}

/// Radiance of the environment along a gather ray that leaves the scene, times the ray's weight against
/// shadow rays, W/(sr m^2). `gather_density` is the ray's probability density, 1/sr.
///
/// # Errors
/// If the card image is invalid.
pub fn escaped<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
    direction: Vec3,
    gather_density: f32,
) -> Result<Vec3, Fault> {
    let radiance = environment_radiance(context.scene, context.memory, direction)?;
    if max_component(radiance) <= 0.0 {
        return Ok(Vec3::ZERO);
    }
    let density = environment_density(context.scene, context.memory, direction)?;
    Ok(radiance * weight_of_gather_ray(context, point, direction, gather_density, density))
}

/// Weight of a gather ray's emission against shadow rays. `density` is the density of light samples in the
/// ray's direction, 1/sr.
#[inline(always)]
fn weight_of_gather_ray<M>(
    context: &Context<M>,
    point: &GatherPoint,
    direction: Vec3,
    gather_density: f32,
    density: f32,
) -> f32 {
    if point.purpose == Purpose::Record {
        let cosine = point.surface.normal.dot(direction);
        power(rays_of_record(context, cosine), shadow_rays_for_records(context, density))
    } else {
        balance((point.rays, gather_density), (point.shadow_rays(context.frame), density))
    }
}

/// Number of gather rays of a record, and the density `cos(theta) / pi`, 1/sr, that weights assume for each
/// ray.
#[inline(always)]
fn rays_of_record<M>(context: &Context<M>, cosine: f32) -> (u32, f32) {
    (context.frame.gather_rays, cosine * FRAC_1_PI)
}

/// Number of shadow rays against which a record's gather rays are weighted, and the density of each, 1/sr.
#[inline(always)]
fn shadow_rays_for_records<M>(context: &Context<M>, density: f32) -> (u32, f32) {
    (context.frame.shadow_rays * context.frame.planned_samples, density)
}

/// Balance heuristic: weight of the first of two sampling techniques, each given by its number of rays and
/// its density.
#[inline(always)]
fn balance(way: (u32, f32), other: (u32, f32)) -> f32 {
    1.0 / (1.0 + ratio(other, way))
}

/// Power heuristic with exponent 2 (Veach, Guibas 1995), with the arguments of [`balance`].
#[inline(always)]
fn power(way: (u32, f32), other: (u32, f32)) -> f32 {
    let ratio = ratio(other, way);
    1.0 / (1.0 + ratio * ratio)
}

/// Ratio `n p / (m q)` of two sampling techniques; 0 if the first has no rays.
#[inline(always)]
fn ratio((rays, density): (u32, f32), (other_rays, other_density): (u32, f32)) -> f32 {
    if rays == 0 {
        return 0.0;
    }
    // At a grazing angle a density, and the ratio, may be infinite.
    (rays as f32 * density) / (other_rays as f32 * other_density)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_shadow_ray_too_many_is_a_fault() {
        let light = || LightSample {
            direction: Vec3::Y,
            distance: 1.0,
            irradiance: Vec3::ONE,
            density: None,
            light_group: 0,
        };
        let mut rays = ShadowRays::new();
        for _ in 0..BUNDLE_RAYS {
            assert_eq!(rays.push(Vec3::ZERO, light()), Ok(()));
        }
        assert_eq!(rays.push(Vec3::ZERO, light()), Err(Invariant::Bundle.fault()));
    }
}
