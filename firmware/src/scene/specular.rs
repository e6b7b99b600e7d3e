//! Perfectly specular reflection and transmission: mirrors, smooth coats, smooth glass.

use glam::Vec3;
use photoncard_shared::layout::{Material, PANE, THIN_WALLED};

use super::shading_normal::bent;
use crate::vector::{max, mirror, sqrt, unit};

/// Perfectly specular reflection and transmission at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Specular {
    /// Reflectance towards the mirror direction, 0 to 1.
    pub reflected: Vec3,
    /// Transmittance, 0 to 1.
    pub transmitted: Vec3,
    /// Unit direction of the specular reflection if a microfacet of rough glass determines it. Zero stands
    /// for the mirror direction about the shading normal.
    pub beside: Vec3,
    /// Unit direction in which an eye path or a photon continues behind the surface after transmission.
    pub behind: Vec3,
    /// Absorption coefficient behind the surface, 1/m; meaningless for flat glass.
    pub absorption: Vec3,
    /// Probability with which the base layer was chosen, if it is flat glass (a thin wall, or a face of a
    /// pane); else 0. Light passes flat glass without a change of direction or medium.
    pub straight: f32,
    /// Ratio of the radiance in front to the radiance behind, at a transmittance of 1. It is `1 / n^2`, where
    /// `n` is the index of refraction behind divided by the one in front; 1 for flat glass.
    pub radiance_scale: f32,
}

impl Specular {
    /// Value for a surface without a perfectly specular part.
    pub const NONE: Self = Self {
        reflected: Vec3::ZERO,
        transmitted: Vec3::ZERO,
        beside: Vec3::ZERO,
        behind: Vec3::ZERO,
        absorption: Vec3::ZERO,
        straight: 0.0,
        radiance_scale: 1.0,
    };

    pub(super) fn mirror(reflected: Vec3) -> Self {
        Self { reflected, ..Self::NONE }
    }

    /// Multiplies the reflectance and the transmittance by `share`.
    pub(super) fn dimmed(self, share: f32) -> Self {
        Self { reflected: self.reflected * share, transmitted: self.transmitted * share, ..self }
    }

    /// Returns true for flat glass.
    #[inline(always)]
    pub fn is_straight(&self) -> bool {
        self.straight > 0.0
    }

    /// Returns true if there is neither perfectly specular reflection nor transmission.
    #[inline(always)]
    pub fn is_none(&self) -> bool {
        self.reflected == Vec3::ZERO && self.transmitted == Vec3::ZERO
    }

    /// Mirror direction of `outgoing` about the shading normal `normal`. If the mirror direction would lie
    /// below the surface, the normal is `bent` first.
    pub(crate) fn reflected_direction(outgoing: Vec3, normal: Vec3, geometric_normal: Vec3) -> Vec3 {
        let direction = mirror(outgoing, bent(normal, outgoing, geometric_normal));
        // At grazing views, rounding may take the direction below the surface.
        if direction.dot(geometric_normal) > 0.0 { direction } else { mirror(outgoing, geometric_normal) }
    }
}

/// Kind of glass body whose surface is hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bounds {
    /// A volume of glass.
    Solid,
    /// A wall without thickness, with air on both sides.
    ThinWall,
    /// A slab whose faces are parallel; the surface is one face ([`photoncard_shared::layout::PANE`]).
    Pane,
}

impl Bounds {
    /// Reads the kind of body from the flags of a material.
    #[inline(always)]
    pub(super) fn of(material: &Material) -> Self {
        match material.flags & (PANE | THIN_WALLED) {
            0 => Self::Solid,
            THIN_WALLED => Self::ThinWall,
            _ => Self::Pane,
        }
    }
}

/// Smooth dielectric at a point, with textures applied.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glass {
    /// Colour that multiplies the light at each passage of the surface: the base colour for a thin wall; its
    /// square root for a volume or a pane, which has two faces.
    pub(super) base: Vec3,
    /// Absorption coefficient inside, 1/m; for a pane, the optical depth along the normal.
    pub(super) absorption: Vec3,
    /// Fraction, 0 to 1, of the unreflected light that is transmitted.
    pub(super) transmission: f32,
    /// Index of refraction.
    pub(super) ior: f32,
    /// Factor of the reflectance (`specularFactor` of `KHR_materials_specular`).
    pub(super) specular: f32,
    pub(super) bounds: Bounds,
}

