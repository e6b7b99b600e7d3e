//! glTF's metallic-roughness model (glTF 2.0, appendix B): a GGX lobe over a Lambertian base.
//!
//! - The lobe is a [`GgxLobe`]. With `m = metallic`, `F0` is `(1 - m)` times the dielectric's F0 plus `m`
//!   times the base colour; `F90` is `(1 - m)` times `specularFactor` (`KHR_materials_specular`) plus `m`.
//! - The Lambertian albedo is `base (1 - metallic) (1 - max(F, E))`. `F` is the dielectric's `F(h.o)`, the
//!   weight in appendix B, averaged over uniform light from all directions. `E` is the maximum channel of the
//!   dielectric lobe's albedo towards `o`, which exceeds `F` at grazing views.
//! - At roughness 0 the lobe is perfectly specular, with Schlick's reflectance.

use glam::Vec3;

use super::Reflection;
use super::ggx::{Estimate, GgxLobe};
use super::lobe::Lobe;
use crate::scene::specular::Specular;
use crate::vector::{max, max_component, min};

/// Parameters of a metallic-roughness surface at a point, with textures applied.
#[derive(Clone, Copy, Debug)]
pub(super) struct MetallicRoughness {
    pub(super) base: Vec3,
    /// F0 of the dielectric.
    pub(super) dielectric: Vec3,
    /// F90 of the dielectric.
    pub(super) grazing: f32,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
    /// True if rays follow the lobe, by the flag [`NARROW_LOBE`](photoncard_shared::layout::NARROW_LOBE).
    pub(super) has_narrow_lobe: bool,
    /// True if the lobe includes multiple scattering, by the flag
    /// [`COMPENSATED`](photoncard_shared::layout::COMPENSATED).
    pub(super) is_compensated: bool,
}

impl MetallicRoughness {
    /// Reflection at a roughness above 0. `cosine` is the cosine between outgoing direction and normal.
    pub(super) fn reflection(&self, cosine: f32) -> Reflection {
        let [f0, f90] = self.mixed();
        let lobe = self.lobe(f0, f90, cosine);
        let coat = max(lobe.albedo_of(self.dielectric, self.grazing), self.mean_fresnel(cosine));
        let diffuse = self.base * ((1.0 - self.metallic) * (1.0 - coat));
        Reflection { diffuse, lobe: Lobe::Ggx(lobe) }
    }

    /// Reflection of two parts: the lobe multiplied by `share`, and a Lambertian part with the albedo
    /// `diffuse`.
    pub(super) fn lobe_beside(&self, diffuse: Vec3, share: f32, cosine: f32) -> Reflection {
        let [f0, f90] = self.mixed();
        let lobe = self.lobe(f0 * share, f90 * share, cosine);
        Reflection { diffuse, lobe: Lobe::Ggx(lobe) }
    }

    fn lobe(&self, f0: Vec3, f90: Vec3, cosine: f32) -> GgxLobe {
        let mut lobe = GgxLobe::new(f0, f90, self.roughness, cosine);
        if self.has_narrow_lobe {
            lobe.estimate = Estimate::Ray;
        }
        if self.is_compensated { lobe.compensated() } else { lobe }
    }

    /// Lambertian part and perfectly specular part at roughness 0. `cosine` is the cosine between outgoing
    /// direction and normal.
    pub(super) fn smooth(&self, cosine: f32) -> (Reflection, Specular) {
        let rest = 1.0 - cosine;
        let squared = rest * rest;
        let share = squared * squared * rest;
        let [f0, f90] = self.mixed();
        let coat = max_component(towards(self.dielectric, Vec3::splat(self.grazing), share));
        let coat = max(coat, self.mean_fresnel(cosine));
        let diffuse = self.base * ((1.0 - self.metallic) * (1.0 - coat));
        (Reflection::lambertian(diffuse), Specular::mirror(towards(f0, f90, share)))
    }

    /// Mean of the dielectric's `F(h.o)` over uniform light from all directions (the `F` of the module's
    /// formula). `cosine` is `n.o`.
    fn mean_fresnel(&self, cosine: f32) -> f32 {
        let f0 = max_component(self.dielectric);
        f0 + (self.grazing - f0) * mean_schlick(cosine)
    }

    /// `[F0, F90]` of the mixture of metal and dielectric.
    fn mixed(&self) -> [Vec3; 2] {
        let mix = |dielectric: Vec3, metal: Vec3| towards(dielectric, metal, self.metallic);
        [mix(self.dielectric, self.base), mix(Vec3::splat(self.grazing), Vec3::ONE)]
    }
}

