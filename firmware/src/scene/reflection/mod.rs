//! Reflection: every question that light asks of a surface, perfectly specular parts ([`super::Specular`]) apart.
//!
//! | question | face |
//! |---|---|
//! | is anything reflected; is there a Lambertian part | [`Reflection`] |
//! | `f`, densities, sampled directions, albedos, seen from one direction | [`Reflector`] |
//! | are photons stored on a material's surfaces | [`keeps_photons`] |
//! | the record of a gather that waits, and the photons that it reflects | [`PartialReflection`] |
//!
//! A reflection is a Lambertian part and one lobe. Callers name neither the lobe's model nor its parameters: a model is a file
//! here, as `phong` is, and a case in these three.

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

/// A reflection function's parameters.
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

    /// `f = 0` everywhere.
    #[inline(always)]
    pub fn is_black(&self) -> bool {
        !self.has_lambertian() && self.is_lambertian()
    }

    /// A Lambertian part, which irradiance tells all of.
    #[inline(always)]
    pub fn has_lambertian(&self) -> bool {
        max_component(self.diffuse) > 0.0
    }

    /// No lobe.
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
