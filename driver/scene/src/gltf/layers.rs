//! Reads layers of materials: normal maps, textures of `KHR_materials_specular` and
//! `KHR_materials_transmission`, `KHR_materials_clearcoat`, `KHR_materials_sheen`,
//! `KHR_materials_diffuse_transmission`.

use glam::Vec3;
use gltf::json;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::document::Document;
use super::texture::{Textures, Use};
use crate::error::SceneError;
use crate::{Coat, DiffuseTransmission, Layers, NormalMap, Sheen};

const CLEARCOAT: &str = "KHR_materials_clearcoat";
const SHEEN: &str = "KHR_materials_sheen";
const DIFFUSE_TRANSMISSION: &str = "KHR_materials_diffuse_transmission";

#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct ClearcoatSource {
    clearcoat_factor: f32,
    clearcoat_texture: Option<json::texture::Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<json::texture::Info>,
    clearcoat_normal_texture: Option<NormalSource>,
}

impl Default for ClearcoatSource {
    fn default() -> Self {
        Self {
            clearcoat_factor: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness_factor: 0.0,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
        }
    }
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct SheenSource {
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<json::texture::Info>,
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<json::texture::Info>,
}

#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct DiffuseTransmissionSource {
    diffuse_transmission_factor: f32,
    diffuse_transmission_texture: Option<json::texture::Info>,
    diffuse_transmission_color_factor: [f32; 3],
    diffuse_transmission_color_texture: Option<json::texture::Info>,
}

impl Default for DiffuseTransmissionSource {
    fn default() -> Self {
        Self {
            diffuse_transmission_factor: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color_factor: [1.0; 3],
            diffuse_transmission_color_texture: None,
        }
    }
}

/// A `textureInfo` with the scale of a normal texture.
#[derive(Deserialize)]
struct NormalSource {
    #[serde(flatten)]
    info: json::texture::Info,
    #[serde(default = "one")]
    scale: f32,
}

fn one() -> f32 {
    1.0
}

struct Reader<'a, 'd> {
    document: &'a Document,
    textures: &'a mut Textures<'d>,
    source: &'a json::Material,
    /// Index of the material in the file.
    index: usize,
}

/// Reads the layers of a material; `None` if it has none. `specular` is the F0 of its base before
/// `specularFactor` and the limit of 1 are applied. `is_gltf` is false for a Phong reflection, which may have
/// a normal map only.
pub(super) fn load(
    document: &Document,
    index: usize,
    source: &json::Material,
    textures: &mut Textures<'_>,
    (specular, is_gltf): (Vec3, bool),
) -> Result<Option<Box<Layers>>, SceneError> {
    let mut reader = Reader { document, textures, source, index };
    let mut layers = Layers { normal: reader.normal()?, ..Layers::none(specular) };
    if is_gltf {
        reader.specular(&mut layers)?;
        layers.transmission_texture = reader.transmission()?;
        layers.coat = reader.coat()?;
        layers.sheen = reader.sheen()?;
        layers.diffuse_transmission = reader.diffuse_transmission()?;
    }
    Ok((layers != Layers::none(specular)).then(|| Box::new(layers)))
}

/// Returns whether a material has a coat, sheen or diffuse transmission.
pub(super) fn has_other_layer(source: &json::Material) -> bool {
    let Some(extensions) = &source.extensions else { return false };
    [CLEARCOAT, SHEEN, DIFFUSE_TRANSMISSION].iter().any(|name| extensions.others.contains_key(*name))
}

impl Reader<'_, '_> {
    /// Parses an extension that the `gltf` crate does not know; `None` if the material does not have it.
    fn extension<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, SceneError> {
        let extensions = self.source.extensions.as_ref();
        let Some(value) = extensions.and_then(|extensions| extensions.others.get(name)) else {
            return Ok(None);
        };
        serde_json::from_value(value.clone()).map(Some).map_err(|error| {
            let remedy = "write the extension as its specification says";
            self.document.invalid(self.place(name, ""), error.to_string(), remedy)
        })
    }

    fn place(&self, extension: &str, property: &str) -> String {
        let dot = if property.is_empty() { "" } else { "." };
        format!("materials[{}].extensions.{extension}{dot}{property}", self.index)
    }

    fn texture(
        &mut self,
        extension: &str,
        property: &str,
        info: Option<&json::texture::Info>,
        taken: Use,
    ) -> Result<Option<u32>, SceneError> {
        let place = self.place(extension, property);
        info.map(|info| self.textures.add(&place, info, taken)).transpose()
    }

