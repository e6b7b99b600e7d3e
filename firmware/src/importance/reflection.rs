//! The reflection function's own sampling, for the paths of photons.
//!
//! A point of the unit square becomes a direction. The map keeps neighbours together, so that a stratified pattern
//! stays stratified on the hemisphere. A surface with a Phong lobe is sampled by a mixture of both parts, and the
//! density of the mixture is used for either (the balance heuristic: Veach, Guibas 1995), which bounds the weight by
//! the sum of the albedos: no fireflies.

use core::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use crate::scene::{Reflection, Surface, mirror};
use crate::vector::{from_frame, max, max_component};

/// A direction that is reflected to, and how much is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectedDirection {
    /// Unit vector away from the surface.
    pub direction: Vec3,
    /// `f cos(theta) / p`, without unit: what arrived is multiplied with it.
    pub weight: Vec3,
}

/// The direction that belongs to a point of the unit square; `None` below the surface, where the weight is zero.
pub fn sample_reflection(surface: &Surface, [u, v]: [f32; 2]) -> Option<ReflectedDirection> {
    let reflection = &surface.reflection;
    let diffuse_share = diffuse_share(reflection);
    if diffuse_share >= 1.0 {
        let direction = cosine_direction(surface.normal, [u, v]);
        return Some(ReflectedDirection { direction, weight: reflection.diffuse });
    }
    let mirror = mirror(surface.outgoing, surface.normal);
    let direction = if v < diffuse_share {
        cosine_direction(surface.normal, [u, v / diffuse_share])
    } else {
        let v = (v - diffuse_share) / (1.0 - diffuse_share);
        lobe_direction(mirror, reflection.exponent, [u, v])
    };
    let cosine = surface.normal.dot(direction);
    if cosine <= 0.0 {
        return None;
    }
    let power = lobe_power(reflection, mirror, direction);
    let density = mixture_density(reflection, diffuse_share, cosine, power);
    let lobe = reflection.specular * ((reflection.exponent + 2.0) * 0.5 * FRAC_1_PI * power);
    let weight = (reflection.lambertian() + lobe) * (cosine / density);
    (density > 0.0).then_some(ReflectedDirection { direction, weight })
}

/// `max(0, cos alpha)^n`.
#[inline(always)]
fn lobe_power(reflection: &Reflection, mirror: Vec3, direction: Vec3) -> f32 {
    crate::scene::lobe_power(mirror.dot(direction), reflection.exponent)
}

#[inline(always)]
fn mixture_density(reflection: &Reflection, diffuse_share: f32, cosine: f32, lobe_power: f32) -> f32 {
    let lobe_density = (reflection.exponent + 1.0) * 0.5 * FRAC_1_PI * lobe_power;
    diffuse_share * cosine * FRAC_1_PI + (1.0 - diffuse_share) * lobe_density
}

/// The share of rays for the Lambertian part.
#[inline(always)]
fn diffuse_share(reflection: &Reflection) -> f32 {
    let [diffuse, specular] = [max_component(reflection.diffuse), max_component(reflection.specular)];
    if specular <= 0.0 { 1.0 } else { diffuse / (diffuse + specular) }
}

/// A direction of density `cos(theta) / pi`: the square on the disc (Shirley, Chiu 1997), the disc lifted to the
/// hemisphere.
#[inline(always)]
fn cosine_direction(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let [a, b] = [2.0 * u - 1.0, 2.0 * v - 1.0];
    if a == 0.0 && b == 0.0 {
        return normal;
    }
    let (radius, angle) =
        if a * a > b * b { (a, (PI / 4.0) * (b / a)) } else { (b, (PI / 2.0) - (PI / 4.0) * (a / b)) };
    let (x, y) = (radius * libm::cosf(angle), radius * libm::sinf(angle));
    from_frame(normal, x, y, libm::sqrtf(max(1.0 - x * x - y * y, 0.0)))
}

/// A direction of density `(n + 1) / (2 pi) cos(alpha)^n` about an axis.
#[inline(always)]
pub(super) fn lobe_direction(axis: Vec3, exponent: f32, [u, v]: [f32; 2]) -> Vec3 {
    let cosine = libm::powf(1.0 - v, 1.0 / (exponent + 1.0));
    let sine = libm::sqrtf(max(1.0 - cosine * cosine, 0.0));
    let angle = 2.0 * PI * u;
    from_frame(axis, sine * libm::cosf(angle), sine * libm::sinf(angle), cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(diffuse: f32, specular: f32, exponent: f32, outgoing: Vec3) -> Surface {
        Surface {
            outgoing: outgoing.normalize(),
            reflection: Reflection {
                diffuse: Vec3::splat(diffuse),
                specular: Vec3::splat(specular),
                exponent,
            },
            ..Surface::white(Vec3::ZERO, Vec3::Y, 0.0)
        }
    }

    fn mean_weight(surface: &Surface, side: u32) -> f32 {
        let points = (0..side * side).map(|i| {
            let [i, j] = [i % side, i / side];
            [(i as f32 + 0.5) / side as f32, (j as f32 + 0.5) / side as f32]
        });
        points.filter_map(|p| sample_reflection(surface, p)).map(|d| d.weight.x as f64).sum::<f64>() as f32
            / (side * side) as f32
    }

    #[test]
    fn the_mean_weight_of_a_lambertian_surface_is_its_albedo() {
        let mean = mean_weight(&surface(0.7, 0.0, 0.0, Vec3::new(1.0, 1.0, 0.0)), 10);
        assert!((mean - 0.7).abs() < 1e-5, "{mean}");
    }

    #[test]
    fn the_mean_weight_at_normal_incidence_is_the_sum_of_the_albedos() {
        // The integral of (n + 2) / (2 pi) cos^n cos is 1 where the lobe's axis is the normal.
        for exponent in [1.0, 8.0, 32.0, 128.0, 1000.0] {
            let mean = mean_weight(&surface(0.4, 0.35, exponent, Vec3::Y), 200);
            assert!((mean - 0.75).abs() < 2e-3, "{exponent}: {mean}");
        }
    }

    #[test]
    fn the_mean_weight_is_the_integral_of_the_reflection() {
        let surface = surface(0.2, 0.5, 20.0, Vec3::new(2.0, 1.0, 0.5));
        let side = 1000;
        let mut integral = 0.0_f64;
        for i in 0..side {
            for j in 0..side {
                let [u, v] = [(i as f32 + 0.5) / side as f32, (j as f32 + 0.5) / side as f32];
                let direction = cosine_direction(Vec3::Y, [u, v]);
                let f = surface.reflection.evaluate(surface.normal, surface.outgoing, direction);
                integral += (f.x * PI) as f64 / (side * side) as f64;
            }
        }
        let mean = mean_weight(&surface, 400);
        assert!((mean as f64 - integral).abs() < 1e-3, "{mean} {integral}");
    }

    #[test]
    fn no_weight_is_above_the_bound() {
        let surface = surface(0.3, 0.6, 500.0, Vec3::new(5.0, 0.4, 0.0));
        for i in 0..10_000 {
            let point = [(i % 100) as f32 / 100.0, (i / 100) as f32 / 100.0];
            if let Some(direction) = sample_reflection(&surface, point) {
                assert!(direction.weight.x <= 0.9 * 2.0, "{direction:?}");
                assert!((direction.direction.length() - 1.0).abs() < 1e-4);
            }
        }
    }
}
