//! Paths through perfectly specular surfaces: mirrors, smooth coats, smooth glass.
//!
//! Where a ray meets such a surface, one way is taken at random, in proportion to its share of the light: the path is
//! reflected, transmitted, or stays for the rest of the reflection. The samples of a pixel take all ways. A path ends, black,
//! after [`SPECULAR_BOUNCES`].
//!
//! Absorption follows the law of Beer and Lambert in the glass entered last; glass within glass is not kept track of.

use glam::Vec3;
use photoncard_shared::budget::SPECULAR_BOUNCES;
use photoncard_shared::message::Fault;

use super::Context;
use crate::memory::MemoryPort;
use crate::scene::{Hit, Ray, Surface, closest_hit, read_surface};
use crate::vector::{max, max_component};

/// Least probability to stay over that to go on, where the reflection is not black.
const MIN_STAY: f32 = 1.0 / 16.0;

/// A path through specular surfaces, up to its present ray.
#[derive(Clone, Copy, Debug)]
pub struct SpecularPath {
    /// The present ray.
    pub ray: Ray,
    /// Throughput between the path's origin and the present ray, without unit.
    pub throughput: Vec3,
    /// Specular surfaces passed.
    pub bounces: u32,
    /// Distance of the first of them from the origin, metres.
    pub first_distance: f32,
    /// The quantity that is carried.
    carried: Carried,
    /// Absorption coefficient around the ray, 1/m.
    absorption: Vec3,
}

/// The quantity that a path carries. At the surface of glass, radiance changes with the square of the index of refraction
/// (Veach 1997, section 5.2); power does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carried {
    /// Radiance, against the way that the path is followed.
    Radiance,
    /// Power, as photons do.
    Power,
}

/// The continuation of a path at a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// It ends there.
    Ends,
    /// It goes on along its new ray.
    GoesOn,
    /// It has met too many surfaces, or one that takes everything.
    Lost,
}

/// The end of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathEnd {
    /// On a surface.
    Surface,
    /// Outside the scene.
    Escaped,
    /// Lost: see [`Arrival::Lost`].
    Lost,
}

impl SpecularPath {
    /// A path along a ray.
    #[inline(always)]
    pub fn new(ray: Ray, carried: Carried) -> Self {
        Self { ray, throughput: Vec3::ONE, bounces: 0, first_distance: 0.0, carried, absorption: Vec3::ZERO }
    }

    /// Arrives at a surface; `random` in [0, 1) chooses the way.
    #[inline(always)]
    pub fn arrive(&mut self, surface: &Surface, random: f32) -> Arrival {
        if surface.specular.is_none() && self.absorption == Vec3::ZERO {
            return Arrival::Ends;
        }
        self.arrive_at_specular(surface, random)
    }

    #[inline(never)]
    fn arrive_at_specular(&mut self, surface: &Surface, random: f32) -> Arrival {
        let inside = surface.absorption != Vec3::ZERO;
        let absorption = if inside { surface.absorption } else { self.absorption };
        self.throughput *= Vec3::from_array((absorption * -surface.distance).to_array().map(libm::expf));
        if self.bounces == 0 {
            self.first_distance = surface.distance;
        }
        let specular = &surface.specular;
        if specular.is_none() {
            return Arrival::Ends;
        }
        let [reflected, transmitted] = [specular.reflected, specular.transmitted].map(max_component);
        let goes = reflected + transmitted;
        let stays = max_component(surface.reflector().albedo());
        // Often enough that a path that stays is no firefly; at an emitter half of the time.
        let stays = if stays > 0.0 { max(stays, goes * MIN_STAY) } else { 0.0 };
        let stays = if max_component(surface.emission) > 0.0 { max(stays, goes) } else { stays };
        let all = goes + stays;
        let chosen = random * all;
        if chosen < stays {
            self.throughput *= all / stays;
            return Arrival::Ends;
        }
        if all <= 0.0 || self.bounces >= SPECULAR_BOUNCES {
            return Arrival::Lost;
        }
        self.bounces += 1;
        if chosen < stays + reflected || transmitted <= 0.0 {
            self.throughput *= specular.reflected * (all / reflected);
            self.ray = Ray::new(surface.offset_origin(), surface.mirrored());
        } else {
            let scale = if self.carried == Carried::Radiance { specular.radiance_scale } else { 1.0 };
            self.throughput *= specular.transmitted * (scale * all / transmitted);
            self.ray = Ray::new(surface.offset_behind(), specular.behind);
            self.absorption = specular.absorption;
        }
        Arrival::GoesOn
    }

    /// Follows the path from a perfectly specular surface to its end, which replaces `surface` and `hit`. `random` gives a number
    /// in [0, 1) for each bounce.
    ///
    /// # Errors
    /// If the image is not sound.
    #[inline(never)]
    pub fn follow<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        surface: &mut Surface,
        hit: &mut Hit,
        random: &dyn Fn(u32) -> f32,
    ) -> Result<PathEnd, Fault> {
        loop {
            match self.arrive(surface, random(self.bounces)) {
                Arrival::Ends => return Ok(PathEnd::Surface),
                Arrival::Lost => {
                    context.counters.lost_paths += 1;
                    return Ok(PathEnd::Lost);
                }
                Arrival::GoesOn => context.counters.specular_rays += 1,
            }
            let next = closest_hit(context.scene, context.memory, &self.ray)?;
            let Some(next) = next else { return Ok(PathEnd::Escaped) };
            *hit = next;
            *surface = read_surface(context.scene, context.memory, &self.ray, hit)?;
        }
    }
}
