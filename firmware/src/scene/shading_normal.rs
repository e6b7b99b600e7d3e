//! Corrects interpolated or mapped shading normals that point away from the viewer, or whose mirror direction
//! lies below the triangle. Surfaces would be black there otherwise.

use glam::Vec3;

use crate::vector::{max, min, mirror, sqrt, unit};

/// Minimum cosine between a shading normal and the direction to the viewer.
const MIN_COSINE: f32 = 0.01;

/// Returns true if a shading normal's cosine to the viewer is below `MIN_COSINE`: it must be [`turned`].
pub(super) fn points_away(normal: Vec3, outgoing: Vec3) -> bool {
    normal.dot(outgoing) < MIN_COSINE
}

/// Turns a shading normal towards the viewer if it points away, as happens at silhouettes.
pub(super) fn turned(normal: Vec3, outgoing: Vec3, geometric_normal: Vec3) -> Vec3 {
    if normal == geometric_normal {
        return normal;
    }
    let cosine = normal.dot(outgoing);
    let turned = if cosine < MIN_COSINE { normal + outgoing * (MIN_COSINE - cosine) } else { normal };
    let turned = unit(turned);
    // The geometric normal replaces a zero vector, or a normal still on the far side of the triangle.
    if turned.dot(geometric_normal) > 0.0 { turned } else { geometric_normal }
}

/// Interpolates between a shading normal (`share` 0) and its [`bent`] normal (`share` 1). `share` is the
/// lobe's fraction of the albedo: the lobe needs the bent normal, and the Lambertian part the normal itself.
#[inline(always)]
pub(super) fn bent_by_share(normal: Vec3, share: f32, outgoing: Vec3, geometric_normal: Vec3) -> Vec3 {
    if share <= 0.0 || normal == geometric_normal {
        return normal;
    }
    let bent = bent(normal, outgoing, geometric_normal);
    if bent == normal { normal } else { unit(normal + (bent - normal) * min(share, 1.0)) }
}

/// Bends a unit shading normal towards the triangle's normal `g` until the mirror direction `m` of `outgoing`
/// lies above the triangle: `g.m >= min(0.01, 0.9 g.outgoing)`. `outgoing` must lie above the triangle.
///
/// Let `r (sin b, cos b)` be the projection of `outgoing` onto the plane of the two normals, at the angle `b`
/// from the triangle's normal. A shading normal at the angle `a` from the triangle's normal gives the mirror
/// direction the cosine `r cos(2 a - b)`.
pub(super) fn bent(normal: Vec3, outgoing: Vec3, geometric_normal: Vec3) -> Vec3 {
    let height = geometric_normal.dot(outgoing);
    let least = min(0.9 * height, MIN_COSINE);
    if mirror(outgoing, normal).dot(geometric_normal) >= least {
        return normal;
    }
    let aside = unit(normal - geometric_normal * geometric_normal.dot(normal));
    let along = aside.dot(outgoing);
    let radius = sqrt(along * along + height * height);
    let cosine = min(least / radius, 1.0);
    let sine = sqrt(1.0 - cosine * cosine);
    let twice = (height * cosine - along * sine) / radius;
    let [x, z] = [1.0 - twice, 1.0 + twice].map(|square| sqrt(max(0.5 * square, 0.0)));
    aside * x + geometric_normal * z
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(degrees: f32, azimuth: f32) -> Vec3 {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let (y, x) = azimuth.to_radians().sin_cos();
        Vec3::new(sine * x, sine * y, cosine)
    }

    #[test]
    fn mirror_directions_lie_above_the_triangle() {
        for view in [0.0, 20.0, 60.0, 85.0, 89.9] {
            for tilt in [0.0, 1.0, 10.0, 40.0, 70.0, 89.0] {
                for azimuth in [0.0, 50.0, 90.0, 140.0, 180.0] {
                    let (outgoing, normal) = (at(view, 0.0), at(tilt, azimuth));
                    let normal = turned(normal, outgoing, Vec3::Z);
                    let bent = bent(normal, outgoing, Vec3::Z);
                    assert!((bent.length() - 1.0).abs() < 1e-5, "{view} {tilt} {azimuth}: {bent}");
                    let least = (0.9 * outgoing.z).min(0.01);
                    let height = mirror(outgoing, bent).z;
                    assert!(height > least - 1e-5, "{view} {tilt} {azimuth}: {height}");
                    assert!(bent.dot(outgoing) > 0.0 && bent.z >= normal.z - 1e-6, "{view} {tilt} {azimuth}");
                    // No further than needed.
                    assert!(bent == normal || height < least + 1e-4, "{view} {tilt} {azimuth}: {height}");
                }
            }
        }
    }

    #[test]
    fn a_share_of_the_lobe_bends_the_normal_partly() {
        let (outgoing, normal) = (at(60.0, 0.0), at(40.0, 180.0));
        let by = |share: f32| bent_by_share(normal, share, outgoing, Vec3::Z).z;
        assert_eq!(by(0.0), normal.z);
        assert!((by(1.0) - bent(normal, outgoing, Vec3::Z).z).abs() < 1e-6);
        assert!(by(0.0) < by(0.3) && by(0.3) < by(0.7) && by(0.7) < by(1.0));
    }
}
