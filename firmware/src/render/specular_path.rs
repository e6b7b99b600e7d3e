//! Paths through specular surfaces: mirrors, smooth coats and smooth glass. For gather rays and photons,
//! narrow lobes ([`crate::scene::Reflection::has_narrow_lobe`]) are specular too.
//!
//! At a specular surface a path takes one continuation at random, in proportion to the continuation's share
//! of the light: reflection, transmission, a direction in the narrow lobe, or the end of the path, which
//! stands for the rest of the surface's reflection. The samples of a pixel cover all continuations. After
//! [`FREE_BOUNCES`] bounces a path survives with probability `min(1, throughput)` (Russian roulette), and
//! after [`SPECULAR_BOUNCES`] it contributes nothing.
//!
//! Absorption follows the Beer-Lambert law, with the coefficient of the glass that the path entered last;
//! nested glass is not tracked. Flat glass changes neither direction nor medium.

use glam::Vec3;
use photoncard_shared::budget::{FREE_BOUNCES, SPECULAR_BOUNCES};
use photoncard_shared::message::Fault;

use super::{Context, SHORTER};
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::MemoryPort;
use crate::scene::light::{LightChoices, LightSample, Receiver, sample_light};
use crate::scene::{
    Hit, Ray, RayKind, ReflectedDirection, Reflection, Reflector, SURFACE_CHOICES, Surface, closest_hit,
    read_surface, transmittance,
};
use crate::vector::{max, max_component, min};

/// Minimum of `p / (1 - p)` at a surface whose reflection is not black, where `p` is the probability that a
/// path ends there.
const MIN_STAY: f32 = 1.0 / 16.0;

/// A path through specular surfaces, up to its current ray.
#[derive(Clone, Copy, Debug)]
pub struct SpecularPath {
    /// The current ray.
    pub ray: Ray,
    /// Throughput between the path's origin and the current ray, dimensionless.
    pub throughput: Vec3,
    /// Light of point, spot and distant lights that narrow lobes on the path reflect towards the path's
    /// origin, W/(sr m^2), by light group. No ray can hit these lights.
    pub collected: GroupedLight,
    /// Number of specular surfaces that the path has passed.
    pub bounces: u32,
    /// Distance from the path's origin to the first specular surface, metres.
    pub first_distance: f32,
    /// True while the path has passed nothing but flat glass, so that the path is a straight line.
    pub is_straight: bool,
    /// Length of the path up to the origin of the current ray, metres.
    pub travelled: f32,
    carried: Carried,
    passes: Passes,
    /// Absorption coefficient of the medium around the current ray, 1/m.
    absorption: Vec3,
}

/// Quantity that a path transports. Refraction scales radiance by the square of the relative index of
/// refraction (Veach 1997, section 5.2), and leaves power unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carried {
    /// Radiance. The path is followed from the eye, against the light.
    Radiance,
    /// Power. The path is that of a photon, from a light.
    Power,
}

impl Carried {
    fn ray_kind(self) -> RayKind {
        match self {
            Self::Radiance => RayKind::Radiance,
            Self::Power => RayKind::Light,
        }
    }
}

/// Kinds of surfaces that a path passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passes {
    /// Perfectly specular surfaces. Used for eye paths, which end at lobes: gather rays are cast there.
    Specular,
    /// Perfectly specular surfaces and narrow lobes ([`crate::scene::Reflection::has_narrow_lobe`]). Used for
    /// gather rays and photons.
    NarrowLobes,
    /// Same as [`Self::NarrowLobes`], but the path can end at narrow lobes that the caustic map lights
    /// ([`crate::scene::Reflection::keeps_caustics`]). Used for photons of the caustic map.
    CausticPhotons,
}

/// Continuation of a path at a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// The path ends at the surface.
    Ends,
    /// The path continues along a new ray.
    GoesOn,
    /// The path contributes nothing, because it has passed too many specular surfaces, or reached a surface
    /// that absorbs all light.
    Lost,
    /// The path contributes nothing, because the sampled direction of a narrow lobe lies below the surface.
    Absorbed,
}

/// End of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathEnd {
    /// The path ends on a surface.
    Surface,
    /// The path leaves the scene.
    Escaped,
    /// The path contributes nothing ([`Arrival::Lost`], [`Arrival::Absorbed`]), or was ended by Russian
    /// roulette.
    Lost,
}

impl SpecularPath {
    /// Creates a path along a ray.
    #[inline(always)]
    pub fn new(ray: Ray, carried: Carried, passes: Passes) -> Self {
        Self {
            ray,
            throughput: Vec3::ONE,
            collected: GroupedLight::NONE,
            bounces: 0,
            first_distance: 0.0,
            is_straight: true,
            travelled: 0.0,
            carried,
            passes,
            absorption: Vec3::ZERO,
        }
    }

    /// Returns whether the path can continue at a surface.
    #[inline(always)]
    pub fn may_pass(&self, surface: &Surface) -> bool {
        !surface.specular.is_none() || self.passes_lobe(surface)
    }