    fn normal(&mut self) -> Result<Option<NormalMap>, SceneError> {
        let Some(texture) = &self.source.normal_texture else { return Ok(None) };
        let place = format!("materials[{}].normalTexture", self.index);
        // The `gltf` crate keeps the transform of a normal texture among unknown extensions.
        let source = serde_json::to_value(texture).and_then(serde_json::from_value::<NormalSource>);
        let source = source.map_err(|error| {
            self.document.invalid(place.as_str(), error.to_string(), "write it as glTF 2.0 says")
        })?;
        let texture = self.textures.add(&place, &source.info, Use::Normal)?;
        Ok(Some(NormalMap { texture, scale: source.scale }))
    }

    fn specular(&mut self, layers: &mut Layers) -> Result<(), SceneError> {
        let extensions = self.source.extensions.as_ref();
        let Some(specular) = extensions.and_then(|extensions| extensions.specular.as_ref()) else {
            return Ok(());
        };
        let name = "KHR_materials_specular";
        // The factor is in alpha, which is linear in sRGB images too. The two textures, often of one image,
        // can therefore share an encoding.
        let [factor, colour] = [&specular.specular_texture, &specular.specular_color_texture];
        layers.specular_texture = self.texture(name, "specularTexture", factor.as_ref(), Use::Colour)?;
        layers.specular_colour_texture =
            self.texture(name, "specularColorTexture", colour.as_ref(), Use::Colour)?;
        Ok(())
    }

    fn transmission(&mut self) -> Result<Option<u32>, SceneError> {
        let extensions = self.source.extensions.as_ref();
        let transmission = extensions.and_then(|extensions| extensions.transmission.as_ref());
        let info = transmission.and_then(|transmission| transmission.transmission_texture.as_ref());
        self.texture("KHR_materials_transmission", "transmissionTexture", info, Use::Red)
    }

    fn coat(&mut self) -> Result<Option<Coat>, SceneError> {
        let Some(source) = self.extension::<ClearcoatSource>(CLEARCOAT)? else { return Ok(None) };
        if source.clearcoat_factor == 0.0 {
            return Ok(None);
        }
        let mut add = |property: &str, info: Option<&json::texture::Info>, taken| {
            self.texture(CLEARCOAT, property, info, taken)
        };
        let normal = source.clearcoat_normal_texture.as_ref();
        let normal_texture = add("clearcoatNormalTexture", normal.map(|normal| &normal.info), Use::Normal)?;
        Ok(Some(Coat {
            factor: source.clearcoat_factor,
            roughness: source.clearcoat_roughness_factor,
            factor_texture: add("clearcoatTexture", source.clearcoat_texture.as_ref(), Use::Red)?,
            roughness_texture: add(
                "clearcoatRoughnessTexture",
                source.clearcoat_roughness_texture.as_ref(),
                Use::Green,
            )?,
            normal: normal_texture
                .zip(normal)
                .map(|(texture, normal)| NormalMap { texture, scale: normal.scale }),
        }))
    }

    fn sheen(&mut self) -> Result<Option<Sheen>, SceneError> {
        let Some(source) = self.extension::<SheenSource>(SHEEN)? else { return Ok(None) };
        if source.sheen_color_factor == [0.0; 3] {
            return Ok(None);
        }
        let mut add = |property: &str, info: Option<&json::texture::Info>| {
            self.texture(SHEEN, property, info, Use::Colour)
        };
        Ok(Some(Sheen {
            colour: source.sheen_color_factor.into(),
            roughness: source.sheen_roughness_factor,
            colour_texture: add("sheenColorTexture", source.sheen_color_texture.as_ref())?,
            roughness_texture: add("sheenRoughnessTexture", source.sheen_roughness_texture.as_ref())?,
        }))
    }

    fn diffuse_transmission(&mut self) -> Result<Option<DiffuseTransmission>, SceneError> {
        let Some(source) = self.extension::<DiffuseTransmissionSource>(DIFFUSE_TRANSMISSION)? else {
            return Ok(None);
        };
        if source.diffuse_transmission_factor == 0.0 {
            return Ok(None);
        }
        let mut add = |property: &str, info: Option<&json::texture::Info>| {
            self.texture(DIFFUSE_TRANSMISSION, property, info, Use::Colour)
        };
        Ok(Some(DiffuseTransmission {
            factor: source.diffuse_transmission_factor,
            colour: source.diffuse_transmission_color_factor.into(),
            factor_texture: add("diffuseTransmissionTexture", source.diffuse_transmission_texture.as_ref())?,
            colour_texture: add(
                "diffuseTransmissionColorTexture",
                source.diffuse_transmission_color_texture.as_ref(),
            )?,
        }))
    }
}
