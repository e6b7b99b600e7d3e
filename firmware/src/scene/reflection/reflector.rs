//! Evaluation and sampling of a reflection for one outgoing direction.
//!
//! Sampling maps a point of the unit square to a direction, and neighbouring points to neighbouring
//! directions. Stratified points therefore give stratified directions. The Lambertian part and the lobe are
//! sampled in proportion to their albedos. Each sample is weighted by the density of the mixture (balance
//! heuristic: Veach, Guibas 1995), which bounds the weight and avoids fireflies.
//!
//! If the shading normal `n` differs from the triangle's normal `g`, the part of the lobe below the triangle
//! is mirrored in the triangle, so that no light is lost. With `i' = i - 2 (g.i) g`, the lobe's value for `i`
//! above the triangle is `f(i) + f(i') max(0, n.i') / n.i`, and the density is `p(i) + p(i')`.
//!
//! Light from `i` thus reaches the eye with the factor `f(i) n.i + f(i') max(0, n.i')`. A photon from `i` is
//! therefore treated as two photons, one from `i` and one from `i'`, each reflected by the lobe about `n`.
//! One of the two is chosen at random and followed with twice the weight.

use core::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use super::Reflection;
use super::ggx::Geometry;
use super::lobe::Lobe;
use super::phong::PhongLobe;
use super::sheen::SheenLobe;
use crate::vector::{from_frame, max, max_component, mirror, sqrt};

/// Sampled direction, and the weight of the sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectedDirection {
    /// Unit vector away from the surface.
    pub direction: Vec3,
    /// Weight `f cos(theta) / p` of the sample, dimensionless.
    pub weight: Vec3,
}

/// Reflection at a point towards one outgoing direction.
#[derive(Clone, Copy, Debug)]
pub struct Reflector {
    /// Unit shading normal on the side of `outgoing`.
    pub normal: Vec3,
    /// Unit normal of the triangle on the side of `outgoing`.
    pub geometric_normal: Vec3,
    /// Unit vector away from the surface, towards the eye. For `Self::sample_photon`, the direction from
    /// which the photon arrives.
    pub outgoing: Vec3,
    /// Reflection at the point.
    pub reflection: Reflection,
}

impl Reflector {
    /// BRDF `f`, 1/sr, for light from the unit vector `incident`, which must be above triangle and shading
    /// horizon.
    #[inline(always)]
    pub fn evaluate(&self, incident: Vec3) -> Vec3 {
        if self.reflection.is_lambertian() {
            return self.lambertian();
        }
        let mut value = self.lobe_value(incident);
        if let Some((below, share)) = self.mirrored_part(incident) {
            value += self.lobe_value(below) * share;
        }
        self.lambertian() + value
    }

    /// `f` of the lobe about the shading normal, 1/sr, without the mirrored part (see the module).
    #[inline(always)]
    fn lobe_value(&self, incident: Vec3) -> Vec3 {
        match &self.reflection.lobe {
            Lobe::Phong(lobe) => lobe.evaluate(self.phong_power(lobe, incident)),
            Lobe::Ggx(lobe) => lobe.evaluate(&self.geometry(incident)),
            Lobe::Sheen(lobe) => lobe.evaluate(self.normal, self.outgoing, incident),
        }
    }

    /// Returns `i'` and `n.i' / n.i`, 0 to 1, where `i` is `direction` and `i'` is its mirror image below the
    /// triangle; `None` if no part of the lobe is mirrored from `i'` to `i`.
    #[inline(always)]
    fn mirrored_part(&self, direction: Vec3) -> Option<(Vec3, f32)> {
        if self.normal == self.geometric_normal {
            return None;
        }
        let below = -mirror(direction, self.geometric_normal);
        let [cosine, cosine_below] = [direction, below].map(|direction| self.normal.dot(direction));
        (cosine_below > 0.0 && cosine > cosine_below).then(|| (below, cosine_below / cosine))
    }

    /// Mirrors a direction in the triangle if it lies below the triangle but above the shading horizon;
    /// otherwise returns it unchanged.
    #[inline(always)]
    fn raised(&self, direction: Vec3) -> Vec3 {
        let is_below = self.normal != self.geometric_normal
            && self.geometric_normal.dot(direction) < 0.0
            && self.normal.dot(direction) > 0.0;
        if is_below { -mirror(direction, self.geometric_normal) } else { direction }
    }

