//! Reflection: Lambertian plus one Phong cosine lobe, `f = kd / pi + ks (n + 2) / (2 pi) max(0, cos alpha)^n`, alpha
//! measured from the mirror direction.

use core::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use crate::vector::max_component;

/// A reflection function's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// Lambertian albedo.
    pub diffuse: Vec3,
    /// Albedo of the Phong lobe.
    pub specular: Vec3,
    /// Exponent of the Phong lobe.
    pub exponent: f32,
}

impl Reflection {
    /// No reflection.
    pub const BLACK: Self = Self { diffuse: Vec3::ZERO, specular: Vec3::ZERO, exponent: 0.0 };

    /// Whether nothing is reflected.
    #[inline(always)]
    pub fn is_black(&self) -> bool {
        !self.has_lambertian() && !self.has_lobe()
    }

    /// Whether there is a Lambertian part.
    #[inline(always)]
    pub fn has_lambertian(&self) -> bool {
        max_component(self.diffuse) > 0.0
    }

    /// Whether there is a Phong lobe.
    #[inline(always)]
    pub fn has_lobe(&self) -> bool {
        max_component(self.specular) > 0.0
    }

    /// The Lambertian part of `f`, 1/sr.
    #[inline(always)]
    pub fn lambertian(&self) -> Vec3 {
        self.diffuse * FRAC_1_PI
    }

    /// The lobe's part of `f`, 1/sr, for an incoming direction at `cosine` to the mirror direction.
    #[inline(always)]
    pub fn lobe(&self, cosine: f32) -> Vec3 {
        self.specular * ((self.exponent + 2.0) / (2.0 * PI) * lobe_power(cosine, self.exponent))
    }

    /// `f`, 1/sr, for unit vectors away from the surface, both on the side of `normal`.
    #[inline(always)]
    pub fn evaluate(&self, normal: Vec3, outgoing: Vec3, incoming: Vec3) -> Vec3 {
        if !self.has_lobe() {
            return self.lambertian();
        }
        self.lambertian() + self.lobe(mirror(outgoing, normal).dot(incoming))
    }
}

/// `max(0, cosine)^exponent`; zero at and below the lobe's horizon for every exponent, 0 among them.
#[inline(always)]
pub(crate) fn lobe_power(cosine: f32, exponent: f32) -> f32 {
    if cosine > 0.0 { libm::powf(cosine, exponent) } else { 0.0 }
}

/// The mirror direction of a unit vector about a unit normal.
#[inline(always)]
pub(crate) fn mirror(direction: Vec3, normal: Vec3) -> Vec3 {
    normal * (2.0 * normal.dot(direction)) - direction
}
