//! Converts specular-glossiness materials (`KHR_materials_pbrSpecularGlossiness`) to metallic-roughness ones,
//! before anything else reads them. Textures become new images.

mod formula;
mod texels;

use std::collections::BTreeMap;

use glam::Vec3;
use gltf::json;
use gltf::json::extensions::material::PbrSpecularGlossiness;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf::json::texture::Info;

use self::formula::Appearance;
pub(super) use self::texels::Grid;
use super::origin::Origin;

/// Images that are computed from others, and materials whose conversion is incomplete.
#[derive(Default)]
pub(super) struct Conversions {
    pub(super) images: BTreeMap<usize, Conversion>,
    /// Indices of materials whose two textures have different samplers or coordinates.
    pub(super) mismatched: Vec<usize>,
}

/// Image that is computed from a diffuse texture, a specular-glossiness texture, or both.
pub(super) struct Conversion {
    /// Images of the diffuse and the specular-glossiness texture.
    pub(super) sources: [Option<Origin>; 2],
    factors: Appearance,
    part: Part,
}

/// Texture whose image is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    BaseColour,
    MetallicRoughness,
}

/// Converts the materials of a document, whose indices are all valid.
pub(super) fn convert(root: &mut json::Root) -> Conversions {
    let mut conversions = Conversions::default();
    for index in 0..root.materials.len() {
        let extensions = root.materials[index].extensions.as_ref();
        let Some(stated) = extensions.and_then(|extensions| extensions.pbr_specular_glossiness.clone())
        else {
            continue;
        };
        let (converted, is_mismatched) = convert_one(root, &stated, &mut conversions.images);
        root.materials[index].pbr_metallic_roughness = converted;
        conversions.mismatched.extend(is_mismatched.then_some(index));
    }
    conversions
}

/// Converts a material. Returns the result, and whether the specular-glossiness texture was left out.
fn convert_one(
    root: &mut json::Root,
    stated: &PbrSpecularGlossiness,
    images: &mut BTreeMap<usize, Conversion>,
) -> (PbrMetallicRoughness, bool) {
    let [red, green, blue, alpha] = stated.diffuse_factor.0;
    let factors = Appearance {
        diffuse: Vec3::new(red, green, blue),
        specular: Vec3::from(stated.specular_factor.0),
        glossiness: stated.glossiness_factor.0,
    };
    let diffuse = stated.diffuse_texture.as_ref();
    let specular = stated.specular_glossiness_texture.as_ref();
    let is_mismatched =
        diffuse.zip(specular).is_some_and(|(diffuse, specular)| !is_alike(root, diffuse, specular));
    let specular = specular.filter(|_| !is_mismatched);
    let mut converted = PbrMetallicRoughness::default();
    let Some(mapping) = diffuse.or(specular) else {
        let constant = factors.converted();
        let [red, green, blue] = constant.base.to_array();
        converted.base_color_factor = PbrBaseColorFactor([red, green, blue, alpha]);
        converted.metallic_factor = StrengthFactor(constant.metallic);
        converted.roughness_factor = StrengthFactor(constant.roughness);
        return (converted, is_mismatched);
    };
    let sources = [diffuse, specular].map(|info| Some(Origin::of(root, info?.index.value())));
    let mut add = |part| {
        let image = root.images.len();
        images.insert(image, Conversion { sources, factors, part });
        Some(added(root, mapping, image, part))
    };
    converted.base_color_factor = PbrBaseColorFactor([1.0, 1.0, 1.0, alpha]);
    converted.base_color_texture = add(Part::BaseColour);
    // Without a specular-glossiness texture the roughness is a factor, which is not rounded to 8 bits.
    let roughness = if specular.is_some() { 1.0 } else { 1.0 - factors.glossiness };
    converted.roughness_factor = StrengthFactor(roughness);
    converted.metallic_roughness_texture = add(Part::MetallicRoughness);
    (converted, is_mismatched)
}

/// Appends an image and a texture of it with the sampler and coordinates of `mapping`. Returns the texture's
/// info.
fn added(root: &mut json::Root, mapping: &Info, image: usize, part: Part) -> Info {
    let sampler = root.textures[mapping.index.value()].sampler;
    let name = match part {
        Part::BaseColour => format!("image {image} (base colour)"),
        Part::MetallicRoughness => format!("image {image} (metallic-roughness)"),
    };
    root.images.push(json::Image {
        buffer_view: None,
        mime_type: None,
        name: Some(name),
        uri: None,
        extensions: None,
        extras: None,
    });
    let source = json::Index::new(image as u32);
    let texture = json::Texture { name: None, sampler, source, extensions: None, extras: None };
    let index = json::Index::new(root.textures.len() as u32);
    root.textures.push(texture);
    Info { index, ..mapping.clone() }
}

/// Returns whether two textures sample their images at the same coordinates, so that texels correspond.
fn is_alike(root: &json::Root, one: &Info, other: &Info) -> bool {
    let transform = |info: &Info| {
        let plain = TextureTransform::default();
        let stated = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.clone());
        let stated = stated.unwrap_or(plain);
        let set = stated.tex_coord.unwrap_or(info.tex_coord);
        (set, stated.offset.0, stated.scale.0, stated.rotation.0)
    };
    let wrap = |info: &Info| {
        let sampler =
            root.textures[info.index.value()].sampler.and_then(|index| root.samplers.get(index.value()));
        sampler.map(|sampler| (sampler.wrap_s, sampler.wrap_t)).unwrap_or_default()
    };
    transform(one) == transform(other) && wrap(one) == wrap(other)
}
