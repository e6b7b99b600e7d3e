//! Sheen lobe of fabrics (`KHR_materials_sheen`): `f = colour D G / (4 (n.i) (n.o))` (Estevez, Kulla 2017,
//! *Production friendly microfacet sheen BRDF*), with `a = roughness^2`:
//!
//! - `D = (2 + 1/a) sin^(1/a)(n, h) / (2 pi)`;
//! - `G = 1 / (1 + l(n.o) + l(n.i))`, where `l` is the fit of Estevez and Kulla.
//!
//! Directions are sampled uniformly over the hemisphere, because the lobe is wide. `E` is the directional
//! albedo of a lobe with `colour = 1`; it is tabulated. A roughness below 0.25 is replaced by 0.25, because
//! `E` would exceed 1 at grazing angles.

use core::f32::consts::PI;

use glam::Vec3;

use super::ggx_albedo::{SIDE, interpolated};
use crate::vector::{about, max, max_component, sqrt, unit};

/// Minimum roughness. A smaller roughness would reflect more light than arrives at grazing angles.
const MIN_ROUGHNESS: f32 = 0.25;
/// Density of sampled directions, 1/sr: uniform over the hemisphere.
const DENSITY: f32 = 0.5 / PI;

/// A sheen lobe for one outgoing direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SheenLobe {
    colour: Vec3,
    alpha: f32,
    /// Albedo `E` of a white lobe for the outgoing direction.
    of_white: f32,
}

impl SheenLobe {
    /// Creates a lobe with `roughness`, 0 to 1. `cosine` is the cosine between outgoing direction and normal.
    pub(super) fn new(colour: Vec3, roughness: f32, cosine: f32) -> Self {
        let roughness = max(roughness, MIN_ROUGHNESS);
        let of_white = interpolated(&ALBEDOS, roughness, cosine);
        Self { colour, alpha: roughness * roughness, of_white }
    }

    pub(super) fn reflects(&self) -> bool {
        max_component(self.colour) > 0.0
    }

    /// Albedo for the outgoing direction.
    pub(super) fn albedo(&self) -> Vec3 {
        self.colour * self.of_white
    }

    /// Multiplies `f` by a colour.
    pub(super) fn dimmed(self, colour: Vec3) -> Self {
        Self { colour: self.colour * colour, ..self }
    }

    /// BRDF `f`, 1/sr.
    #[inline(never)]
    pub(super) fn evaluate(&self, normal: Vec3, outgoing: Vec3, incident: Vec3) -> Vec3 {
        let [o, i] = [outgoing, incident].map(|direction| normal.dot(direction));
        if o <= 0.0 || i <= 0.0 {
            return Vec3::ZERO;
        }
        let half = unit(outgoing + incident);
        let exponent = 1.0 / self.alpha;
        let sine_squared = normal.cross(half).length_squared();
        let distribution = (2.0 + exponent) * libm::powf(sine_squared, 0.5 * exponent) * (0.5 / PI);
        let masking = 1.0 + shadowing(o, self.alpha) + shadowing(i, self.alpha);
        self.colour * (distribution / (masking * 4.0 * o * i))
    }

    /// Density of sampled directions, 1/sr.
    pub(super) fn density(&self) -> f32 {
        DENSITY
    }

    /// Ratio `f / (albedo p)`, dimensionless.
    pub(super) fn gain(&self, normal: Vec3, outgoing: Vec3, incident: Vec3) -> f32 {
        let white = Self { colour: Vec3::ONE, ..*self };
        let albedo = max(self.of_white, f32::MIN_POSITIVE);
        white.evaluate(normal, outgoing, incident).x / (DENSITY * albedo)
    }

    /// Maps a point of the unit square to a direction above the surface, uniformly in solid angle.
    pub(super) fn direction(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
        let sine = sqrt(max(1.0 - v * v, 0.0));
        about(normal, 2.0 * PI * u, sine, v)
    }
}

/// Value of the fit `l` at `cosine`, the cosine between a direction and the normal.
fn shadowing(cosine: f32, alpha: f32) -> f32 {
    let fit = |cosine| logarithm(cosine, alpha);
    libm::expf(if cosine < 0.5 { fit(cosine) } else { 2.0 * fit(0.5) - fit(1.0 - cosine) })
}

