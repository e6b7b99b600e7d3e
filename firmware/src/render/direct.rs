//! Direct light: shadow rays to points on emitters.

use glam::Vec3;
use photoncard_shared::message::Fault;

use super::{Context, PixelSample};
use crate::memory::MemoryPort;
use crate::sampler::{Dimension, Pattern};
use crate::scene::{EmitterSample, Ray, Surface, is_occluded, offset_origin, sample_emitter};

/// A shadow ray ends this share short of its target, for the rounding of its length.
const SHORTER: f32 = 1.0 - 8.0 * f32::EPSILON;

/// Radiance, W/(sr m^2), that `surface` reflects of the light that emitters send it directly.
///
/// # Errors
/// If the image is not sound.
pub fn reflected<M: MemoryPort>(
    context: &mut Context<M>,
    pixel: PixelSample,
    surface: &Surface,
) -> Result<Vec3, Fault> {
    if surface.reflection.is_black() {
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
    let origin = offset_origin(surface.position, surface.normal);
    let away = origin - target.position;
    let is_front = target.normal.dot(away) > 0.0;
    if !is_front && !target.double_sided {
        return Ok(Vec3::ZERO);
    }
    let emitting_normal = if is_front { target.normal } else { -target.normal };
    let way = offset_origin(target.position, emitting_normal) - origin;
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
    Ok(reflection * target.emission * geometry)
}
