//! Reflection, without perfectly specular parts ([`super::Specular`]): one room for values, densities, samples, and the records
//! of gathers.
//!
//! | question | face |
//! |---|---|
//! | which parts there are | [`Reflection`] |
//! | `f`, albedos, sampled directions and their densities, seen from one direction | [`Reflector`] |
//! | materials that photons are stored on | [`keeps_photons`] |
//! | the record of a waiting gather, and its sums over photons | [`PartialReflection`] |
//!
//! A reflection is a Lambertian part and one lobe. Callers name neither the lobe's model nor its parameters: a model is a file
//! here, as `phong` is, and a case in [`Reflection`], [`Reflector`] and [`PartialReflection`].

mod material;
mod metallic_roughness;
mod phong;
mod record;
mod reflector;

pub use material::keeps_photons;
pub(super) use material::{Scattering, Texel, View, scattering};
pub use record::{DecodedLobe, PartialReflection};
pub use reflector::{ReflectedDirection, Reflector};

use glam::Vec3;

use crate::vector::max_component;
use phong::PhongLobe;

/// The parameters of a reflection function `f`: a Lambertian part and a lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// Lambertian albedo, 0 to 1.
    diffuse: Vec3,
    lobe: PhongLobe,
}

impl Reflection {
    /// No reflection.
    pub const BLACK: Self = Self::lambertian(Vec3::ZERO);

    /// A Lambertian reflection of an albedo, 0 to 1.
    pub const fn lambertian(albedo: Vec3) -> Self {
        Self { diffuse: albedo, lobe: PhongLobe::BLACK }
    }

    /// A Lambertian reflection with one Phong lobe: `f = diffuse / pi + specular (n + 2) / (2 pi) max(0, cos alpha)^n`, alpha
    /// measured from the mirror direction, `n` the exponent.
    pub const fn phong(diffuse: Vec3, specular: Vec3, exponent: f32) -> Self {
        Self { diffuse, lobe: PhongLobe { albedo: specular, exponent } }
    }

    /// `true` if `f = 0` everywhere.
    #[inline(always)]
    pub fn is_black(&self) -> bool {
        !self.has_lambertian() && self.is_lambertian()
    }

    /// `true` with a Lambertian part, whose light is the irradiance alone.
    #[inline(always)]
    pub fn has_lambertian(&self) -> bool {
        max_component(self.diffuse) > 0.0
    }

    /// `true` without a lobe.
    #[inline(always)]
    pub fn is_lambertian(&self) -> bool {
        !self.lobe.reflects()
    }

    /// The lobe alone.
    #[inline(always)]
    #[must_use]
    pub fn without_lambertian(self) -> Self {
        Self { diffuse: Vec3::ZERO, ..self }
    }

    /// `f` times a throughput.
    #[inline(always)]
    #[must_use]
    pub fn dimmed(mut self, throughput: Vec3) -> Self {
        self.diffuse *= throughput;
        self.lobe.albedo *= throughput;
        self
    }
}
