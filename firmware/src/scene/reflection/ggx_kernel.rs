//! GGX lobe in the form in which a gather evaluates it: a factor for the power of each photon.

use core::f32::consts::PI;

use glam::Vec3;

use super::ggx::{Geometry, MIN_ALPHA, distribution, visibility};
use crate::vector::max;

/// GGX lobe with `F = 1` for one outgoing direction, scaled to 0 to 1: `D V` divided by its upper bound `1 /
/// (2 pi a^3 n.o)`. A sum of powers times this factor does not exceed the sum of the powers.
#[derive(Clone, Copy, Debug)]
pub struct Kernel {
    normal: Vec3,
    outgoing: Vec3,
    alpha: f32,
}

/// Minimum of `n.o` in a kernel, which keeps the bound of `D V` finite.
const MIN_KERNEL_COSINE: f32 = 0.02;

impl Kernel {
    /// Creates the kernel of a lobe. `normal` and `outgoing` are unit vectors.
    pub(super) fn new(normal: Vec3, outgoing: Vec3, roughness: f32) -> Self {
        Self { normal, outgoing, alpha: max(roughness * roughness, MIN_ALPHA) }
    }

    #[inline(always)]
    fn cosine(&self) -> f32 {
        max(self.normal.dot(self.outgoing), MIN_KERNEL_COSINE)
    }

    /// Upper bound of `D V`, 1/sr.
    pub(super) fn bound(&self) -> f32 {
        1.0 / (2.0 * PI * self.alpha * self.alpha * self.alpha * self.cosine())
    }

    /// `D V` divided by the bound, 0 to 1, for light from the unit vector `incident`; 0 below the surface.
    #[inline(always)]
    pub(super) fn factor(&self, incident: Vec3) -> f32 {
        let mut geometry = Geometry::new(self.normal, self.outgoing, incident);
        if geometry.incident <= 0.0 {
            return 0.0;
        }
        geometry.outgoing = self.cosine();
        let peak = 1.0 / (PI * self.alpha * self.alpha);
        let distribution = distribution(self.alpha, &geometry) / peak;
        distribution * (2.0 * self.alpha * geometry.outgoing * visibility(self.alpha, &geometry))
    }
}

#[cfg(test)]
mod tests {
    use super::super::ggx::GgxLobe;
    use super::*;

    /// Unit vector at the angle `acos(cosine)` to the y axis, with an azimuth.
    fn at(cosine: f32, azimuth: f32) -> Vec3 {
        let sine = (1.0 - cosine * cosine).sqrt();
        Vec3::new(sine * azimuth.cos(), cosine, sine * azimuth.sin())
    }

    #[test]
    fn a_kernel_is_the_lobe_over_its_bound() {
        for (roughness, cosine) in [(0.5, 0.9), (0.7, 0.3), (1.0, 0.05)] {
            let outgoing = at(cosine, 0.0);
            let lobe = GgxLobe::new(Vec3::ONE, Vec3::ONE, roughness, cosine);
            let kernel = Kernel::new(Vec3::Y, outgoing, roughness);
            for index in 0..200_u8 {
                let incident = at(f32::from(index % 20 + 1) / 20.0, f32::from(index / 20));
                let factor = kernel.factor(incident);
                assert!((0.0..=1.001).contains(&factor), "{factor}");
                let value = lobe.evaluate(&Geometry::new(Vec3::Y, outgoing, incident)).x;
                assert!(
                    (factor * kernel.bound() / value - 1.0).abs() < 1e-3,
                    "{roughness} {cosine} {incident}"
                );
            }
            assert_eq!(kernel.factor(-Vec3::Y), 0.0);
        }
    }
}
