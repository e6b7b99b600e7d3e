//! Converts specular-glossiness to metallic-roughness by the formula of the extension's examples.

use glam::Vec3;

/// F0 of a dielectric with the index of refraction 1.5.
const DIELECTRIC: f32 = 0.04;

const EPSILON: f32 = 1e-6;

/// Weights of red, green and blue in the perceived brightness, `sqrt(sum of weight * channel^2)`.
const WEIGHTS: Vec3 = Vec3::new(0.299, 0.587, 0.114);

/// Linear values of the specular-glossiness model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Appearance {
    pub(super) diffuse: Vec3,
    pub(super) specular: Vec3,
    pub(super) glossiness: f32,
}

/// Linear values of the metallic-roughness model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Converted {
    pub(super) base: Vec3,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
}

fn brightness(colour: Vec3) -> f32 {
    libm::sqrtf(WEIGHTS.dot(colour * colour))
}

/// Metalness of a metallic-roughness material whose diffuse and specular colours have these brightnesses.
/// `one_minus_strength` is 1 minus the greatest channel of the specular colour.
fn solve_metallic(diffuse: f32, specular: f32, one_minus_strength: f32) -> f32 {
    // At F0 itself, the most common value, rounding would decide whether dark texels are metal.
    if specular <= DIELECTRIC + EPSILON {
        return 0.0;
    }
    let b = diffuse * one_minus_strength / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let discriminant = (b * b - 4.0 * DIELECTRIC * c).max(0.0);
    ((libm::sqrtf(discriminant) - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

impl Appearance {
    pub(super) fn converted(&self) -> Converted {
        let Self { diffuse, specular, glossiness } = *self;
        let one_minus_strength = 1.0 - specular.max_element();
        let metallic = solve_metallic(brightness(diffuse), brightness(specular), one_minus_strength);
        let of_diffuse = diffuse * (one_minus_strength / (1.0 - DIELECTRIC) / (1.0 - metallic).max(EPSILON));
        let of_specular = (specular - Vec3::splat(DIELECTRIC * (1.0 - metallic))) / metallic.max(EPSILON);
        let base = of_diffuse + (of_specular - of_diffuse) * (metallic * metallic);
        Converted { base: base.clamp(Vec3::ZERO, Vec3::ONE), metallic, roughness: 1.0 - glossiness }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Converts metallic-roughness to specular-glossiness, by the examples of the extension.
    fn backwards(base: Vec3, metallic: f32, roughness: f32) -> Appearance {
        let specular = Vec3::splat(DIELECTRIC).lerp(base, metallic);
        let strength = 1.0 - specular.max_element();
        let diffuse = base * ((1.0 - DIELECTRIC) * (1.0 - metallic) / strength.max(EPSILON));
        Appearance { diffuse, specular, glossiness: 1.0 - roughness }
    }

    /// Tests metals and dielectrics alone, because the formula is approximate between them.
    #[test]
    fn metals_and_dielectrics_survive_conversion_both_ways() {
        for base in [Vec3::new(0.9, 0.6, 0.2), Vec3::splat(0.5), Vec3::new(0.1, 0.3, 0.8)] {
            for metallic in [0.0, 1.0] {
                let back = backwards(base, metallic, 0.3).converted();
                assert!(back.base.distance(base) < 1e-3, "{base}, {metallic}: {back:?}");
                assert!((back.metallic - metallic).abs() < 1e-3, "{base}, {metallic}: {back:?}");
                assert!((back.roughness - 0.3).abs() < 1e-6);
            }
        }
        let grey = backwards(Vec3::splat(0.5), 0.5, 0.3).converted();
        assert!(
            (grey.metallic - 0.5).abs() < 0.02 && grey.base.distance(Vec3::splat(0.5)) < 0.02,
            "{grey:?}"
        );
    }

    /// Tests F0 up to 1, at which no light is left for the diffuse part.
    #[test]
    fn white_reflection_at_all_angles_stays_in_range() {
        for diffuse in [0.0, 1.0] {
            for specular in [0.0, DIELECTRIC, 1.0] {
                let white = Vec3::ONE;
                let appearance =
                    Appearance { diffuse: white * diffuse, specular: white * specular, glossiness: 1.0 };
                let Converted { base, metallic, roughness } = appearance.converted();
                let in_range = |value: f32| (0.0..=1.0).contains(&value);
                assert!(base.to_array().into_iter().all(in_range), "{appearance:?}: {base}");
                assert!(in_range(metallic) && roughness == 0.0, "{appearance:?}: {metallic}");
            }
        }
    }
}
