//! Reflection without perfectly specular parts ([`super::Specular`]): values, densities, samples, and the
//! records of gathers.
//!
//! | question | answered by |
//! |---|---|
//! | which parts there are | [`Reflection`] |
//! | `f`, albedos, sampled directions and their densities, seen from one direction | [`Reflector`] |
//! | materials that photons are stored on | [`keeps_photons`] |
//! | the record of a waiting gather, and its sums over photons | [`PartialReflection`] |
//!
//! A reflection is a Lambertian part and one lobe. Callers need to know neither the lobe's model nor its
//! parameters. A model is a file here, such as `phong` and `ggx`, and a case in `lobe`, [`Reflector`] and
//! [`PartialReflection`].

mod ggx;
mod ggx_albedo;
mod ggx_kernel;
mod layered;
mod lobe;
mod material;
mod metallic_roughness;
mod phong;
mod photon_keeping;
mod record;
mod reflector;
mod sheen;
#[cfg(test)]
mod tests;

pub(super) use layered::{Layer, LayerTexel, take};
pub(super) use material::{Scattering, Texel, View, scattering};
pub use photon_keeping::keeps_photons;
pub use record::{DecodedLobe, PartialReflection};
pub use reflector::{ReflectedDirection, Reflector};

use glam::Vec3;

use crate::vector::max_component;
use ggx::Estimate;
use lobe::Lobe;
use phong::PhongLobe;

/// Maximum `a = roughness^2` of a sharp lobe, as for the denoising features of Cycles.
const MAX_SHARP_ALPHA: f32 = 0.075;

/// Parameters of a reflection function `f`: a Lambertian part and a lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// Lambertian albedo, 0 to 1.
    diffuse: Vec3,
    lobe: Lobe,
}

impl Reflection {
    /// Reflection of a black surface: `f = 0`.
    pub const BLACK: Self = Self::lambertian(Vec3::ZERO);

    /// Lambertian reflection with this albedo, 0 to 1.
    pub const fn lambertian(albedo: Vec3) -> Self {
        Self { diffuse: albedo, lobe: Lobe::BLACK }
    }

    /// Lambertian reflection with a Phong lobe:
    /// `f = diffuse / pi + specular (n + 2) / (2 pi) max(0, cos alpha)^n`, where alpha is measured from the
    /// mirror direction and `n` is the exponent.
    pub const fn phong(diffuse: Vec3, specular: Vec3, exponent: f32) -> Self {
        Self { diffuse, lobe: Lobe::Phong(PhongLobe { albedo: specular, exponent }) }
    }

    /// Returns true if `f = 0` everywhere.
    #[inline(always)]
    pub fn is_black(&self) -> bool {
        !self.has_lambertian() && self.is_lambertian()
    }

    /// Returns true if the Lambertian albedo is above 0.
    #[inline(always)]
    pub fn has_lambertian(&self) -> bool {
        max_component(self.diffuse) > 0.0
    }

    /// Returns true if no lobe reflects light.
    #[inline(always)]
    pub fn is_lambertian(&self) -> bool {
        !self.lobe.reflects()
    }

    /// Returns true if there is a narrow lobe: photons cannot resolve it, because few or none of the k
    /// nearest arrive within it. Gather rays and photons follow a narrow lobe as they follow perfectly
    /// specular surfaces; an eye path ends there, and gather rays are cast.
    #[inline(always)]
    pub fn has_narrow_lobe(&self) -> bool {
        match &self.lobe {
            Lobe::Phong(_) => false,
            Lobe::Ggx(lobe) => lobe.estimate != Estimate::Photons && lobe.reflects(),
            Lobe::Sheen(lobe) => lobe.reflects(),
        }
    }

    /// Fraction of the albedo that a sharp GGX lobe has; 0 without such a lobe. Objects can be recognised in
    /// the reflection of a sharp lobe.
    pub fn sharp_share(&self) -> f32 {
        let is_sharp = matches!(&self.lobe, Lobe::Ggx(lobe) if lobe.alpha() <= MAX_SHARP_ALPHA);
        if is_sharp { self.glossy_share() } else { 0.0 }
    }

    /// Fraction of the albedo that a GGX lobe has; 0 without a GGX lobe.
    #[inline(always)]
    pub(super) fn glossy_share(&self) -> f32 {
        match &self.lobe {
            Lobe::Ggx(lobe) if lobe.reflects() => {
                let albedo = max_component(self.lobe.albedo());
                albedo / (albedo + max_component(self.diffuse))
            }
            _ => 0.0,
        }
    }

    /// Removes a narrow lobe. The rest of the reflection is estimated from photons.
    #[inline(always)]
    #[must_use]
    pub fn without_narrow_lobe(self) -> Self {
        if self.has_narrow_lobe() { Self::lambertian(self.diffuse) } else { self }
    }

    /// Returns true if there is a narrow lobe that takes light from the caustic map: from photons of lights
    /// without an area, whose caustics a gather ray of the lobe would rarely find.
    #[inline(always)]
    pub fn gathers_caustics(&self) -> bool {
        match &self.lobe {
            Lobe::Ggx(lobe) => self.has_narrow_lobe() && lobe.gathers_caustics(),
            Lobe::Phong(_) | Lobe::Sheen(_) => false,
        }
    }

    /// Returns true if photons of lights without an area are stored in the caustic map for the sake of a
    /// narrow lobe.
    #[inline(always)]
    pub fn keeps_caustics(&self) -> bool {
        self.gathers_caustics()
            && !matches!(&self.lobe, Lobe::Ggx(lobe) if lobe.estimate == Estimate::RayBesideBase)
    }

    /// Reduces the reflection to the narrow lobe, marked as [`Estimate::RayBesideBase`]: photons are stored
    /// for the Lambertian part beside the lobe.
    #[must_use]
    pub(in crate::scene) fn narrow_lobe_beside_base(self) -> Self {
        let mut part = self.narrow_lobe();
        if let Lobe::Ggx(lobe) = &mut part.lobe
            && lobe.estimate == Estimate::Ray
        {
            lobe.estimate = Estimate::RayBesideBase;
        }
        part
    }

    /// Reduces the reflection to the narrow lobe; black if there is none.
    #[must_use]
    pub fn narrow_lobe(self) -> Self {
        if self.has_narrow_lobe() { self.without_lambertian() } else { Self::BLACK }
    }

    /// Reduces the reflection to the lobe, narrow or wide.
    #[inline(always)]
    #[must_use]
    pub fn without_lambertian(self) -> Self {
        Self { diffuse: Vec3::ZERO, ..self }
    }

    /// Multiplies `f` by a throughput.
    #[inline(always)]
    #[must_use]
    pub fn dimmed(mut self, throughput: Vec3) -> Self {
        self.diffuse *= throughput;
        self.lobe = self.lobe.dimmed(throughput);
        self
    }
}
