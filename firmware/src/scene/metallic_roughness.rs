//! glTF's metallic-roughness as a Lambertian surface with one Phong lobe.
//!
//! glTF's surface (glTF 2.0, appendix B) is a Lambertian base under a coat that reflects by GGX microfacets of
//! `alpha = roughness^2`. Here:
//!
//! - The lobe's exponent is `n = 1 / (2 alpha^2) - 1 / 2`. A Blinn lobe of `2 / alpha^2 - 2` has the width of GGX's
//!   (Walter et al. 2007), and a Phong lobe of a quarter of it is as wide, as the angle to the mirror direction is twice that to
//!   the half vector.
//! - The lobe's albedo is the mean over the hemisphere of Schlick's reflectance, `F0 + (F90 - F0) / 21`: of the dielectric
//!   with the share `1 - metallic`, of the base colour with the share `metallic`.
//! - The Lambertian albedo is `base (1 - metallic) (1 - dielectric)`, where `dielectric` is the dielectric's lobe's greatest channel: no
//!   more light leaves than arrives.
//! - Of roughness 0 the coat is perfectly specular, with Schlick's reflectance at the angle.
//!
//! What that costs against GGX is measured in `docs/accuracy.md`.

use glam::Vec3;

use super::material::Reflection;
use super::specular::Specular;
use crate::vector::{max, max_component, min};

/// The greatest exponent of a lobe.
const MOST_EXPONENT: f32 = 10_000.0;

/// What of the reflectance at normal incidence makes that at grazing incidence 1: 1 / 0.04, of an index of refraction of 1.5.
const GRAZING: f32 = 25.0;

/// A metallic-roughness surface at one place, textures applied.
#[derive(Clone, Copy, Debug)]
pub(super) struct MetallicRoughness {
    pub(super) base: Vec3,
    pub(super) dielectric: Vec3,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
}

impl MetallicRoughness {
    /// The reflectance of the dielectric at grazing incidence: 1, and less where the material asks for less than a
    /// dielectric's.
    fn grazing(&self) -> f32 {
        min(max_component(self.dielectric) * GRAZING, 1.0)
    }

    /// Both coats' reflectances for a share of the way from normal to grazing incidence.
    fn coats(&self, share: f32) -> [Vec3; 2] {
        let towards = |normal: Vec3, grazing: f32| normal + (Vec3::splat(grazing) - normal) * share;
        [towards(self.dielectric, self.grazing()), towards(self.base, 1.0)]
    }

    /// The reflection, without its perfectly specular part.
    pub(super) fn reflection(&self) -> Reflection {
        let [dielectric, metal] = self.coats(1.0 / 21.0);
        let diffuse = self.base * ((1.0 - self.metallic) * (1.0 - max_component(dielectric)));
        let alpha = self.roughness * self.roughness;
        let exponent = 0.5 / max(alpha * alpha, f32::MIN_POSITIVE) - 0.5;
        Reflection {
            diffuse,
            specular: dielectric * (1.0 - self.metallic) + metal * self.metallic,
            exponent: min(max(exponent, 0.0), MOST_EXPONENT),
        }
    }

    /// Both parts of a smooth surface, of roughness 0, seen at a cosine to its normal.
    pub(super) fn smooth(&self, cosine: f32) -> (Reflection, Specular) {
        let rest = 1.0 - cosine;
        let squared = rest * rest;
        let [dielectric, metal] = self.coats(squared * squared * rest);
        let diffuse = self.base * ((1.0 - self.metallic) * (1.0 - max_component(dielectric)));
        let reflected = dielectric * (1.0 - self.metallic) + metal * self.metallic;
        (Reflection { diffuse, ..Reflection::BLACK }, Specular::mirror(reflected))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let Reflection { diffuse, specular, exponent } = surface.reflection();
            assert!((diffuse + specular).max_element() <= 1.000_001, "{surface:?}");
            assert!(diffuse.min_element() >= 0.0 && specular.min_element() >= 0.0);
            assert!((0.0..=MOST_EXPONENT).contains(&exponent));
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
        let reflection = paper.reflection();
        assert_eq!(reflection.exponent, 0.0);
        assert!((reflection.diffuse.x - 0.73).abs() < 0.01 && (reflection.specular.x - 0.086).abs() < 0.001);
        let gold = MetallicRoughness { metallic: 1.0, roughness: 0.0, ..paper };
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
            metallic: 0.0,
            roughness: 0.0,
        };
        assert_eq!(dull.smooth(0.0).1.reflected, Vec3::ZERO);
        assert_eq!(dull.reflection().specular, Vec3::ZERO);
    }
}
