//! Probabilities with which light samples choose emitters, the environment, and distant lights.

use glam::{DVec3, Vec3};
use photoncard_scene::Scene;
use photoncard_shared::layout::DistantLight;

use super::{EnvironmentMap, mean};

/// Probabilities of choosing the emitters, the environment, or the distant lights. Their sum is exactly 1, or
/// all are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shares {
    pub(super) emitters: f32,
    pub(super) environment: f32,
    pub(super) distant: f32,
}

/// Denominator of the shares. It is a power of two, so that their sums are exact in `f32`.
const PARTS: f64 = 65536.0;

impl Shares {
    /// Computes the shares `0.5 power / total + 0.5 / kinds`, where `kinds` is the number of kinds with any
    /// power. Half of the samples do not follow power, because lights that are strong for the whole scene may
    /// be hidden from most of what is visible.
    pub(super) fn new(powers: [f64; 3]) -> Self {
        let total: f64 = powers.iter().sum();
        let kinds = powers.iter().filter(|&&power| power > 0.0).count() as f64;
        let mut left = PARTS;
        let mut last = 0;
        let mut parts = [0.0; 3];
        for (index, power) in powers.into_iter().enumerate().filter(|(_, power)| *power > 0.0) {
            parts[index] = (PARTS * (0.5 * power / total + 0.5 / kinds)).floor();
            left -= parts[index];
            last = index;
        }
        if total > 0.0 {
            parts[last] += left;
        }
        let [emitters, environment, distant] = parts.map(|part| (part / PARTS) as f32);
        Self { emitters, environment, distant }
    }
}

/// Power that enters the scene's bounding box from emitters, from the environment and from distant lights,
/// watts.
pub(super) fn powers(
    scene: &Scene,
    emitters: f64,
    environment: Option<&EnvironmentMap>,
    distant: &[DistantLight],
) -> [f64; 3] {
    let (lower, upper) = scene.bounds();
    let size = (upper - lower).as_dvec3();
    // Cauchy: the mean projected area of a convex body is a quarter of its surface.
    let surface = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let environment = environment.map_or(0.0, |map| map.fluence * 0.25 * surface);
    let distant = distant.iter().map(|light| {
        mean(Vec3::from(light.irradiance)) * projected_area(size, Vec3::from(light.direction).as_dvec3())
    });
    [emitters, environment, distant.sum()]
}

/// Projected area of a box of size `size` along a direction, m^2.
pub(super) fn projected_area(size: DVec3, direction: DVec3) -> f64 {
    let DVec3 { x, y, z } = direction.abs();
    x * size.y * size.z + y * size.z * size.x + z * size.x * size.y
}

/// Mean of [`projected_area`] over all directions, m^2.
#[cfg(test)]
fn mean_projected_area(size: DVec3) -> f64 {
    0.5 * (size.y * size.z + size.z * size.x + size.x * size.y)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn shares_sum_to_one_and_follow_power_by_half() {
        for powers in [[1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.1, 0.2, 7.0], [0.0, 1e-30, 1.0]] {
            let Shares { emitters, environment, distant } = Shares::new(powers);
            assert_eq!(emitters + environment + distant, 1.0, "{powers:?}");
        }
        let shares = Shares::new([0.0, 1.0, 3.0]);
        assert_eq!((shares.emitters, shares.environment, shares.distant), (0.0, 0.375, 0.625));
        let none = Shares::new([0.0; 3]);
        assert_eq!((none.emitters, none.environment, none.distant), (0.0, 0.0, 0.0));
    }

    #[test]
    fn the_mean_projected_area_of_a_box_is_a_quarter_of_its_surface() {
        let size = DVec3::new(1.0, 2.0, 3.0);
        let mut sum = 0.0;
        for i in 0..200 {
            for j in 0..200 {
                let cosine = (f64::from(i) + 0.5) / 100.0 - 1.0;
                let (sin, cos) = libm::sincos((f64::from(j) + 0.5) / 100.0 * PI);
                let sine = (1.0 - cosine * cosine).sqrt();
                sum += projected_area(size, DVec3::new(sine * cos, sine * sin, cosine)) / 40_000.0;
            }
        }
        assert!((sum / mean_projected_area(size) - 1.0).abs() < 1e-3, "{sum}");
    }
}