    /// Lambertian part of `f`, 1/sr.
    #[inline(always)]
    pub fn lambertian(&self) -> Vec3 {
        self.reflection.diffuse * FRAC_1_PI
    }

    /// Lambertian albedo, 0 to 1. Multiplied by irradiance over pi, it gives the reflected radiance.
    #[inline(always)]
    pub fn lambertian_albedo(&self) -> Vec3 {
        self.reflection.diffuse
    }

    /// Sum of the albedos of Lambertian part and lobe, 0 to 1.
    #[inline(always)]
    pub fn albedo(&self) -> Vec3 {
        self.reflection.diffuse + self.reflection.lobe.albedo()
    }

    /// Maximum channels of two albedos: `[Lambertian part, lobe]`.
    #[inline(always)]
    pub fn albedos(&self) -> [f32; 2] {
        [max_component(self.reflection.diffuse), max_component(self.reflection.lobe.albedo())]
    }

    /// The Lambertian part's fraction of the sum of [`Self::albedos`]; 1 without a lobe.
    #[inline(always)]
    pub fn diffuse_share(&self) -> f32 {
        let [diffuse, lobe] = self.albedos();
        if lobe <= 0.0 { 1.0 } else { diffuse / (diffuse + lobe) }
    }

    /// The lobe's fraction of the sum of [`Self::albedos`]; 0 without a lobe.
    #[inline(always)]
    pub fn lobe_share(&self) -> f32 {
        let [diffuse, lobe] = self.albedos();
        if lobe > 0.0 { lobe / (diffuse + lobe) } else { 0.0 }
    }

    /// Exponent `n` of the Phong lobe `cos^n alpha` that is as wide as this lobe. It is `1 / (2 a^2)` for a
    /// GGX lobe (Walter et al. 2007), and 0 for a sheen lobe.
    #[inline(always)]
    pub fn lobe_sharpness(&self) -> f32 {
        match &self.reflection.lobe {
            Lobe::Phong(lobe) => lobe.exponent,
            Lobe::Ggx(lobe) => 0.5 / (lobe.alpha() * lobe.alpha()),
            Lobe::Sheen(_) => 0.0,
        }
    }

    /// Maps a point of the unit square to a direction of the lobe, with the density [`Self::lobe_density`].
    #[inline(always)]
    pub fn sample_lobe(&self, point: [f32; 2]) -> Vec3 {
        self.raised(self.lobe_direction(point))
    }

    /// Samples the lobe alone by a point of the unit square. The weight is the lobe's `f cos(theta) / p`. If
    /// the sampled direction lies below the shading horizon, the weight is zero and the direction is
    /// meaningless.
    pub fn sample_lobe_alone(&self, point: [f32; 2]) -> ReflectedDirection {
        let direction = self.lobe_direction(point);
        ReflectedDirection { direction: self.raised(direction), weight: self.lobe_weight(direction) }
    }

    /// Samples the lobe alone for a photon that arrives from `outgoing`: the adjoint of
    /// [`Self::sample_lobe_alone`]. Also returns the direction `i` or `i'` from which the photon is assumed
    /// to come (see the module): `outgoing`, or its mirror image below the triangle.
    pub fn sample_photon(&self, [u, v]: [f32; 2]) -> (Vec3, ReflectedDirection) {
        let below = -mirror(self.outgoing, self.geometric_normal);
        let is_of_two = self.normal != self.geometric_normal && self.normal.dot(below) > 0.0;
        let [v, of_two] = if is_of_two { [2.0 * v, 2.0] } else { [v, 1.0] };
        let (from, v) = if v < 1.0 { (self.outgoing, v) } else { (below, v - 1.0) };
        let lobe = Self { outgoing: from, ..*self };
        let direction = lobe.lobe_direction([u, v]);
        (from, ReflectedDirection { direction, weight: lobe.lobe_weight(direction) * of_two })
    }

    /// Maps a point of the unit square to a direction of the lobe about the shading normal. The direction may
    /// lie below the triangle.
    #[inline(always)]
    fn lobe_direction(&self, point: [f32; 2]) -> Vec3 {
        match &self.reflection.lobe {
            Lobe::Phong(lobe) => lobe.direction(mirror(self.outgoing, self.normal), point),
            Lobe::Ggx(lobe) => lobe.direction(self.normal, self.outgoing, point),
            Lobe::Sheen(_) => SheenLobe::direction(self.normal, point),
        }
    }