/// Cosine-weighted mean of `(1 - h.o)^5` over all directions `i` of incident light, by a fit with an error of
/// 0.0001. `h` is the half vector of `i` and `o`; `cosine` is `n.o`.
fn mean_schlick(cosine: f32) -> f32 {
    let rest = 1.0 - min(max(cosine, 0.0), 1.0);
    rest * (0.0045 + rest * (rest * 0.0257 - 0.0021))
}

/// Linear interpolation: `from` at `share` 0, `to` at `share` 1.
fn towards(from: Vec3, to: Vec3, share: f32) -> Vec3 {
    from * (1.0 - share) + to * share
}

#[cfg(test)]
mod tests {
    use super::*;

    fn each() -> impl Iterator<Item = MetallicRoughness> {
        let steps = [0.0, 0.04, 0.3, 0.8, 1.0];
        (0..625_usize).map(move |index| {
            let [base, dielectric, metallic, roughness] =
                [1, 5, 25, 125].map(|place| steps[index / place % 5]);
            MetallicRoughness {
                base: Vec3::splat(base),
                dielectric: Vec3::splat(dielectric),
                grazing: if dielectric > 0.0 { 1.0 } else { 0.0 },
                metallic,
                roughness,
                has_narrow_lobe: false,
                is_compensated: false,
            }
        })
    }

    #[test]
    fn reflected_light_does_not_exceed_incident_light() {
        for surface in each() {
            for cosine in [0.0, 0.1, 0.5, 1.0] {
                let Reflection { diffuse, lobe } = surface.reflection(cosine);
                assert!((diffuse + lobe.albedo()).max_element() <= 1.02, "{surface:?} {cosine}");
                assert!(diffuse.min_element() >= 0.0 && lobe.albedo().min_element() >= 0.0);
                let (reflection, specular) = surface.smooth(cosine);
                assert!((reflection.diffuse + specular.reflected).max_element() <= 1.000_001, "{surface:?}");
            }
        }
    }

    #[test]
    fn the_base_is_dimmed_by_the_mean_of_the_fresnel_reflectance() {
        for cosine in [0.05_f32, 0.4, 0.8, 1.0] {
            let outgoing = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
            let mut sum = 0.0_f64;
            for (a, b) in (0..300_u16).flat_map(|a| (0..300_u16).map(move |b| (a, b))) {
                let [height, angle] = [a, b].map(|i| (f32::from(i) + 0.5) / 300.0);
                let (sine, angle) = ((1.0 - height).sqrt(), angle * core::f32::consts::TAU);
                let incident = Vec3::new(sine * angle.cos(), height.sqrt(), sine * angle.sin());
                let along = (incident + outgoing).normalize().dot(outgoing);
                sum += f64::from((1.0 - along).powi(5));
            }
            let mean = (sum / 90_000.0) as f32;
            assert!((mean - mean_schlick(cosine)).abs() < 2e-4, "{cosine}: {mean}");
        }
    }

    #[test]
    fn a_rough_white_metal_that_is_compensated_loses_no_light() {
        for (roughness, cosine) in [(0.3, 0.2), (0.6, 0.9), (1.0, 0.3), (1.0, 1.0)] {
            let white = MetallicRoughness {
                base: Vec3::ONE,
                dielectric: Vec3::ZERO,
                grazing: 0.0,
                metallic: 1.0,
                roughness,
                has_narrow_lobe: false,
                is_compensated: true,
            };
            let albedo = white.reflection(cosine).lobe.albedo().x;
            assert!((albedo - 1.0).abs() < 1e-3, "{roughness} {cosine}: {albedo}");
        }
    }

    #[test]
    fn smooth_metals_are_mirrors() {
        let gold = MetallicRoughness {
            base: Vec3::splat(0.8),
            dielectric: Vec3::splat(0.04),
            grazing: 1.0,
            metallic: 1.0,
            roughness: 0.0,
            has_narrow_lobe: false,
            is_compensated: false,
        };
        let (rest, specular) = gold.smooth(1.0);
        assert!(rest.is_black());
        assert_eq!(specular.reflected, Vec3::splat(0.8));
        assert_eq!(gold.smooth(0.0).1.reflected, Vec3::ONE);
    }

    #[test]
    fn a_dielectric_without_reflectance_reflects_nothing_at_grazing_angles_either() {
        let dull = MetallicRoughness {
            base: Vec3::splat(0.5),
            dielectric: Vec3::ZERO,
            grazing: 0.0,
            metallic: 0.0,
            roughness: 0.0,
            has_narrow_lobe: false,
            is_compensated: false,
        };
        assert_eq!(dull.smooth(0.0).1.reflected, Vec3::ZERO);
        assert!(dull.reflection(0.1).is_lambertian());
    }
}