    #[inline(always)]
    fn passes_lobe(&self, surface: &Surface) -> bool {
        self.passes != Passes::Specular && surface.reflection.has_narrow_lobe()
    }

    /// Continues or ends the path at a surface. The first of the three numbers in `random`, in [0, 1),
    /// chooses the continuation, the others the direction in a lobe. A narrow lobe that the path can pass is
    /// removed from the surface's reflection, unless the path can also end at the lobe (`CausticPhotons`). If
    /// a photon continues in a direction sampled from a lobe, the surface's `outgoing` becomes the direction
    /// that the photon is taken to come from ([`Reflector::sample_photon`]).
    #[inline(always)]
    pub fn arrive(&mut self, surface: &mut Surface, random: [f32; 3]) -> Arrival {
        if !self.may_pass(surface) && self.absorption == Vec3::ZERO {
            return Arrival::Ends;
        }
        self.arrive_at_specular(surface, random)
    }

    #[inline(never)]
    fn arrive_at_specular(&mut self, surface: &mut Surface, [random, u, v]: [f32; 3]) -> Arrival {
        let inside = surface.absorption != Vec3::ZERO;
        let absorption = if inside { surface.absorption } else { self.absorption };
        self.throughput *= Vec3::from_array((absorption * -surface.distance).to_array().map(libm::expf));
        if self.bounces == 0 {
            self.first_distance = surface.distance;
        }
        if !self.may_pass(surface) {
            return Arrival::Ends;
        }
        let lobe = Reflector {
            reflection: if self.passes_lobe(surface) {
                surface.reflection.narrow_lobe()
            } else {
                Reflection::BLACK
            },
            ..surface.reflector()
        };
        let ends_at_lobe = self.passes == Passes::CausticPhotons && !self.is_straight;
        let keeps_lobe = ends_at_lobe && surface.reflection.keeps_caustics();
        if !lobe.reflection.is_black() && !keeps_lobe {
            surface.reflection = surface.reflection.without_narrow_lobe();
        }
        let specular = &surface.specular;
        let [reflected, transmitted] = [specular.reflected, specular.transmitted].map(max_component);
        let [_, glossy] = lobe.albedos();
        let goes = reflected + transmitted + glossy;
        let stays = max_component(surface.reflector().albedo());
        if goes <= 0.0 {
            return if stays > 0.0 { Arrival::Ends } else { Arrival::Lost };
        }
        // A minimum of the probability of ending here bounds the weight of the path, which prevents
        // fireflies. At an emitter the minimum is one half.
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
        let kind = self.carried.ray_kind();
        self.bounces += 1;
        self.travelled += surface.distance;
        let was_straight = core::mem::replace(&mut self.is_straight, false);
        let past_specular = chosen - (stays + reflected + transmitted);
        if glossy > 0.0 && (past_specular >= 0.0 || reflected + transmitted <= 0.0) {
            let (from, sampled) = match self.carried {
                Carried::Radiance => (surface.outgoing, lobe.sample_lobe_alone([u, v])),
                Carried::Power => lobe.sample_photon([u, v]),
            };
            surface.outgoing = from;
            let ReflectedDirection { direction, weight } = sampled;
            if !surface.is_above(direction) {
                return Arrival::Absorbed;
            }
            self.throughput *= weight * (all / glossy);
            self.ray = Ray::new(kind, surface.offset_origin(), direction);
        } else if chosen < stays + reflected || transmitted <= 0.0 {
            self.throughput *= specular.reflected * (all / reflected);
            self.ray = Ray::new(kind, surface.offset_origin(), surface.mirrored());
        } else {
            let scale = if self.carried == Carried::Radiance { specular.radiance_scale } else { 1.0 };
            self.throughput *= specular.transmitted * (scale * all / transmitted);
            self.ray = Ray::new(kind, surface.offset_behind(), specular.behind);
            if specular.is_straight() {
                self.is_straight = was_straight;
            } else {
                self.absorption = specular.absorption;
            }
        }
        Arrival::GoesOn
    }

    /// Applies Russian roulette after [`FREE_BOUNCES`] bounces. The path survives with the probability
    /// `min(1, t)`, where `t` is the throughput's maximum channel. The throughput is then divided by this
    /// probability.
    fn survives(&mut self, random: &dyn Fn(u32) -> f32) -> bool {
        if self.bounces <= FREE_BOUNCES {
            return true;
        }
        let probability = min(max_component(self.throughput), 1.0);
        let survives = random(Choice::SURVIVAL.number(self.bounces)) < probability;
        if survives {
            self.throughput *= 1.0 / probability;
        }
        survives
    }

