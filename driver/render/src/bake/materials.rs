//! Materials of the scene as glTF, with their images.

use std::collections::BTreeMap;

use glam::Vec3;
use photoncard_firmware::scene::decode_texel;
use photoncard_scene::{Encoding, Image, Material, Reflection, Scene, Texture, Transmission, Wrap};
use serde_json::{Map, Value, json};

use super::error::BakeError;
use super::file::File;
use super::pages::{png_of, srgb};

/// F0 of the index of refraction that glTF assumes, 1.5.
const F0: f32 = 0.04;

/// Materials of a scene, written to a file when they are first used.
pub(super) struct Materials<'s> {
    scene: &'s Scene,
    /// Index in the file of each texture that is written, and the factor of its values.
    textures: BTreeMap<u32, (usize, f32)>,
    images: BTreeMap<u32, (usize, f32)>,
}

impl<'s> Materials<'s> {
    pub(super) fn new(scene: &'s Scene) -> Self {
        Self { scene, textures: BTreeMap::new(), images: BTreeMap::new() }
    }

    /// Material as the scene has it: colours, roughness, transmission and emission; without normal maps,
    /// coats and sheens. `sets` are the numbers that the file gives the two sets of coordinates.
    pub(super) fn kept(
        &mut self,
        file: &mut File,
        material: &Material,
        sets: [u32; 2],
    ) -> Result<Map<String, Value>, BakeError> {
        let mut written = coverage(material);
        let mut surface = Map::new();
        if let Some(texture) = material.base_texture {
            surface.insert("baseColorTexture".into(), self.texture(file, texture, sets)?.0);
        }
        if let Some(texture) = material.metallic_roughness_texture {
            surface.insert("metallicRoughnessTexture".into(), self.texture(file, texture, sets)?.0);
        }
        let (base, metallic, roughness) = match material.reflection {
            Reflection::Phong { diffuse, .. } => (diffuse, 0.0, 1.0),
            Reflection::MetallicRoughness { base_colour, metallic, roughness, .. } => {
                (base_colour, metallic, roughness)
            }
        };
        surface.insert("baseColorFactor".into(), json!([base.x, base.y, base.z, material.alpha]));
        surface.insert("metallicFactor".into(), json!(metallic));
        surface.insert("roughnessFactor".into(), json!(roughness));
        written.insert("pbrMetallicRoughness".into(), surface.into());
        let mut extensions = extensions(&material.reflection);
        if material.is_emissive() {
            self.emission(file, material, sets, (&mut written, &mut extensions))?;
        }
        if let Reflection::Phong { specular, exponent, .. } = material.reflection
            && specular != Vec3::ZERO
        {
            let lobe = json!({ "specular": specular.to_array(), "exponent": exponent });
            written.insert("extras".into(), json!({ "photoncard": { "phong": lobe } }));
        }
        extensions.keys().for_each(|name| file.uses(name));
        if !extensions.is_empty() {
            written.insert("extensions".into(), extensions.into());
        }
        Ok(written)
    }

    /// Black material that emits `scale` times the texture `page`.
    pub(super) fn baked(
        &mut self,
        file: &mut File,
        material: &Material,
        sets: [u32; 2],
        (page, scale): (usize, f32),
    ) -> Result<Map<String, Value>, BakeError> {
        let mut written = coverage(material);
        let has_alpha = material.blends || material.alpha_cutoff.is_some();
        let alpha = if has_alpha { material.alpha } else { 1.0 };
        let mut surface = Map::new();
        surface.insert("baseColorFactor".into(), json!([0.0, 0.0, 0.0, alpha]));
        surface.insert("metallicFactor".into(), json!(0.0));
        surface.insert("roughnessFactor".into(), json!(1.0));
        if let Some(texture) = material.base_texture.filter(|_| has_alpha) {
            surface.insert("baseColorTexture".into(), self.texture(file, texture, sets)?.0);
        }
        written.insert("pbrMetallicRoughness".into(), surface.into());
        let mut extensions = Map::new();
        extensions.insert("KHR_materials_specular".into(), json!({ "specularFactor": 0.0 }));
        if scale > 0.0 {
            written.insert("emissiveFactor".into(), json!([1.0, 1.0, 1.0]));
            written.insert("emissiveTexture".into(), json!({ "index": page, "texCoord": 1 }));
            let strength = json!({ "emissiveStrength": scale });
            extensions.insert("KHR_materials_emissive_strength".into(), strength);
        }
        extensions.keys().for_each(|name| file.uses(name));
        written.insert("extensions".into(), extensions.into());
        Ok(written)
    }

    fn emission(
        &mut self,
        file: &mut File,
        material: &Material,
        sets: [u32; 2],
        (written, extensions): (&mut Map<String, Value>, &mut Map<String, Value>),
    ) -> Result<(), BakeError> {
        let mut emission = material.emission;
        if let Some(texture) = material.emissive_texture {
            let (texture, factor) = self.texture(file, texture, sets)?;
            written.insert("emissiveTexture".into(), texture);
            emission *= factor;
        }
        let strength = emission.max_element().max(1.0);
        written.insert("emissiveFactor".into(), json!((emission / strength).to_array()));
        if strength > 1.0 {
            let strength = json!({ "emissiveStrength": strength });
            extensions.insert("KHR_materials_emissive_strength".into(), strength);
        }
        Ok(())
    }

