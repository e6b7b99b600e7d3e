//! glTF's metallic-roughness as a Lambertian surface with one Phong lobe.
//!
//! glTF's surface (glTF 2.0, appendix B) is a Lambertian base under a coat that reflects by GGX microfacets of
//! `alpha = roughness^2`. Here:
//!
//! - The lobe's exponent is `n = 0.4 / alpha^2 - 0.4`: somewhat wider than GGX's peak, for its long tails. (A Phong lobe of
//!   `0.5 / alpha^2` is as wide as the peak, Walter et al. 2007.) The factor is a compromise for the balls of `scenes/roughness.glb`:
//!   smooth metals are closest with a somewhat greater one, rough metals with a smaller one.
//! - The lobe's albedo is `a F0 + b F90`, the mean over the hemisphere of what GGX's coat reflects, with Schlick's
//!   reflectance: masking makes it less, the rougher it is. `a = 20/21 / (1 + 1.6 alpha^2)` and
//!   `b = 1/21 / (1 + 1.5 alpha + 19.5 alpha^2)` are fitted to integrals by the Monte Carlo method, to 3 % of the albedo.
//!   A metal's is multiplied by 1.1, but no channel is above 1: a Phong lobe loses what is below the horizon. `F0` is
//!   the dielectric's with the share `1 - metallic`, the base colour with the share `metallic`.
//! - The Lambertian albedo is `base (1 - metallic) (1 - dielectric)`, where `dielectric` is the greatest channel of Schlick's
//!   mean over pairs of directions, each distributed by the cosine. It is lowered where more light would leave than arrives.
//! - At roughness 0 the coat is perfectly specular, with Schlick's reflectance `F0 + (F90 - F0) (1 - cos)^5`.
//!
//! The error against GGX is measured in `docs/accuracy.md`.

use glam::Vec3;
use photoncard_shared::layout::MAX_PHONG_EXPONENT;

use super::Reflection;
use super::phong::PhongLobe;
use crate::scene::specular::Specular;
use crate::vector::{max, max_component, min};

/// F90 = min(25 F0, 1). 25 = 1 / 0.04, the F0 of an index of refraction of 1.5.
const F90_OVER_F0: f32 = 25.0;

/// Mean of Schlick's `(1 - cos)^5` over pairs of directions, each distributed by the cosine.
const MEAN_OF_PAIRS: f32 = 0.0037;

/// The albedo of a metal's lobe over the mean albedo of GGX.
const METAL_GAIN: f32 = 1.1;

/// Metallic-roughness surface at a point, textures applied.
#[derive(Clone, Copy, Debug)]
pub(super) struct MetallicRoughness {
    pub(super) base: Vec3,
    pub(super) dielectric: Vec3,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
}

impl MetallicRoughness {
    /// F90 of the dielectric.
    fn grazing(&self) -> f32 {
        min(max_component(self.dielectric) * F90_OVER_F0, 1.0)
    }

    /// The dielectric's reflectance for a share of the way from F0 to F90, and the Lambertian albedo of the base beneath.
    #[inline(never)]
    fn dielectric_and_base(&self, share: f32) -> [Vec3; 2] {
        let dielectric = towards(self.dielectric, self.grazing(), share);
        [dielectric, self.base * ((1.0 - self.metallic) * (1.0 - max_component(dielectric)))]
    }

    /// The reflection, without its perfectly specular part.
    pub(super) fn reflection(&self) -> Reflection {
        let [_, diffuse] = self.dielectric_and_base(MEAN_OF_PAIRS);
        let lobe = self.lobe();
        Reflection { diffuse: diffuse.min(Vec3::ONE - lobe.albedo), lobe }
    }

    /// A share of the lobe, beside a Lambertian part of another albedo.
    pub(super) fn lobe_beside(&self, diffuse: Vec3, share: f32) -> Reflection {
        let PhongLobe { albedo, exponent } = self.lobe();
        Reflection::phong(diffuse, albedo * share, exponent)
    }

    /// The lobe, of an albedo of at most 1.
    #[inline(never)]
    fn lobe(&self) -> PhongLobe {
        let alpha = self.roughness * self.roughness;
        let squared = alpha * alpha;
        let exponent = 0.4 / max(squared, f32::MIN_POSITIVE) - 0.4;
        let exponent = min(max(exponent, 0.0), MAX_PHONG_EXPONENT);
        PhongLobe { albedo: self.lobe_albedo(alpha), exponent }
    }

    #[inline(always)]
    fn lobe_albedo(&self, alpha: f32) -> Vec3 {
        let normal = 20.0 / 21.0 / (1.0 + 1.6 * alpha * alpha);
        let grazing = 1.0 / 21.0 / (1.0 + (1.5 + 19.5 * alpha) * alpha);
        let dielectric = self.dielectric * normal + Vec3::splat(self.grazing() * grazing);
        let metal = self.base * normal + Vec3::splat(grazing);
        // All channels alike: the hue stays. No division by less than one half.
        let metal = metal * min(METAL_GAIN, 1.0 / max(max_component(metal), 0.5));
        (dielectric * (1.0 - self.metallic) + metal * self.metallic).min(Vec3::ONE)
    }

