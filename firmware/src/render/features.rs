//! Features of a sample, which guide a denoiser: albedo and normal of the surface that the sample shows.
//!
//! The features are those of the surface at which the eye path ends: the first that is not perfectly
//! specular. If that surface has a sharp lobe, one ray sampled from the lobe finds another surface, whose
//! features count instead, as in Cycles.

use glam::Vec3;
use photoncard_shared::message::Fault;

use super::eye::View;
use super::specular_path::{Carried, Passes, PathEnd, SpecularPath, surface_choice};
use super::{Context, PixelSample};
use crate::memory::MemoryPort;
use crate::sampler::Dimension;
use crate::scene::{Ray, RayKind, ReflectedDirection, Surface, closest_hit, read_surface};

/// Minimum fraction of a surface's albedo that its sharp lobe must contribute, so that the features are taken
/// from the surface that the lobe reflects.
const MIN_SHARP_SHARE: f32 = 0.75;

/// Albedo and normal that a sample shows, which guide a denoiser.
#[derive(Clone, Copy, Debug)]
pub struct Features {
    /// Albedo, multiplied by the throughput of the path from the eye. It can exceed 1.
    pub albedo: Vec3,
    /// Unit shading normal, in world space; zero where nothing is seen.
    pub normal: Vec3,
}

impl Features {
    /// Features where nothing is seen.
    pub(crate) const NOTHING: Self = Self { albedo: Vec3::ZERO, normal: Vec3::ZERO };

    fn of(surface: &Surface) -> Self {
        Self { albedo: surface.reflector().albedo(), normal: surface.normal }
    }
}

/// Features of a sample whose eye path ends at a surface.
///
/// # Errors
/// If the card image is invalid.
pub fn features<M: MemoryPort>(
    context: &mut Context<M>,
    pixel: PixelSample,
    view: &View,
) -> Result<Features, Fault> {
    let surface = &view.surface;
    // A lobe that was chosen at random, such as that of a coat, is alone in the reflection; its share of the
    // whole surface's albedo is about the probability of the choice.
    if surface.probability * surface.reflection.sharp_share() < MIN_SHARP_SHARE {
        return Ok(Features::of(surface));
    }
    let Features { albedo, normal } = reflected(context, pixel, surface)?;
    Ok(Features { albedo: surface.reflector().lambertian_albedo() + albedo, normal })
}

/// Features of the surface that a ray sampled from `surface`'s lobe finds.
#[inline(never)]
fn reflected<M: MemoryPort>(
    context: &mut Context<M>,
    pixel: PixelSample,
    surface: &Surface,
) -> Result<Features, Fault> {
    let (pattern, index) = pixel.stratified(context.frame, Dimension::Features);
    let reflector = surface.reflector();
    let ReflectedDirection { direction, weight } = reflector.sample_lobe_alone(pattern.point(index));
    if !surface.is_above(direction) {
        return Ok(Features::NOTHING);
    }
    context.counters.specular_rays += 1;
    let ray = Ray::new(RayKind::Radiance, surface.offset_origin(), direction);
    let Some(mut hit) = closest_hit(context.scene, context.memory, &ray)? else {
        return Ok(Features::NOTHING);
    };
    let random = |choice| pattern.choice(index, choice);
    let of_surface = |choice| random(surface_choice(0, choice));
    let mut shown = Surface::NOWHERE;
    read_surface(context.scene, context.memory, &ray, &hit, &of_surface, &mut shown)?;
    let mut path = SpecularPath::new(ray, Carried::Radiance, Passes::Specular);
    if path.may_pass(&shown) && path.follow(context, &mut shown, &mut hit, &random)? != PathEnd::Surface {
        return Ok(Features::NOTHING);
    }
    let Features { albedo, normal } = Features::of(&shown);
    Ok(Features { albedo: weight * path.throughput * albedo, normal })
}