    /// Weight `f cos(theta) / p`, dimensionless, of a direction sampled by [`Self::lobe_direction`]; zero
    /// below the shading horizon.
    fn lobe_weight(&self, direction: Vec3) -> Vec3 {
        match &self.reflection.lobe {
            Lobe::Phong(lobe) => lobe.albedo * (lobe.gain() * max(self.normal.dot(direction), 0.0)),
            Lobe::Ggx(lobe) => lobe.weight(&self.geometry(direction)),
            Lobe::Sheen(lobe) => {
                let cosine = max(self.normal.dot(direction), 0.0);
                lobe.evaluate(self.normal, self.outgoing, direction) * (cosine / lobe.density())
            }
        }
    }

    /// Ratio `f / (albedo p)`, dimensionless, of the lobe about the shading normal, without the mirrored part
    /// (see the module). `direction` must lie above the surface.
    #[inline(always)]
    pub fn lobe_gain(&self, direction: Vec3) -> f32 {
        match &self.reflection.lobe {
            Lobe::Phong(lobe) => lobe.gain(),
            Lobe::Ggx(lobe) => lobe.gain(&self.geometry(direction)),
            Lobe::Sheen(lobe) => lobe.gain(self.normal, self.outgoing, direction),
        }
    }

    /// Probability density, 1/sr, of [`Self::sample_lobe`] at a direction above the triangle; 0 without a
    /// lobe.
    #[inline(always)]
    pub fn lobe_density(&self, direction: Vec3) -> f32 {
        let density = self.lobe_direction_density(direction);
        match self.mirrored_part(direction) {
            Some((below, _)) => density + self.lobe_direction_density(below),
            None => density,
        }
    }

    #[inline(always)]
    fn lobe_direction_density(&self, direction: Vec3) -> f32 {
        match &self.reflection.lobe {
            Lobe::Phong(lobe) => lobe.density(self.phong_power_or_zero(lobe, direction)),
            Lobe::Ggx(lobe) => lobe.density(&self.geometry(direction)),
            Lobe::Sheen(lobe) => lobe.density(),
        }
    }

    /// BRDF `f` and [`Self::lobe_density`] at a sampled direction, both 1/sr. Computing them together is
    /// cheaper.
    #[inline(always)]
    pub fn sampled(&self, direction: Vec3) -> (Vec3, f32) {
        let (mut value, mut density) = self.lobe_sampled(direction);
        if let Some((below, share)) = self.mirrored_part(direction) {
            let (value_below, density_below) = self.lobe_sampled(below);
            value += value_below * share;
            density += density_below;
        }
        (self.lambertian() + value, density)
    }

    /// `f` of the lobe about the shading normal, and the density of [`Self::lobe_direction`], both 1/sr.
    #[inline(always)]
    fn lobe_sampled(&self, direction: Vec3) -> (Vec3, f32) {
        match &self.reflection.lobe {
            Lobe::Phong(lobe) => {
                let power = self.phong_power_or_zero(lobe, direction);
                (lobe.evaluate(power), lobe.density(power))
            }
            Lobe::Ggx(lobe) => {
                let geometry = self.geometry(direction);
                (lobe.evaluate(&geometry), lobe.density(&geometry))
            }
            Lobe::Sheen(lobe) => (lobe.evaluate(self.normal, self.outgoing, direction), lobe.density()),
        }
    }

    /// Samples the sum of Lambertian part and lobe by a point of the unit square. Returns `None` if the
    /// sampled direction lies below the shading horizon, where the weight is zero.
    pub fn sample(&self, [u, v]: [f32; 2]) -> Option<ReflectedDirection> {
        let Self { normal, reflection, .. } = *self;
        let diffuse_share = self.diffuse_share();
        if diffuse_share >= 1.0 {
            let direction = cosine_direction(normal, [u, v]);
            return Some(ReflectedDirection { direction, weight: reflection.diffuse });
        }
        let direction = if v < diffuse_share {
            cosine_direction(normal, [u, v / diffuse_share])
        } else {
            self.sample_lobe([u, (v - diffuse_share) / (1.0 - diffuse_share)])
        };
        let cosine = normal.dot(direction);
        if cosine <= 0.0 {
            return None;
        }
        let (value, lobe_density) = self.sampled(direction);
        let density = diffuse_share * cosine * FRAC_1_PI + (1.0 - diffuse_share) * lobe_density;
        let weight = value * (cosine / density);
        (density > 0.0).then_some(ReflectedDirection { direction, weight })
    }

