//! Coverage of triangles by alpha. With glTF's `alphaMode` `MASK`, points whose alpha is below the material's
//! cutoff are cut out. With `BLEND`, a ray hits the surface with the probability alpha.

use glam::Vec3;
use photoncard_shared::layout::{
    BLENDS, DOUBLE_SIDED, HIDDEN, LAMP, Material, NO_INSTANCE, Reflectance, Triangle, TriangleId,
};
use photoncard_shared::message::Fault;

use super::corners::Corners;
use super::materials::read_material;
use super::{Ray, RayKind, SceneImage};
use crate::memory::MemoryPort;
use crate::sampler::{hash, unit_interval};

/// Returns true if a ray hits a triangle at the point with the barycentric coordinates `weights`; false if
/// the ray passes through a cut-out or a partly covered surface, or a surface that is not there for rays of
/// its kind ([`HIDDEN`], [`LAMP`]). Partial coverage is decided at random, by a hash of the ray and the
/// triangle. A one-sided `BLEND` surface other than glass is never hit from behind.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub(super) fn is_met(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    (id, triangle): (TriangleId, &Triangle),
    weights: [f32; 3],
) -> Result<bool, Fault> {
    let material = read_material(scene, memory, triangle.material)?;
    let is_lamp = material.flags & LAMP != 0;
    if is_lamp && (ray.kind == RayKind::Light || is_back(ray, triangle))
        || material.flags & HIDDEN != 0 && ray.kind == RayKind::Eye
    {
        return Ok(false);
    }
    // Glass always has two sides: a ray inside hits the back.
    let is_glass = matches!(material.reflectance, Reflectance::Glass { .. });
    if material.flags & (BLENDS | DOUBLE_SIDED) == BLENDS && !is_glass && is_back(ray, triangle) {
        return Ok(false);
    }
    let coverage = coverage(scene, memory, &material, id, weights)?;
    Ok(coverage >= 1.0 || chance(ray, id) < coverage)
}

fn is_back(ray: &Ray, triangle: &Triangle) -> bool {
    let [a, b, c] = triangle.vertices.map(Vec3::from_array);
    (b - a).cross(c - a).dot(ray.direction) > 0.0
}

/// Coverage of a triangle at the point with barycentric `weights`: 0 or 1 with cut-outs, alpha with
/// partial coverage.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub(super) fn coverage(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    material: &Material,
    id: TriangleId,
    weights: [f32; 3],
) -> Result<f32, Fault> {
    let Some(corners) = Corners::read(scene, memory, id, weights)? else { return Ok(1.0) };
    let [base, ..] = material.textures;
    let [.., texture] = corners.texture(scene, memory, base)?;
    let [.., colour] = corners.colour();
    Ok(covered(material, texture * colour))
}

/// Coverage of a material, 0 to 1, where base texture times vertex colour has the alpha `alpha`.
pub(super) fn covered(material: &Material, alpha: f32) -> f32 {
    if material.flags & BLENDS != 0 {
        alpha * material.cutoff
    } else if alpha >= material.cutoff {
        1.0
    } else {
        0.0
    }
}

/// Random number in [0, 1): a hash of a ray and a triangle.
fn chance(ray: &Ray, TriangleId { index, instance }: TriangleId) -> f32 {
    let [a, b, c] = ray.origin.to_array().map(f32::to_bits);
    let [d, e, f] = ray.direction.to_array().map(f32::to_bits);
    let key = [a, b, c, d, e, f].into_iter().fold(index, |key, bits| hash(key.wrapping_add(bits)));
    unit_interval(if instance == NO_INSTANCE { key } else { hash(key.wrapping_add(instance)) })
}