/// Natural logarithm of `l` at a cosine `x` up to 0.5: `a / (1 + b x^c) + d x + e`. The five coefficients are
/// interpolated between those for `alpha` 0 and 1.
fn logarithm(x: f32, alpha: f32) -> f32 {
    const ROUGH: [f32; 5] = [21.5473, 3.829_87, 0.198_23, -1.977_6, -4.320_54];
    const SMOOTH: [f32; 5] = [25.3245, 3.324_35, 0.168_01, -1.273_93, -4.859_67];
    let share = (1.0 - alpha) * (1.0 - alpha);
    let at = |index: usize| {
        let of = |list: &[f32; 5]| list.get(index).copied().unwrap_or_default();
        of(&ROUGH) * (1.0 - share) + of(&SMOOTH) * share
    };
    at(0) / (1.0 + at(1) * libm::powf(max(x, 0.0), at(2))) + at(3) * x + at(4)
}

/// Table of `E`, in units of 1/255, computed by the midpoint rule over 512^2 directions. Rows are for
/// roughness 0 to 1, columns for the square root of the cosine, 0 to 1.
const ALBEDOS: [[u8; SIDE]; SIDE] = [
    [255, 255, 255, 255, 76, 12, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0],
    [255, 255, 255, 255, 180, 81, 29, 8, 2, 0, 0, 0, 0, 0, 0, 0],
    [255, 255, 255, 255, 192, 128, 78, 44, 22, 9, 3, 1, 0, 0, 0, 0],
    [255, 255, 255, 225, 176, 132, 95, 65, 42, 25, 13, 6, 2, 1, 0, 0],
    [238, 251, 233, 199, 164, 131, 102, 76, 55, 37, 24, 14, 7, 3, 1, 0],
    [210, 223, 211, 186, 158, 131, 106, 84, 65, 48, 34, 23, 14, 8, 3, 1],
    [196, 210, 201, 180, 156, 133, 111, 91, 73, 57, 43, 31, 21, 13, 7, 2],
    [190, 205, 198, 179, 158, 137, 117, 98, 81, 66, 52, 39, 28, 19, 12, 5],
    [190, 205, 200, 183, 162, 142, 124, 106, 89, 74, 60, 47, 36, 26, 17, 9],
    [194, 209, 206, 189, 169, 149, 131, 114, 98, 82, 68, 55, 43, 33, 23, 14],
    [200, 216, 213, 196, 177, 157, 139, 122, 106, 90, 76, 62, 50, 39, 29, 19],
    [207, 224, 221, 204, 185, 165, 147, 129, 113, 98, 83, 69, 57, 45, 35, 24],
    [215, 232, 229, 212, 192, 172, 153, 136, 120, 104, 89, 75, 63, 51, 40, 30],
    [221, 238, 235, 218, 197, 177, 159, 141, 125, 109, 94, 80, 68, 56, 45, 34],
    [223, 241, 238, 220, 200, 180, 161, 144, 128, 112, 98, 84, 71, 60, 49, 38],
    [220, 238, 235, 218, 198, 179, 161, 144, 128, 114, 99, 86, 74, 62, 52, 42],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of `f cos / p` over a grid of sampled directions.
    fn mean_weight(lobe: &SheenLobe, outgoing: Vec3, side: u16) -> f32 {
        let points = (0..side).flat_map(|a| (0..side).map(move |b| [a, b]));
        let sum: f64 = points
            .map(|point| {
                let point = point.map(|i| (f32::from(i) + 0.5) / f32::from(side));
                let direction = SheenLobe::direction(Vec3::Y, point);
                f64::from(lobe.evaluate(Vec3::Y, outgoing, direction).x * direction.y / lobe.density())
            })
            .sum();
        (sum / f64::from(side).powi(2)) as f32
    }

    #[test]
    fn the_albedo_is_the_integral_of_the_lobe() {
        for roughness in [0.3_f32, 0.5, 0.8, 1.0] {
            for cosine in [0.15_f32, 0.4, 0.7, 1.0] {
                let outgoing = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
                let lobe = SheenLobe::new(Vec3::ONE, roughness, cosine);
                let [mean, albedo] = [mean_weight(&lobe, outgoing, 300), lobe.albedo().x];
                assert!((mean - albedo).abs() < 0.02, "{roughness} {cosine}: {mean} {albedo}");
            }
        }
    }

    #[test]
    fn the_sheen_lobe_is_reciprocal() {
        let lobe = SheenLobe::new(Vec3::ONE, 0.4, 0.5);
        let [a, b] = [Vec3::new(0.6, 0.8, 0.0), Vec3::new(0.1, 0.3, 0.9).normalize()];
        let [there, back] = [lobe.evaluate(Vec3::Y, a, b), lobe.evaluate(Vec3::Y, b, a)];
        assert!((there - back).abs().max_element() < 1e-5 * there.x);
    }

    #[test]
    fn light_from_below_is_not_reflected() {
        let lobe = SheenLobe::new(Vec3::ONE, 0.4, 0.5);
        assert_eq!(lobe.evaluate(Vec3::Y, Vec3::Y, -Vec3::Y), Vec3::ZERO);
    }
}
