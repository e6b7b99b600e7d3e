//! Test by normals whether photons belong to one surface.

use glam::Vec3;
use photoncard_shared::layout::decode_normal;

use crate::vector::unit;

/// Minimum cosine between the normals of a photon and of the query that are taken as one surface.
pub const MIN_NORMAL_COSINE: f32 = 0.75;

/// Test whether a photon belongs to a surface. Consecutive photons mostly have equal normals, so that the
/// last result is cached.
pub struct SameSurface {
    normal: Vec3,
    /// Code of the last normal, and its cosine.
    last: (u8, f32),
    /// Number of normals decoded so far.
    decoded: u32,
}

impl SameSurface {
    /// Creates the test for a surface whose normal has this code.
    #[inline(always)]
    pub fn new(code: u8) -> Self {
        let normal = unit(decode_normal(code).into());
        Self { normal, last: (code, normal.dot(normal)), decoded: 0 }
    }

    /// Number of normals decoded so far.
    #[inline(always)]
    pub(super) fn decoded(&self) -> u32 {
        self.decoded
    }

    /// Returns true if a photon whose normal has this code belongs to the surface.
    #[inline(always)]
    pub fn holds(&mut self, code: u8) -> bool {
        self.cosine(code) >= MIN_NORMAL_COSINE
    }

    /// Cosine between the surface's normal and that with a code.
    #[inline(always)]
    pub(super) fn cosine(&mut self, code: u8) -> f32 {
        if self.last.0 != code {
            let other = unit(decode_normal(code).into());
            self.decoded += 1;
            self.last = (code, other.dot(self.normal));
        }
        self.last.1
    }
}