    /// The Lambertian and the perfectly specular part at roughness 0, seen at a cosine to the normal.
    pub(super) fn smooth(&self, cosine: f32) -> (Reflection, Specular) {
        let rest = 1.0 - cosine;
        let squared = rest * rest;
        let share = squared * squared * rest;
        let [dielectric, diffuse] = self.dielectric_and_base(share);
        let metal = towards(self.base, 1.0, share);
        let reflected = dielectric * (1.0 - self.metallic) + metal * self.metallic;
        (Reflection::lambertian(diffuse), Specular::mirror(reflected))
    }
}

/// The reflectance for a share of the way from F0 to F90.
fn towards(normal: Vec3, grazing: f32, share: f32) -> Vec3 {
    normal + (Vec3::splat(grazing) - normal) * share
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Lambertian albedo, the lobe's, and the lobe's exponent.
    fn parts(reflection: &Reflection) -> (Vec3, Vec3, f32) {
        (reflection.diffuse, reflection.lobe.albedo, reflection.lobe.exponent)
    }

    fn each() -> impl Iterator<Item = MetallicRoughness> {
        let steps = [0.0, 0.04, 0.3, 0.8, 1.0];
        steps.into_iter().flat_map(move |base| {
            steps.into_iter().flat_map(move |dielectric| {
                steps.into_iter().flat_map(move |metallic| {
                    steps.into_iter().map(move |roughness| MetallicRoughness {
                        base: Vec3::splat(base),
                        dielectric: Vec3::splat(dielectric),
                        metallic,
                        roughness,
                    })
                })
            })
        })
    }

    #[test]
    fn no_more_light_leaves_than_arrives() {
        for surface in each() {
            let (diffuse, specular, exponent) = parts(&surface.reflection());
            assert!((diffuse + specular).max_element() <= 1.000_001, "{surface:?}");
            assert!(diffuse.min_element() >= 0.0 && specular.min_element() >= 0.0);
            assert!((0.0..=MAX_PHONG_EXPONENT).contains(&exponent));
            for cosine in [0.0, 0.1, 0.5, 1.0] {
                let (reflection, specular) = surface.smooth(cosine);
                assert!((reflection.diffuse + specular.reflected).max_element() <= 1.000_001, "{surface:?}");
            }
        }
    }

    #[test]
    fn rough_dielectrics_are_nearly_lambertian_and_smooth_metals_are_mirrors() {
        let paper = MetallicRoughness {
            base: Vec3::splat(0.8),
            dielectric: Vec3::splat(0.04),
            metallic: 0.0,
            roughness: 1.0,
        };
        let (diffuse, specular, exponent) = parts(&paper.reflection());
        assert_eq!(exponent, 0.0);
        assert!((diffuse.x - 0.765).abs() < 0.001 && (specular.x - 0.0168).abs() < 0.0005);
        let gold = MetallicRoughness { metallic: 1.0, roughness: 0.0, ..paper };
        let (rest, specular) = gold.smooth(1.0);
        assert!(rest.is_black());
        assert_eq!(specular.reflected, Vec3::splat(0.8));
        assert_eq!(gold.smooth(0.0).1.reflected, Vec3::ONE);
    }

    /// The integrals of GGX's coat with Smith's separable masking by the Monte Carlo method: a metal of base colour 0.8.
    #[test]
    fn lobes_have_the_albedo_of_rough_metals() {
        for (roughness, albedo) in [(0.2, 0.8055), (0.4, 0.7568), (0.6, 0.6401), (0.8, 0.4709)] {
            let metal = MetallicRoughness {
                base: Vec3::splat(0.8),
                dielectric: Vec3::splat(0.04),
                metallic: 1.0,
                roughness,
            };
            let gain = parts(&metal.reflection()).1.x / albedo;
            assert!((gain - METAL_GAIN).abs() < 0.02, "{roughness}: {gain}");
        }
    }

    #[test]
    fn bright_metals_keep_their_hue() {
        let base = Vec3::new(1.0, 0.766, 0.336);
        let gold = MetallicRoughness { base, dielectric: Vec3::splat(0.04), metallic: 1.0, roughness: 0.3 };
        let (_, specular, _) = parts(&gold.reflection());
        assert!(specular.x <= 1.000_001 && (specular.y / specular.x - 0.766).abs() < 0.02);
    }

    #[test]
    fn a_dielectric_without_reflectance_reflects_nothing_at_grazing_angles_either() {
        let dull = MetallicRoughness {
            base: Vec3::splat(0.5),
            dielectric: Vec3::ZERO,
            metallic: 0.0,
            roughness: 0.0,
        };
        assert_eq!(dull.smooth(0.0).1.reflected, Vec3::ZERO);
        assert_eq!(parts(&dull.reflection()).1, Vec3::ZERO);
    }
}