    /// Reference to a texture, and the factor by which its values are multiplied.
    fn texture(&mut self, file: &mut File, index: u32, sets: [u32; 2]) -> Result<(Value, f32), BakeError> {
        let Some(texture) = self.scene.textures.get(index as usize) else { return Ok((Value::Null, 1.0)) };
        let (written, factor) = match self.textures.get(&index) {
            Some(written) => *written,
            None => {
                let (image, factor) = self.image(file, texture.image)?;
                let wrap = texture.wrap.map(|wrap| match wrap {
                    Wrap::Repeat => 10_497,
                    Wrap::Mirror => 33_648,
                    Wrap::Clamp => 33_071,
                });
                let filters = if texture.nearest { [9728, 9728] } else { [9729, 9987] };
                let written = (file.texture(image, filters, wrap), factor);
                self.textures.insert(index, written);
                written
            }
        };
        let mut reference = Map::new();
        reference.insert("index".into(), json!(written));
        reference.insert("texCoord".into(), json!(sets.get(texture.set as usize)));
        if let Some(transform) = transform(texture) {
            file.uses("KHR_texture_transform");
            reference.insert("extensions".into(), json!({ "KHR_texture_transform": transform }));
        }
        Ok((reference.into(), factor))
    }

    fn image(&mut self, file: &mut File, index: u32) -> Result<(usize, f32), BakeError> {
        if let Some(written) = self.images.get(&index) {
            return Ok(*written);
        }
        let Some(image) = self.scene.images.get(index as usize) else { return Ok((0, 1.0)) };
        let (codes, factor) = codes(image);
        let bytes = png_of([image.width, image.height], png::ColorType::Rgba, &codes, "texture")?;
        let written = (file.image(&image.name, &bytes), factor);
        self.images.insert(index, written);
        Ok(written)
    }
}

/// Name, sides and alpha mode of a material.
fn coverage(material: &Material) -> Map<String, Value> {
    let mut written = Map::new();
    written.insert("name".into(), json!(material.name));
    if material.double_sided {
        written.insert("doubleSided".into(), json!(true));
    }
    if let Some(cutoff) = material.alpha_cutoff {
        written.insert("alphaMode".into(), json!("MASK"));
        written.insert("alphaCutoff".into(), json!(cutoff));
    } else if material.blends {
        written.insert("alphaMode".into(), json!("BLEND"));
    }
    written
}

/// RGBA codes of an image as glTF reads it, and the factor of the values.
fn codes(image: &Image) -> (Vec<u8>, f32) {
    let format = image.encoding.into();
    match image.encoding {
        Encoding::Srgb | Encoding::Linear => (image.texels.as_flattened().to_vec(), 1.0),
        Encoding::LinearPair | Encoding::NormalPair => {
            let code = |value: f32| (value * 255.0 + 0.5) as u8;
            (image.texels.iter().flat_map(|&texel| decode_texel(format, texel).map(code)).collect(), 1.0)
        }
        Encoding::SharedExponent => {
            let values = || image.texels.iter().map(|&texel| decode_texel(format, texel));
            let greatest = values().flat_map(|[r, g, b, _]| [r, g, b]).fold(f32::MIN_POSITIVE, f32::max);
            let code = |value: f32| (srgb(value / greatest) * 255.0 + 0.5) as u8;
            (values().flat_map(|[r, g, b, _]| [code(r), code(g), code(b), u8::MAX]).collect(), greatest)
        }
    }
}

/// Parameters of `KHR_texture_transform`; `None` for the identity.
fn transform(texture: &Texture) -> Option<Value> {
    let Texture { matrix: [[a, b], [c, d]], offset, .. } = *texture;
    let is_identity = [a, b, c, d] == [1.0, 0.0, 0.0, 1.0] && offset == [0.0; 2];
    // Columns are (scale cos, -scale sin) and (scale sin, scale cos).
    let turn = libm::atan2f(-c, a);
    let scale = [libm::hypotf(a, c), b * libm::sinf(turn) + d * libm::cosf(turn)];
    (!is_identity).then(|| json!({ "offset": offset, "rotation": turn, "scale": scale }))
}

fn extensions(reflection: &Reflection) -> Map<String, Value> {
    let mut extensions = Map::new();
    let Reflection::MetallicRoughness { dielectric, grazing, transmission, .. } = *reflection else {
        extensions.insert("KHR_materials_specular".into(), json!({ "specularFactor": 0.0 }));
        return extensions;
    };
    let mut normal = F0;
    if let Some(Transmission { factor, ior, is_volume, absorption }) = transmission {
        extensions.insert("KHR_materials_transmission".into(), json!({ "transmissionFactor": factor }));
        extensions.insert("KHR_materials_ior".into(), json!({ "ior": ior }));
        normal = ((ior - 1.0) / (ior + 1.0)) * ((ior - 1.0) / (ior + 1.0));
        if is_volume {
            let colour = absorption.to_array().map(|absorption| libm::expf(-absorption));
            let volume =
                json!({ "thicknessFactor": 1.0, "attenuationDistance": 1.0, "attenuationColor": colour });
            extensions.insert("KHR_materials_volume".into(), volume);
        }
    }
    let colour = dielectric / (normal * grazing).max(f32::MIN_POSITIVE);
    let is_plain = grazing == 1.0 && (colour - 1.0).abs().max_element() < 1e-3;
    if !is_plain {
        let colour = if grazing > 0.0 && normal > 0.0 { colour } else { Vec3::ONE };
        let specular = json!({ "specularFactor": grazing, "specularColorFactor": colour.to_array() });
        extensions.insert("KHR_materials_specular".into(), specular);
    }
    extensions
}
