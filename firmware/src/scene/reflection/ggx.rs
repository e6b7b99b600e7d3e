//! Microfacet lobe of glTF's metallic-roughness model, `f = D V F`: isotropic, with single scattering. It
//! follows glTF 2.0, appendix B.3, except that the masking is height-correlated.
//!
//! `n` is the normal, `o` and `i` the outgoing and incident direction, `h` their half vector,
//! `a = roughness^2`:
//!
//! - `D = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2)` (Walter et al. 2007; Trowbridge, Reitz 1975);
//! - `V = 1 / (2 (n.i) L(n.o) + 2 (n.o) L(n.i))`, `L(c) = sqrt(a^2 + (1 - a^2) c^2)`: height-correlated Smith
//!   masking (Heitz 2014);
//! - `F = F0 + (F90 - F0) (1 - h.o)^5` (Schlick 1994).
//!
//! A mixture of metal and dielectric of the same roughness is a single lobe, because `F` is linear in `F0`
//! and `F90`. Directions are sampled by visible normals (Heitz 2018) with spherical caps (Dupuy, Benyoub
//! 2023). Their density is `p = D / (2 (n.o + L(n.o)))`; the weight `f cos / p` is at most `F`.

use core::f32::consts::PI;

use glam::Vec3;

use super::ggx_albedo::albedo_shares;
use crate::vector::{about, max, max_component, min, mirror, sqrt, unit};

/// Minimum of `a`. At this `a`, the lobe is 0.06 degrees wide, and `f32` still resolves the half vector
/// within it.
pub(super) const MIN_ALPHA: f32 = 1e-3;

/// Minimum of `a` for [`GgxLobe::gathers_caustics`]. At this `a`, half of the lobe's light is within 3.4
/// degrees of the mirror direction.
const MIN_CAUSTIC_ALPHA: f32 = 0.03;

/// Lower limit of the albedo by which energy compensation divides.
const MIN_ALBEDO: f32 = 0.1;

/// A GGX lobe for one outgoing direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GgxLobe {
    /// `F0`: the reflectance at normal incidence.
    f0: Vec3,
    /// `F90`: the reflectance at grazing incidence.
    f90: Vec3,
    /// `a = roughness^2`.
    alpha: f32,
    /// Albedo, 0 to 1, for the outgoing direction.
    pub(super) albedo: Vec3,
    /// Coefficients of `F0` and `F90` in the albedo `E = F0 A + F90 B`: `[A, B]`.
    shares: [f32; 2],
    pub(super) estimate: Estimate,
}

/// Method that estimates the light reflected by a lobe at the end of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(super) enum Estimate {
    /// Photons are gathered for the lobe.
    Photons,
    /// A ray follows the lobe. Caustic photons of lights without an area are stored and gathered for the
    /// lobe.
    Ray,
    /// Like [`Self::Ray`], but no caustic photons are stored for the lobe. Instead, the caustic photons that
    /// are stored for the Lambertian part of the same surface are gathered.
    RayBesideBase,
    /// A ray follows the lobe, and no photons are gathered for it. Lobes of coats and of rough transmission
    /// use this method.
    RayAlone,
}

/// Cosines and squared sine on which the lobe depends. `incident` is `n.i`; `outgoing` is `n.o`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Geometry {
    pub(super) incident: f32,
    pub(super) outgoing: f32,
    /// `1 - (n.h)^2`.
    sine_squared: f32,
    /// Cosine `h.o`.
    along: f32,
}

impl Geometry {
    /// Computes the cosines and the sine from unit vectors. Both directions are on the normal's side.
    #[inline(always)]
    pub(super) fn new(normal: Vec3, outgoing: Vec3, incident: Vec3) -> Self {
        let half = unit(outgoing + incident);
        Self {
            incident: max(normal.dot(incident), 0.0),
            outgoing: max(normal.dot(outgoing), f32::MIN_POSITIVE),
            // Computed by the cross product: near the lobe's peak the digits of 1 - (n.h)^2 would cancel.
            sine_squared: normal.cross(half).length_squared(),
            along: min(max(outgoing.dot(half), 0.0), 1.0),
        }
    }
}

