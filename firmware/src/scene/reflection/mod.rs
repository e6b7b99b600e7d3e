//! Reflection functions without their perfectly specular part ([`super::Specular`]): evaluation, sampling,
//! and the form stored in the gather queue.
//!
//! | subject | item |
//! |---|---|
//! | the parts of a reflection function | [`Reflection`] |
//! | `f`, albedos, sampled directions and their densities, for one outgoing direction | [`Reflector`] |
//! | choice of the materials on which photons are stored | [`keeps_photons`] |
//! | the stored form for the gather queue, and its sums over photons | [`PartialReflection`] |
//!
//! A reflection is a Lambertian part and one lobe. Each model of a lobe has a module here, such as `phong` or
//! `ggx`, and a case in `lobe`, [`Reflector`] and [`PartialReflection`]. Callers need not know the model.

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

/// Maximum `a = roughness^2` of a sharp lobe, equal to the limit of Cycles for denoising features.
const MAX_SHARP_ALPHA: f32 = 0.075;

/// Reflection function `f`: the sum of a Lambertian part and a lobe.
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

    /// Returns true if the lobe reflects nothing.
    #[inline(always)]
    pub fn is_lambertian(&self) -> bool {
        !self.lobe.reflects()
    }

    /// Returns true if the lobe is narrow: a density estimate cannot resolve it, because few of the k nearest
    /// photons arrive within it. Gather rays and photons that hit a narrow lobe continue in a sampled
    /// direction. An eye path ends at the narrow lobe, and gather rays are cast from there.
    #[inline(always)]
    pub fn has_narrow_lobe(&self) -> bool {
        match &self.lobe {
            Lobe::Phong(_) => false,
            Lobe::Ggx(lobe) => lobe.estimate != Estimate::Photons && lobe.reflects(),
            Lobe::Sheen(lobe) => lobe.reflects(),
        }
    }

    /// Fraction of the albedo that a sharp GGX lobe contributes; 0 without one. A lobe is sharp if objects
    /// can be recognised in its reflection.
    pub fn sharp_share(&self) -> f32 {
        let is_sharp = matches!(&self.lobe, Lobe::Ggx(lobe) if lobe.alpha() <= MAX_SHARP_ALPHA);
        if is_sharp { self.glossy_share() } else { 0.0 }
    }

    /// Fraction of the albedo that a GGX lobe contributes; 0 without one.
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

    /// Removes the lobe if it is narrow. The remaining reflection is estimated from photons.
    #[inline(always)]
    #[must_use]
    pub fn without_narrow_lobe(self) -> Self {
        if self.has_narrow_lobe() { Self::lambertian(self.diffuse) } else { self }
    }

    /// Returns true if the lobe is narrow and caustic photons of lights without an area are gathered for it.
    /// Gather rays would rarely find the caustics of such lights.
    #[inline(always)]
    pub fn gathers_caustics(&self) -> bool {
        match &self.lobe {
            Lobe::Ggx(lobe) => self.has_narrow_lobe() && lobe.gathers_caustics(),
            Lobe::Phong(_) | Lobe::Sheen(_) => false,
        }
    }

    /// Returns true if caustic photons of lights without an area must be stored because of a narrow lobe.
    #[inline(always)]
    pub fn keeps_caustics(&self) -> bool {
        self.gathers_caustics()
            && !matches!(&self.lobe, Lobe::Ggx(lobe) if lobe.estimate == Estimate::RayBesideBase)
    }

    /// Removes the Lambertian part. Marks the narrow lobe as one for which no caustic photons are stored
    /// ([`Estimate::RayBesideBase`]).
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

    /// Removes the Lambertian part. Returns a black reflection if the lobe is not narrow.
    #[must_use]
    pub fn narrow_lobe(self) -> Self {
        if self.has_narrow_lobe() { self.without_lambertian() } else { Self::BLACK }
    }

    /// Removes the Lambertian part.
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
