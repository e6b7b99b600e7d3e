//! Materials and their layers, read from card memory.

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{LayerTexture, Layers, Material, Record, Reflectance};
use photoncard_shared::message::Fault;

use super::SceneImage;
use super::corners::Corners;
use super::reflection::LayerTexel;
use crate::memory::MemoryPort;

const MATERIALS_PER_LINE: u32 = Material::PER_LINE as u32;
const LAYERS_PER_LINE: u32 = Layers::PER_LINE as u32;

#[inline(always)]
pub(super) fn read_material(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    index: u32,
) -> Result<Material, Fault> {
    let kind = SectionKind::Materials;
    let bytes = scene.record::<{ Material::BYTES }, MATERIALS_PER_LINE>(memory, kind, index)?;
    Ok(Material::read(bytes))
}

/// Returns true if a material has [`Layers`] or is rough glass.
#[inline(always)]
pub(super) fn has_layers(material: &Material) -> bool {
    material.layers.is_some()
        || matches!(material.reflectance, Reflectance::Glass { roughness, .. } if roughness > 0.0)
}

pub(super) fn read_layers(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    material: &Material,
) -> Result<Layers, Fault> {
    let Some(index) = material.layers else { return Ok(Layers::NONE) };
    let bytes = scene.record::<{ Layers::BYTES }, LAYERS_PER_LINE>(memory, SectionKind::Layers, index)?;
    Ok(Layers::read(bytes))
}

/// Samples all textures of a material's layers at a point; all values are 1 without vertex attributes.
pub(super) fn layer_texel(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    corners: Option<&Corners>,
    layers: &Layers,
) -> Result<LayerTexel, Fault> {
    let mut read = |texture: LayerTexture| match corners {
        Some(corners) => corners.texture(scene, memory, layers.texture(texture)),
        None => Ok([1.0; 4]),
    };
    let [.., specular] = read(LayerTexture::Specular)?;
    let [coat, ..] = read(LayerTexture::Coat)?;
    let [_, coat_roughness, ..] = read(LayerTexture::CoatRoughness)?;
    let [.., sheen_roughness] = read(LayerTexture::SheenRoughness)?;
    let [transmission, ..] = read(LayerTexture::Transmission)?;
    let [.., diffuse_transmission] = read(LayerTexture::DiffuseTransmission)?;
    let mut colour =
        |texture: LayerTexture| read(texture).map(|[red, green, blue, _]| Vec3::new(red, green, blue));
    Ok(LayerTexel {
        specular,
        specular_colour: colour(LayerTexture::SpecularColour)?,
        coat,
        coat_roughness,
        sheen: colour(LayerTexture::Sheen)?,
        sheen_roughness,
        transmission,
        diffuse_transmission,
        diffuse_transmission_colour: colour(LayerTexture::DiffuseTransmissionColour)?,
    })
}