impl GgxLobe {
    /// Creates a lobe with `roughness`, 0 to 1. `cosine` is the cosine between outgoing direction and normal.
    pub(super) fn new(f0: Vec3, f90: Vec3, roughness: f32, cosine: f32) -> Self {
        let shares = albedo_shares(roughness, cosine);
        let [of_f0, of_f90] = shares;
        let albedo = (f0 * of_f0 + f90 * of_f90).min(Vec3::ONE);
        Self {
            f0,
            f90,
            alpha: max(roughness * roughness, MIN_ALPHA),
            albedo,
            shares,
            estimate: Estimate::Photons,
        }
    }

    /// Marks the lobe as one that rays follow, without a gather of photons ([`Estimate::RayAlone`]).
    pub(super) fn as_layer(self) -> Self {
        Self { estimate: Estimate::RayAlone, ..self }
    }

    /// Compensates for the missing multiple scattering between microfacets: multiplies `f` by
    /// `1 + F0 (1 - E) / E`, where `E` is the albedo of a lobe with `F = 1` (Turquin 2019, *Practical
    /// multiple scattering compensation for microfacet models*).
    pub(super) fn compensated(self) -> Self {
        let [of_f0, of_f90] = self.shares;
        let of_white = min(max(of_f0 + of_f90, MIN_ALBEDO), 1.0);
        self.dimmed(Vec3::ONE + self.f0 * ((1.0 - of_white) / of_white))
    }

    /// Maximum channel, 0 to 1, of the albedo of a lobe with the given `f0` and `f90`, and with this lobe's
    /// roughness and outgoing direction.
    pub(super) fn albedo_of(&self, f0: Vec3, f90: f32) -> f32 {
        let [of_f0, of_f90] = self.shares;
        min(max_component(f0) * of_f0 + f90 * of_f90, 1.0)
    }

    /// Multiplies `f` by a colour.
    #[inline(always)]
    pub(super) fn dimmed(self, colour: Vec3) -> Self {
        Self { f0: self.f0 * colour, f90: self.f90 * colour, albedo: self.albedo * colour, ..self }
    }

    /// Returns true if caustic photons of lights without an area are gathered for the lobe. The lobe must be
    /// wider than the rounding error of photon directions, and than the angle that a photon's disc subtends
    /// at the object that the lobe reflects.
    pub(super) fn gathers_caustics(&self) -> bool {
        self.alpha >= MIN_CAUSTIC_ALPHA && self.estimate != Estimate::RayAlone
    }

    /// `a = roughness^2`.
    #[inline(always)]
    pub(super) fn alpha(&self) -> f32 {
        self.alpha
    }

    /// Roughness, `sqrt(a)`.
    pub(super) fn roughness(&self) -> f32 {
        sqrt(self.alpha)
    }

    /// BRDF `f`, 1/sr.
    #[inline(always)]
    pub(super) fn evaluate(&self, geometry: &Geometry) -> Vec3 {
        self.fresnel(geometry) * (distribution(self.alpha, geometry) * visibility(self.alpha, geometry))
    }

    /// Sampling density `p`, 1/sr.
    #[inline(always)]
    pub(super) fn density(&self, geometry: &Geometry) -> f32 {
        let Geometry { outgoing, .. } = *geometry;
        distribution(self.alpha, geometry) / (2.0 * (outgoing + length(self.alpha, outgoing)))
    }

    /// Sampling weight `f cos / p = F G2 / G1`, dimensionless, of a direction above the surface.
    pub(super) fn weight(&self, geometry: &Geometry) -> Vec3 {
        let Geometry { incident, outgoing, .. } = *geometry;
        let visible = 2.0 * (outgoing + length(self.alpha, outgoing)) * visibility(self.alpha, geometry);
        self.fresnel(geometry) * (visible * incident)
    }

