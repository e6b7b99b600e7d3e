//! Direct light: shadow rays to points on emitters, weighted against the final gather rays that meet an emitter.
//!
//! Shadow rays alone are noisy where an emitter is near, as their contribution grows with the inverse square of its
//! distance; gather rays alone where it is small. Both are there in any case, and the balance heuristic (Veach, Guibas
//! 1995) takes from each what it does best: a path found with `n` rays of density `p` one way and `m` of density `q`
//! the other counts `n p / (n p + m q)`. The two weights of a path sum to 1, so that direct light is counted once.

use glam::Vec3;
use photoncard_shared::message::Fault;

use super::{Context, PixelSample};
use crate::importance::reflection_density;
use crate::memory::MemoryPort;
use crate::sampler::{Dimension, Pattern};
use crate::scene::{
    EmitterSample, Ray, Surface, emitter_density, is_occluded, offset_origin, sample_emitter,
};
use crate::vector::max_component;

/// A shadow ray ends this share short of its target, for the rounding of its length.
const SHORTER: f32 = 1.0 - 8.0 * f32::EPSILON;

/// Radiance, W/(sr m^2), that `surface` reflects of the light that emitters send it directly: the shadow rays' share.
///
/// # Errors
/// If the image is not sound.
pub fn reflected<M: MemoryPort>(
    context: &mut Context<M>,
    pixel: PixelSample,
    surface: &Surface,
) -> Result<Vec3, Fault> {
    if surface.reflection.is_black() || context.frame.shadow_rays == 0 {
        return Ok(Vec3::ZERO);
    }
    let frame = context.frame;
    let pattern = Pattern::new(frame.seed, pixel.x, pixel.y, pixel.sample, Dimension::Emitter);
    let mut sum = Vec3::ZERO;
    for index in 0..frame.shadow_rays {
        let point = pattern.point(index, frame.shadow_rays);
        let Some(target) = sample_emitter(context.scene, context.memory, point)? else {
            return Ok(Vec3::ZERO);
        };
        sum += from_emitter(context, surface, &target)?;
    }
    Ok(sum / frame.shadow_rays as f32)
}

/// What one point on an emitter adds, over its probability density.
fn from_emitter<M: MemoryPort>(
    context: &mut Context<M>,
    surface: &Surface,
    target: &EmitterSample,
) -> Result<Vec3, Fault> {
    let origin = surface.offset_origin();
    let away = origin - target.position;
    let is_front = target.normal.dot(away) > 0.0;
    if !is_front && !target.double_sided {
        return Ok(Vec3::ZERO);
    }
    let emitting_normal = if is_front { target.normal } else { -target.normal };
    let way = offset_origin(target.position, emitting_normal, target.magnitude) - origin;
    let distance_squared = way.length_squared();
    let distance = libm::sqrtf(distance_squared);
    let direction = way / distance;
    let cosine = surface.normal.dot(direction);
    let emitter_cosine = -emitting_normal.dot(direction);
    // Not `<= 0`: a zero distance makes both NaN.
    if !(cosine > 0.0 && emitter_cosine > 0.0) {
        return Ok(Vec3::ZERO);
    }
    context.counters.shadow_rays += 1;
    let ray = Ray { origin, direction, max_distance: distance * SHORTER };
    if is_occluded(context.scene, context.memory, &ray)? {
        return Ok(Vec3::ZERO);
    }
    let reflection = surface.reflection.evaluate(surface.normal, surface.outgoing, direction);
    let geometry = cosine * emitter_cosine / (distance_squared * target.density);
    let area_density = emitter_density(context.scene, target.emission, target.double_sided);
    let density = area_density * distance_squared / emitter_cosine;
    let weight = balance(
        (context.frame.shadow_rays, density),
        (context.frame.gather_rays, reflection_density(surface, direction)),
    );
    Ok(reflection * target.emission * (geometry * weight))
}

/// The radiance that a gather ray brings straight from an emitter that it has met, with its weight against the shadow
/// rays. `gather_density` is the ray's own probability density, 1/sr.
#[inline(always)]
pub fn seen_by_gather_ray<M>(context: &Context<M>, ray: &Ray, met: &Surface, gather_density: f32) -> Vec3 {
    if max_component(met.emission) <= 0.0 {
        return Vec3::ZERO;
    }
    let emitter_cosine = -met.normal.dot(ray.direction);
    let area_density = emitter_density(context.scene, met.emission, met.double_sided);
    let density = area_density * (met.distance * met.distance) / emitter_cosine;
    met.emission * balance((context.frame.gather_rays, gather_density), (context.frame.shadow_rays, density))
}

/// The weight of the first of two ways to find a path, each with its number of rays and its density.
#[inline(always)]
fn balance((rays, density): (u32, f32), (other_rays, other_density): (u32, f32)) -> f32 {
    if other_rays == 0 {
        return 1.0;
    }
    // Divided first: a density may be infinite at a grazing angle, and the weight is then 1 or 0.
    let ratio = (other_rays as f32 * other_density) / (rays as f32 * density);
    1.0 / (1.0 + ratio)
}
