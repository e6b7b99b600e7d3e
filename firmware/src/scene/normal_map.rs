//! Normal maps: textures of normals in the tangent space of the triangles (`MikkTSpace`).

use glam::Vec3;
use photoncard_shared::layout::{LayerTexture, Material, NO_TEXTURE};
use photoncard_shared::message::Fault;

use super::SceneImage;
use super::corners::Corners;
use super::materials::read_layers;
use super::texture::TexelChoice;
use crate::memory::MemoryPort;
use crate::vector::unit;

/// Unit shading normal of a material's base on the front side: from the normal map if there is one, else
/// interpolated between the corners. `None` stands for the geometric normal, `front_normal`. With a choice,
/// one texel of the normal map stands for those of the interpolation.
#[inline(always)]
pub(super) fn base_normal(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    material: &Material,
    (corners, choice): (&Corners, Option<TexelChoice>),
    front_normal: Vec3,
) -> Result<Option<Vec3>, Fault> {
    if material.layers.is_none() {
        return Ok(corners.normal());
    }
    let layers = read_layers(scene, memory, material)?;
    let map = (layers.texture(LayerTexture::Normal), layers.normal_scale);
    mapped_normal(scene, memory, map, (corners, choice), front_normal)
}

/// Unit shading normal on the front side from the normal map `texture`, whose x and y are multiplied by
/// `scale`. If the texture is [`NO_TEXTURE`], the normal is interpolated between the corners; `None` if they
/// have no normals.
#[inline(never)]
pub(super) fn mapped_normal(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    (texture, scale): (u16, f32),
    (corners, choice): (&Corners, Option<TexelChoice>),
    front_normal: Vec3,
) -> Result<Option<Vec3>, Fault> {
    if texture == NO_TEXTURE {
        return Ok(corners.normal());
    }
    let [x, y, z, _] = corners.texture_by(scene, memory, texture, choice)?.map(|channel| 2.0 * channel - 1.0);
    let [tangent, bitangent, normal] = corners.frame(scene, memory, front_normal)?;
    Ok(Some(unit(tangent * (x * scale) + bitangent * (y * scale) + normal * z)))
}