    /// Ratio `f / (albedo p)`, dimensionless, from the maximum channels of `f` and of the albedo.
    #[inline(always)]
    pub(super) fn gain(&self, geometry: &Geometry) -> f32 {
        let Geometry { outgoing, .. } = *geometry;
        let visible = 2.0 * (outgoing + length(self.alpha, outgoing)) * visibility(self.alpha, geometry);
        let albedo = max(max_component(self.albedo), f32::MIN_POSITIVE);
        max_component(self.fresnel(geometry)) * visible / albedo
    }

    /// Colour by which a [`Kernel`](super::ggx_kernel::Kernel) is multiplied in place of `F`. It is the mean
    /// of `F`: the lobe's albedo divided by the albedo of a lobe with `F = 1`. The reflection of uniform
    /// light is thus exact.
    pub(super) fn colour(&self) -> Vec3 {
        let [of_f0, of_f90] = self.shares;
        self.albedo * (1.0 / max(of_f0 + of_f90, f32::MIN_POSITIVE))
    }

    #[inline(always)]
    fn fresnel(&self, geometry: &Geometry) -> Vec3 {
        let rest = 1.0 - geometry.along;
        let squared = rest * rest;
        self.f0 + (self.f90 - self.f0) * (squared * squared * rest)
    }

    /// Maps a point of the unit square to a direction with density `p`, possibly below the surface.
    #[inline(always)]
    pub(super) fn direction(&self, normal: Vec3, outgoing: Vec3, point: [f32; 2]) -> Vec3 {
        mirror(outgoing, visible_normal(normal, outgoing, self.alpha, point))
    }

    /// Returns true if `F0` or `F90` is above 0 in some channel.
    #[inline(always)]
    pub(super) fn reflects(&self) -> bool {
        max_component(self.f0) > 0.0 || max_component(self.f90) > 0.0
    }
}

/// Maps a point of the unit square to a microfacet normal, with the distribution of visible normals.
#[inline(always)]
fn visible_normal(normal: Vec3, outgoing: Vec3, alpha: f32, [u, v]: [f32; 2]) -> Vec3 {
    let height = normal.dot(outgoing);
    // The ellipsoid of normals, scaled to a sphere.
    let flat = outgoing - normal * height;
    let stretched = unit(flat * alpha + normal * height);
    let top = normal.dot(stretched);
    let z = (1.0 - v) * (1.0 + top) - top;
    let sine = sqrt(max(1.0 - z * z, 0.0));
    let cap = about(normal, 2.0 * PI * u, sine, z) + stretched;
    let cap_height = normal.dot(cap);
    unit((cap - normal * cap_height) * alpha + normal * max(cap_height, 0.0))
}

/// Does `visible_normal` for `a = roughness^2`, at least `MIN_ALPHA`.
pub(super) fn microfacet(normal: Vec3, outgoing: Vec3, roughness: f32, point: [f32; 2]) -> Vec3 {
    visible_normal(normal, outgoing, max(roughness * roughness, MIN_ALPHA), point)
}

/// Smith masking `G1`, 0 to 1. `cosine` is the cosine between a direction and the normal.
pub(super) fn masking(roughness: f32, cosine: f32) -> f32 {
    let (alpha, cosine) = (max(roughness * roughness, MIN_ALPHA), max(cosine, 0.0));
    2.0 * cosine / max(cosine + length(alpha, cosine), f32::MIN_POSITIVE)
}

/// Normal distribution `D`, 1/sr.
#[inline(always)]
pub(super) fn distribution(alpha: f32, geometry: &Geometry) -> f32 {
    let squared = alpha * alpha;
    let sine_squared = min(geometry.sine_squared, 1.0);
    let denominator = sine_squared + squared * (1.0 - sine_squared);
    squared / (PI * denominator * denominator)
}

/// Minimum of the denominator of `V`, so that `D V` stays finite.
const MIN_VISIBILITY_SUM: f32 = 1e-12;

/// Visibility `V` (see the module), dimensionless.
#[inline(always)]
pub(super) fn visibility(alpha: f32, geometry: &Geometry) -> f32 {
    let Geometry { incident, outgoing, .. } = *geometry;
    let sum = incident * length(alpha, outgoing) + outgoing * length(alpha, incident);
    0.5 / max(sum, MIN_VISIBILITY_SUM)
}