    /// Follows the path from `surface` to its end. `surface` and `hit` are replaced by those of the last
    /// surface that the path reaches. `random` maps the number of a random choice to a value in [0, 1). Each
    /// choice of a path has a number of its own.
    ///
    /// # Errors
    /// If the card image is invalid.
    #[inline(never)]
    pub fn follow<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        surface: &mut Surface,
        hit: &mut Hit,
        random: &dyn Fn(u32) -> f32,
    ) -> Result<PathEnd, Fault> {
        loop {
            if self.passes_lobe(surface) {
                let throughput = self.throughput;
                let (of_light, light) = punctual_light(context, surface, self.bounces, random)?;
                let groups = LightGroups::of(context.frame);
                self.collected.add(groups.index(of_light), throughput * light);
            }
            let here = |choice: Choice| random(choice.number(self.bounces));
            let [u, v] = if self.passes_lobe(surface) { Choice::DIRECTION.map(here) } else { [0.0; 2] };
            match self.arrive(surface, [here(Choice::CONTINUATION), u, v]) {
                Arrival::Ends => return Ok(PathEnd::Surface),
                Arrival::Lost => {
                    context.counters.lost_paths += 1;
                    return Ok(PathEnd::Lost);
                }
                Arrival::Absorbed => return Ok(PathEnd::Lost),
                Arrival::GoesOn if !self.survives(random) => return Ok(PathEnd::Lost),
                Arrival::GoesOn => context.counters.specular_rays += 1,
            }
            let next = closest_hit(context.scene, context.memory, &self.ray)?;
            let Some(next) = next else { return Ok(PathEnd::Escaped) };
            *hit = next;
            let random = |choice| random(surface_choice(self.bounces, choice));
            read_surface(context.scene, context.memory, &self.ray, hit, &random, surface)?;
        }
    }
}

/// Kind of random choice that a path makes at a surface.
#[derive(Clone, Copy, Debug)]
struct Choice(u32);

impl Choice {
    const CONTINUATION: Self = Self(0);
    const DIRECTION: [Self; 2] = [Self(1), Self(2)];
    const LIGHT: [Self; 2] = [Self(3), Self(4)];
    const LAYER: Self = Self(5);
    const SURVIVAL: Self = Self(Self::LAYER.0 + SURFACE_CHOICES);
    /// Number of choices that a path makes at a surface.
    const ALL: u32 = Self::SURVIVAL.0 + 1;

    /// Number of this choice at the surface after `bounces` bounces: unique in the path, and an argument of
    /// `random` in [`SpecularPath::follow`].
    fn number(self, bounces: u32) -> u32 {
        const NUMBERED: u32 = FREE_BOUNCES + 1;
        match bounces.checked_sub(NUMBERED) {
            None => self.0 * NUMBERED + bounces,
            Some(further) => Self::ALL * NUMBERED + further * Self::ALL + self.0,
        }
    }
}

/// Converts the number of a random choice in one call of [`read_surface`] to a number that is unique in the
/// path. The call reads the surface after `bounces` bounces.
pub fn surface_choice(bounces: u32, choice: u32) -> u32 {
    Choice(Choice::LAYER.0 + choice).number(bounces)
}

/// Light group of one light sample, and the radiance, W/(sr m^2), that a surface's narrow lobe reflects from
/// it. The radiance is zero if the light has an area, because rays of the lobe hit such lights.
#[inline(never)]
fn punctual_light<M: MemoryPort>(
    context: &mut Context<M>,
    surface: &Surface,
    bounce: u32,
    random: &dyn Fn(u32) -> f32,
) -> Result<(u8, Vec3), Fault> {
    const NONE: (u8, Vec3) = (0, Vec3::ZERO);
    let [u, v] = Choice::LIGHT.map(|choice| random(choice.number(bounce)));
    let receiver = Receiver::new(surface);
    let mut choices = LightChoices::new(receiver);
    let Some(light) = sample_light(context.scene, context.memory, &mut choices, [u, v], u.to_bits())? else {
        return Ok(NONE);
    };
    let LightSample { direction, distance, irradiance, density, light_group } = light;
    if density.is_some() || !surface.is_above(direction) || max_component(irradiance) <= 0.0 {
        return Ok(NONE);
    }
    context.counters.shadow_rays += 1;
    let ray = Ray::of_light(receiver.origin, direction, distance * SHORTER);
    let share = transmittance(context.scene, context.memory, &ray)?;
    if share == Vec3::ZERO {
        return Ok(NONE);
    }
    let lobe = Reflector { reflection: surface.reflection.narrow_lobe(), ..surface.reflector() };
    Ok((light_group, lobe.evaluate(direction) * irradiance * surface.normal.dot(direction) * share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_at_every_surface_has_a_number_of_its_own() {
        let mut numbers = std::collections::BTreeSet::new();
        for bounces in 0..=SPECULAR_BOUNCES {
            for choice in 0..Choice::ALL {
                assert!(numbers.insert(Choice(choice).number(bounces)), "{choice} {bounces}");
            }
        }
        assert_eq!(surface_choice(0, 0), 5 * 17);
    }
}