    #[inline(always)]
    fn geometry(&self, incident: Vec3) -> Geometry {
        Geometry::new(self.normal, self.outgoing, incident)
    }

    #[inline(always)]
    fn phong_power(&self, lobe: &PhongLobe, direction: Vec3) -> f32 {
        lobe.power(mirror(self.outgoing, self.normal), direction)
    }

    #[inline(always)]
    fn phong_power_or_zero(&self, lobe: &PhongLobe, direction: Vec3) -> f32 {
        if lobe.reflects() { self.phong_power(lobe, direction) } else { 0.0 }
    }
}

/// Maps a point of the unit square to a direction with density `cos(theta) / pi`. The square is mapped to the
/// unit disc (Shirley, Chiu 1997), and the disc is projected onto the hemisphere.
#[inline(always)]
fn cosine_direction(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let [a, b] = [2.0 * u - 1.0, 2.0 * v - 1.0];
    if a == 0.0 && b == 0.0 {
        return normal;
    }
    let (radius, angle) =
        if a * a > b * b { (a, (PI / 4.0) * (b / a)) } else { (b, (PI / 2.0) - (PI / 4.0) * (a / b)) };
    let (sine, cosine) = libm::sincosf(angle);
    let (x, y) = (radius * cosine, radius * sine);
    from_frame(normal, x, y, sqrt(max(1.0 - x * x - y * y, 0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reflector(diffuse: f32, specular: f32, exponent: f32, outgoing: Vec3) -> Reflector {
        let reflection = Reflection::phong(Vec3::splat(diffuse), Vec3::splat(specular), exponent);
        Reflector { normal: Vec3::Y, geometric_normal: Vec3::Y, outgoing: outgoing.normalize(), reflection }
    }

    fn mean_weight(reflector: &Reflector, side: u32) -> f32 {
        let points = (0..side * side).map(|i| {
            let [i, j] = [i % side, i / side];
            [(i as f32 + 0.5) / side as f32, (j as f32 + 0.5) / side as f32]
        });
        points.filter_map(|p| reflector.sample(p)).map(|d| d.weight.x as f64).sum::<f64>() as f32
            / (side * side) as f32
    }

    #[test]
    fn the_mean_weight_of_a_lambertian_surface_is_its_albedo() {
        let mean = mean_weight(&reflector(0.7, 0.0, 0.0, Vec3::new(1.0, 1.0, 0.0)), 10);
        assert!((mean - 0.7).abs() < 1e-5, "{mean}");
    }

    #[test]
    fn the_mean_weight_at_normal_incidence_is_the_sum_of_the_albedos() {
        // The integral of (n + 2) / (2 pi) cos^n cos is 1 where the lobe's axis is the normal.
        for exponent in [1.0, 8.0, 32.0, 128.0, 1000.0] {
            let mean = mean_weight(&reflector(0.4, 0.35, exponent, Vec3::Y), 200);
            assert!((mean - 0.75).abs() < 2e-3, "{exponent}: {mean}");
        }
    }

    #[test]
    fn the_mean_weight_is_the_integral_of_the_reflection() {
        let reflector = reflector(0.2, 0.5, 20.0, Vec3::new(2.0, 1.0, 0.5));
        let side = 1000;
        let mut integral = 0.0_f64;
        for i in 0..side {
            for j in 0..side {
                let [u, v] = [(i as f32 + 0.5) / side as f32, (j as f32 + 0.5) / side as f32];
                let direction = cosine_direction(Vec3::Y, [u, v]);
                let f = reflector.evaluate(direction);
                integral += (f.x * PI) as f64 / (side * side) as f64;
            }
        }
        let mean = mean_weight(&reflector, 400);
        assert!((mean as f64 - integral).abs() < 1e-3, "{mean} {integral}");
    }

    #[test]
    fn no_weight_is_above_the_bound() {
        let reflector = reflector(0.3, 0.6, 500.0, Vec3::new(5.0, 0.4, 0.0));
        for i in 0..10_000 {
            let point = [(i % 100) as f32 / 100.0, (i / 100) as f32 / 100.0];
            if let Some(direction) = reflector.sample(point) {
                assert!(direction.weight.x <= 0.9 * 2.0, "{direction:?}");
                assert!((direction.direction.length() - 1.0).abs() < 1e-4);
            }
        }
    }
}
