//! Gather rays that end near their point go on (Jensen 2001, section 9.3).
//!
//! The photons of a gather are spread over a disc. Where a gather ray is shorter than the disc's radius, the
//! point sees another part of the surface than the disc covers: in a narrow gap, photons of the light
//! outside it would light its depth. The end of such a ray is therefore a gather point of its own, with one
//! shadow ray, a gather of caustics and one gather ray, which may end near in turn.

use glam::Vec3;
use photoncard_shared::message::{Fault, FrameParameters};

use super::gather_ray::{Arrived, Reached, arrive};
use super::{Context, GatherPoint, caustic, direct};
use crate::light_groups::GroupedLight;
use crate::memory::{MemoryPort, Stage};
use crate::sampler::Pattern;
use crate::scene::{Ray, RayKind, Surface, closest_hit};

/// Maximum number of near ends of a gather ray and its continuations. At a further one, photons are gathered.
const MOST_ENDS: u32 = 8;

/// Returns true if a gather ray goes on from `end`.
#[inline(always)]
pub(super) fn is_near(frame: &FrameParameters, end: &Reached) -> bool {
    end.length < frame.near_distance
}

/// Follows a gather ray from its near end `met`. `weight` is the weight of the light that `met` reflects, and
/// `pattern` that of the ray's continuations. Adds the light that near ends reflect, without the light of
/// photons, to `reflected`, in the card image's radiance units. Replaces `met` by the end of the last
/// continuation, and returns the weight of its light; `None` if no surface is there.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub(super) fn follow<M: MemoryPort>(
    context: &mut Context<M>,
    pattern: Pattern,
    mut weight: Vec3,
    met: &mut Surface,
    reflected: &mut GroupedLight,
) -> Result<Option<Vec3>, Fault> {
    for end in 0..MOST_ENDS {
        let point = GatherPoint::near(*met, pattern.of_continuations(end));
        let light = direct::reflected_at_near_end(context, &point)?;
        *reflected += light * (weight * (1.0 / context.scene.header.radiance_unit));
        *reflected += caustic::reflected(context, &point)? * weight;
        context.memory.enter(Stage::GatherRay);
        let sampled = point.directions.sample(&point.reflector(), point.pattern, 0, point.rays);
        let Some(sampled) = sampled.filter(|sampled| point.surface.is_above(sampled.direction)) else {
            return Ok(None);
        };
        context.counters.gather_rays += 1;
        let ray = Ray::new(RayKind::Radiance, point.surface.offset_origin(), sampled.direction);
        let mut hit = closest_hit(context.scene, context.memory, &ray)?;
        let passed = weight * sampled.weight;
        let Arrived { direct, reached } =
            arrive(context, &point, (0, &sampled, passed), (&ray, &mut hit), met)?;
        *reflected += direct;
        match reached {
            Some(reached) if is_near(context.frame, &reached) => weight = reached.weight,
            end => return Ok(end.map(|reached| reached.weight)),
        }
    }
    Ok(Some(weight))
}
