//! Normalised Phong lobe (Lafortune, Willems 1994, *Using the modified Phong reflectance model for physically
//! based rendering*): `f = ks (n + 2) / (2 pi) max(0, cos alpha)^n`, where alpha is the angle to the mirror
//! direction. Directions are sampled with the density `p = (n + 1) / (2 pi) max(0, cos alpha)^n`.

use core::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use crate::vector::{about, max, max_component, sqrt};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PhongLobe {
    /// Albedo `ks` at normal incidence, 0 to 1.
    pub(super) albedo: Vec3,
    /// Exponent `n`, 0 to [`MAX_PHONG_EXPONENT`](photoncard_shared::layout::MAX_PHONG_EXPONENT).
    pub(super) exponent: f32,
}

impl PhongLobe {
    /// A lobe that reflects nothing.
    pub(super) const BLACK: Self = Self { albedo: Vec3::ZERO, exponent: 0.0 };

    /// Returns true if `ks > 0` in some channel.
    #[inline(always)]
    pub(super) fn reflects(&self) -> bool {
        max_component(self.albedo) > 0.0
    }

    /// `max(0, cos alpha)^n`, where alpha is the angle between two unit vectors.
    #[inline(always)]
    pub(super) fn power(&self, mirror: Vec3, direction: Vec3) -> f32 {
        power(mirror.dot(direction), self.exponent)
    }

    /// BRDF `f`, 1/sr, for a value of [`Self::power`].
    #[inline(always)]
    pub(super) fn evaluate(&self, power: f32) -> Vec3 {
        self.albedo * (Self::factor(self.exponent) * power)
    }

    /// Sampling density `p`, 1/sr, for a value of [`Self::power`].
    #[inline(always)]
    pub(super) fn density(&self, power: f32) -> f32 {
        (self.exponent + 1.0) * 0.5 * FRAC_1_PI * power
    }

    /// Normalisation factor `(n + 2) / (2 pi)`, 1/sr.
    #[inline(always)]
    pub(super) fn factor(exponent: f32) -> f32 {
        (exponent + 2.0) * 0.5 * FRAC_1_PI
    }

    /// Ratio `f / (ks p)`, dimensionless.
    #[inline(always)]
    pub(super) fn gain(&self) -> f32 {
        (self.exponent + 2.0) / (self.exponent + 1.0)
    }

    /// Maps a point of the unit square to a direction about the mirror direction, with density `p`.
    #[inline(always)]
    pub(super) fn direction(&self, mirror: Vec3, [u, v]: [f32; 2]) -> Vec3 {
        let cosine = libm::powf(1.0 - v, 1.0 / (self.exponent + 1.0));
        let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
        about(mirror, 2.0 * PI * u, sine, cosine)
    }
}

/// `max(0, cosine)^exponent`; 0 if the cosine is not positive, even for the exponent 0.
#[inline(always)]
pub(super) fn power(cosine: f32, exponent: f32) -> f32 {
    if cosine > 0.0 { libm::powf(cosine, exponent) } else { 0.0 }
}