impl Glass {
    /// Returns the fraction of the light that is left for the Lambertian base, and the specular part. Both
    /// normals are on the side of `outgoing`. `is_inside` is true if this side is the inside of the body.
    pub(super) fn at(
        &self,
        outgoing: Vec3,
        [normal, geometric_normal]: [Vec3; 2],
        is_inside: bool,
    ) -> (f32, Specular) {
        if self.bounds == Bounds::Pane && is_inside {
            return self.passed_on(outgoing);
        }
        let cosine = max(normal.dot(outgoing), 0.0);
        let index = if is_inside && self.bounds == Bounds::Solid { 1.0 / self.ior } else { self.ior };
        let (reflectance, cosine_behind) = fresnel(cosine, index);
        // Total internal reflection is not scaled.
        let reflectance = if cosine_behind > 0.0 { reflectance * self.specular } else { reflectance };
        if self.bounds == Bounds::Pane {
            return self.pane(outgoing, reflectance, cosine_behind);
        }
        let is_straight = self.bounds == Bounds::ThinWall;
        // Interreflection between both faces of a thin wall: 2 R / (1 + R) (Stokes 1862).
        let reflectance = if is_straight { 2.0 * reflectance / (1.0 + reflectance) } else { reflectance };
        let refracted = unit(normal * (cosine / index - cosine_behind) - outgoing * (1.0 / index));
        let behind =
            if is_straight || refracted.dot(geometric_normal) >= 0.0 { -outgoing } else { refracted };
        let through = 1.0 - reflectance;
        let specular = Specular {
            reflected: Vec3::splat(reflectance),
            transmitted: self.base * (through * self.transmission),
            beside: Vec3::ZERO,
            behind,
            absorption: if is_inside || is_straight { Vec3::ZERO } else { self.absorption },
            straight: if is_straight { 1.0 } else { 0.0 },
            radiance_scale: if is_straight { 1.0 } else { 1.0 / (index * index) },
        };
        (through * (1.0 - self.transmission), specular)
    }

    /// Does `Self::at` for the outer side of a pane's face. This side has the scattering of the whole pane. A
    /// face has the reflectance `R` at this angle, and the glass between the faces has the transmittance `a`.
    /// The pane transmits `(1 - R)^2 a / (1 - R^2 a^2)` and reflects `R + (1 - R)^2 R a^2 / (1 - R^2 a^2)`.
    #[inline(never)]
    fn pane(&self, outgoing: Vec3, reflectance: f32, cosine_inside: f32) -> (f32, Specular) {
        let through = 1.0 - reflectance;
        let depth = self.absorption * (-1.0 / max(cosine_inside, f32::MIN_POSITIVE));
        let once = Vec3::from_array(depth.to_array().map(libm::expf));
        let there_and_back = once * once;
        let of_all = (through * through) / (Vec3::ONE - there_and_back * (reflectance * reflectance));
        let both_faces = self.base * self.base * (self.transmission * self.transmission);
        let specular = Specular {
            reflected: Vec3::splat(reflectance) + both_faces * of_all * there_and_back * reflectance,
            transmitted: self.base * of_all * once * self.transmission,
            behind: -outgoing,
            straight: 1.0,
            ..Specular::NONE
        };
        (through * (1.0 - self.transmission), specular)
    }

    /// Does `Self::at` for the inner side of a pane's face, which transmits without specular reflection.
    fn passed_on(&self, outgoing: Vec3) -> (f32, Specular) {
        let transmitted = self.base * self.transmission;
        let specular = Specular { transmitted, behind: -outgoing, straight: 1.0, ..Specular::NONE };
        (1.0 - self.transmission, specular)
    }
}