/// `L(c) = sqrt(a^2 + (1 - a^2) c^2)`, a term of the masking, where `c` is `cosine`.
#[inline(always)]
fn length(alpha: f32, cosine: f32) -> f32 {
    let squared = alpha * alpha;
    sqrt(squared + (1.0 - squared) * cosine * cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unit vector at the angle `acos(cosine)` to the y axis, with an azimuth.
    fn at(cosine: f32, azimuth: f32) -> Vec3 {
        let sine = (1.0 - cosine * cosine).sqrt();
        Vec3::new(sine * azimuth.cos(), cosine, sine * azimuth.sin())
    }

    fn lobe(f0: f32, f90: f32, roughness: f32, cosine: f32) -> GgxLobe {
        GgxLobe::new(Vec3::splat(f0), Vec3::splat(f90), roughness, cosine)
    }

    /// Mean of `f cos / p` over sampled directions.
    fn mean_weight(lobe: &GgxLobe, outgoing: Vec3, side: u32) -> f32 {
        let mut sum = 0.0_f64;
        for index in 0..side * side {
            let point = [index % side, index / side].map(|i| (i as f32 + 0.5) / side as f32);
            let direction = lobe.direction(Vec3::Y, outgoing, point);
            assert!((direction.length() - 1.0).abs() < 1e-3, "{direction}");
            if direction.y > 0.0 {
                let geometry = Geometry::new(Vec3::Y, outgoing, direction);
                sum += f64::from(lobe.evaluate(&geometry).x * direction.y / lobe.density(&geometry));
            }
        }
        (sum / f64::from(side * side)) as f32
    }

    /// Integrals of `f cos`, by quadrature over half vectors. Columns: roughness, cosine, integral for a
    /// metal of F0 = 0.8, integral for a dielectric of F0 = 0.04.
    const ALBEDOS: [(f32, f32, f32, f32); 20] = [
        (0.1, 0.15, 0.8854, 0.4608),
        (0.1, 0.4, 0.8152, 0.1147),
        (0.1, 0.7, 0.8004, 0.0424),
        (0.1, 0.98, 0.8, 0.04),
        (0.3, 0.15, 0.7714, 0.2991),
        (0.3, 0.4, 0.7857, 0.107),
        (0.3, 0.7, 0.7889, 0.043),
        (0.3, 0.98, 0.7924, 0.0396),
        (0.5, 0.15, 0.7148, 0.1477),
        (0.5, 0.4, 0.6835, 0.0724),
        (0.5, 0.7, 0.7092, 0.0398),
        (0.5, 0.98, 0.7314, 0.0366),
        (0.7, 0.15, 0.6688, 0.0825),
        (0.7, 0.4, 0.5803, 0.0456),
        (0.7, 0.7, 0.5531, 0.0304),
        (0.7, 0.98, 0.5574, 0.028),
        (1.0, 0.15, 0.5592, 0.0452),
        (1.0, 0.4, 0.4001, 0.0248),
        (1.0, 0.7, 0.3033, 0.016),
        (1.0, 0.98, 0.2486, 0.0125),
    ];

    #[test]
    fn the_mean_weight_is_the_albedo_in_a_white_furnace() {
        for (roughness, cosine, metal, dielectric) in ALBEDOS {
            for (f0, albedo) in [(0.8, metal), (0.04, dielectric)] {
                let lobe = lobe(f0, 1.0, roughness, cosine);
                let mean = mean_weight(&lobe, at(cosine, 0.4), 200);
                assert!(
                    (mean - albedo).abs() < 0.005 * albedo + 5e-4,
                    "{roughness} {cosine} {f0}: {mean} {albedo}"
                );
                let listed = lobe.albedo.x;
                assert!((listed - albedo).abs() < 0.01, "{roughness} {cosine} {f0}: {listed} {albedo}");
            }
        }
    }

    #[test]
    fn no_weight_is_above_the_reflectance() {
        for roughness in [0.0, 0.05, 0.3, 1.0] {
            for cosine in [0.001, 0.1, 0.5, 1.0] {
                let lobe = lobe(0.9, 0.9, roughness, cosine);
                let outgoing = at(cosine, 2.0);
                for index in 0..1000_u16 {
                    let point = [f32::from(index % 40) / 40.0, f32::from(index / 40) / 25.0];
                    let direction = lobe.direction(Vec3::Y, outgoing, point);
                    if direction.y > 0.0 {
                        let geometry = Geometry::new(Vec3::Y, outgoing, direction);
                        let weight = lobe.evaluate(&geometry).x * direction.y / lobe.density(&geometry);
                        assert!(weight <= 0.901, "{roughness} {cosine} {direction}: {weight}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_ggx_lobe_is_reciprocal() {
        for roughness in [0.1, 0.4, 0.9] {
            for (a, b) in [(0.2, 0.9), (0.5, 0.6), (0.95, 0.1)] {
                for turn in [0.0, 1.0, 3.0] {
                    let [o, i] = [at(a, 0.0), at(b, turn)];
                    let forth = lobe(0.3, 1.0, roughness, a).evaluate(&Geometry::new(Vec3::Y, o, i)).x;
                    let back = lobe(0.3, 1.0, roughness, b).evaluate(&Geometry::new(Vec3::Y, i, o)).x;
                    assert!((forth / back - 1.0).abs() < 1e-4, "{roughness} {a} {b} {turn}: {forth} {back}");
                }
            }
        }
    }

    /// Pearson's chi-squared test of sampled directions against the integral of the density, in 8 x 16 bins
    /// of cosine and azimuth.
    #[test]
    fn directions_are_distributed_as_the_density_says() {
        const ROWS: usize = 8;
        const COLUMNS: usize = 16;
        const SAMPLES: u32 = 1 << 16;
        for (roughness, cosine) in [(0.3, 0.9), (0.5, 0.3), (0.8, 0.6), (1.0, 0.05)] {
            let lobe = lobe(1.0, 1.0, roughness, cosine);
            let outgoing = at(cosine, 0.0);
            let bin = |direction: Vec3| {
                let azimuth = direction.z.atan2(direction.x) / (2.0 * PI) + 0.5;
                let row = ((direction.y * ROWS as f32) as usize).min(ROWS - 1);
                row * COLUMNS + ((azimuth * COLUMNS as f32) as usize).min(COLUMNS - 1)
            };
            let mut found = [0_u32; ROWS * COLUMNS];
            for index in 0..SAMPLES {
                let hash = crate::sampler::hash(index) ^ 0x5bd1_e995;
                let point = [hash, crate::sampler::hash(hash)].map(|bits| (bits >> 8) as f32 / 16_777_216.0);
                let direction = lobe.direction(Vec3::Y, outgoing, point);
                if direction.y > 0.0 {
                    found[bin(direction)] += 1;
                }
            }
            let mut expected = [0.0_f64; ROWS * COLUMNS];
            let side = 1024;
            for i in 0..side {
                for j in 0..2 * side {
                    let height = (i as f32 + 0.5) / side as f32;
                    let azimuth = (j as f32 + 0.5) / side as f32 * PI - PI;
                    let direction = at(height, azimuth);
                    let density = lobe.density(&Geometry::new(Vec3::Y, outgoing, direction));
                    expected[bin(direction)] += f64::from(density) * f64::from(PI) / f64::from(side * side);
                }
            }
            let mut chi_squared = 0.0;
            let mut bins = 0;
            for (found, expected) in found.iter().zip(expected) {
                let expected = expected * f64::from(SAMPLES);
                if expected > 8.0 {
                    chi_squared += (f64::from(*found) - expected).powi(2) / expected;
                    bins += 1;
                }
            }
            // Five standard deviations above the mean of the distribution.
            let bound = f64::from(bins) + 5.0 * f64::from(2 * bins).sqrt();
            assert!(chi_squared < bound, "{roughness} {cosine}: {chi_squared} of {bins}");
        }
    }
}