/// Fresnel reflectance of a dielectric for unpolarised light, and cosine of the refracted direction; `(1, 0)`
/// under total internal reflection. `index` is the index of refraction behind divided by the one in front.
fn fresnel(cosine: f32, index: f32) -> (f32, f32) {
    let sine_squared = (1.0 - cosine * cosine) / (index * index);
    let cosine_squared = 1.0 - sine_squared;
    // NaN from an unsound card image counts as total reflection.
    if cosine_squared.is_nan() || cosine_squared <= 0.0 {
        return (1.0, 0.0);
    }
    let behind = sqrt(cosine_squared);
    let parallel = (index * cosine - behind) / (index * cosine + behind);
    let perpendicular = (cosine - index * behind) / (cosine + index * behind);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), behind)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GLASS: Glass = Glass {
        base: Vec3::ONE,
        absorption: Vec3::new(1.0, 2.0, 3.0),
        transmission: 1.0,
        ior: 1.5,
        specular: 1.0,
        bounds: Bounds::Solid,
    };

    fn at(degrees: f32, is_inside: bool, glass: Glass) -> Specular {
        let angle = degrees.to_radians();
        let outgoing = Vec3::new(angle.sin(), angle.cos(), 0.0);
        let (diffuse, specular) = glass.at(outgoing, [Vec3::Y; 2], is_inside);
        assert_eq!(diffuse, 0.0);
        specular
    }

    #[test]
    fn glass_reflects_as_fresnel_says() {
        assert!((at(0.0, false, GLASS).reflected.x - 0.04).abs() < 1e-6);
        assert!((at(0.0, true, GLASS).reflected.x - 0.04).abs() < 1e-6);
        // At Brewster's angle the parallel part vanishes.
        let brewster = 1.5_f32.atan().to_degrees();
        assert!((at(brewster, false, GLASS).reflected.x - 0.073_964).abs() < 1e-5);
        assert!((at(89.999, false, GLASS).reflected.x - 1.0).abs() < 1e-3);
        assert_eq!(at(45.0, true, GLASS).reflected, Vec3::ONE);
        assert_eq!(at(45.0, true, GLASS).transmitted, Vec3::ZERO);
    }

    #[test]
    fn light_is_refracted_as_snell_says_and_back_again() {
        for degrees in [0.0_f32, 10.0, 40.0, 80.0] {
            let into = at(degrees, false, GLASS);
            let sine = degrees.to_radians().sin();
            assert!((into.behind.x + sine / 1.5).abs() < 1e-5 && into.behind.y < 0.0, "{into:?}");
            let out = at((sine / 1.5).asin().to_degrees(), true, GLASS);
            assert!((out.behind.x + sine).abs() < 1e-4, "{out:?}");
            assert_eq!([into.absorption, out.absorption], [GLASS.absorption, Vec3::ZERO]);
        }
    }

    #[test]
    fn clear_glass_conserves_energy() {
        for bounds in [Bounds::Solid, Bounds::ThinWall, Bounds::Pane] {
            for degrees in [0.0, 30.0, 60.0, 89.0] {
                let specular = at(degrees, false, Glass { bounds, absorption: Vec3::ZERO, ..GLASS });
                assert!((specular.reflected + specular.transmitted - Vec3::ONE).abs().max_element() < 1e-6);
                assert!(specular.behind.y < 0.0);
            }
        }
    }

    #[test]
    fn a_thin_wall_transmits_like_a_slab_and_keeps_the_direction() {
        let wall = at(30.0, false, Glass { bounds: Bounds::ThinWall, ..GLASS });
        let face = at(30.0, false, GLASS).reflected.x;
        // The sum over all reflections inside the slab.
        let slab: f32 = (0..20).map(|k| (1.0 - face) * (1.0 - face) * face.powi(2 * k)).sum();
        assert!((wall.transmitted.x - slab).abs() < 1e-5);
        assert!((wall.behind + Vec3::new(0.5, 30_f32.to_radians().cos(), 0.0)).length() < 1e-5);
    }

    #[test]
    fn a_pane_sums_all_reflections_within_a_slab_and_keeps_the_direction() {
        let depth = Vec3::new(0.0, 0.3, 2.0);
        let tint = Vec3::new(0.9, 0.7, 1.0);
        let pane = Glass { base: tint, absorption: depth, bounds: Bounds::Pane, ..GLASS };
        for degrees in [0.0_f32, 30.0, 75.0] {
            let front = at(degrees, false, pane);
            let back = at(degrees, true, pane);
            assert_eq!(back.reflected, Vec3::ZERO);
            let outgoing = Vec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
            assert!((front.behind + outgoing).length() < 1e-5 && (back.behind + outgoing).length() < 1e-5);
            let face = f64::from(at(degrees, false, GLASS).reflected.x);
            let inside = (1.0 - (f64::from(degrees).to_radians().sin() / 1.5).powi(2)).sqrt();
            for channel in 0..3 {
                let [depth, tint] = [depth, tint].map(|colour| f64::from(colour[channel]));
                let once = (-depth / inside).exp();
                let through: f64 =
                    (0..20).map(|k| (1.0 - face).powi(2) * once * (face * once).powi(2 * k)).sum();
                let found = f64::from(front.transmitted[channel] * back.transmitted[channel]);
                assert!((found - tint * tint * through).abs() < 1e-5, "{found} of {through}");
                let returned = face + tint * tint * through * face * once;
                assert!((f64::from(front.reflected[channel]) - returned).abs() < 1e-5);
            }
        }
    }
}
