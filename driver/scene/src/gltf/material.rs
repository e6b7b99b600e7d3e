//! Materials: base colour, metalness, roughness, transmission, emission, and the Phong lobe in `extras`.

use glam::Vec3;
use gltf::json;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;
use serde::Deserialize;

use super::document::Document;
use super::extras;
use super::layers::{self, has_other_layer};
use super::texture::{Textures, Use};
use crate::error::SceneError;
use crate::light_groups::LightSource;
use crate::out_of_range::{OutOfRange, Property};
use crate::{Material, Reflection, Transmission};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Photoncard {
    phong: Option<Phong>,
    /// Light group of the emission.
    light_group: Option<String>,
    /// Lightmap that `photoncard bake` has written, for other programs.
    #[serde(default, rename = "lightmap")]
    _lightmap: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Phong {
    specular: [f32; 3],
    exponent: f32,
}

/// glTF's default material for primitives without one: a rough white metal.
pub(super) fn default_material() -> Material {
    Material::new("default", metallic_roughness(&json::Material::default(), Vec3::ONE))
}

/// Materials of the file, in its order.
pub(super) fn load(document: &Document, textures: &mut Textures) -> Result<Vec<Material>, SceneError> {
    let materials = document.root.materials.iter().enumerate();
    materials.map(|(index, material)| load_one(document, index, material, textures)).collect()
}

fn load_one(
    document: &Document,
    index: usize,
    source: &json::Material,
    textures: &mut Textures,
) -> Result<Material, SceneError> {
    let name = source.name.clone().unwrap_or_else(|| format!("material {index}"));
    let [red, green, blue, alpha] = source.pbr_metallic_roughness.base_color_factor.0;
    let extensions = source.extensions.as_ref();
    let base_colour = Vec3::new(red, green, blue);
    let reflection =
        if let Some(phong) = photoncard(document, index, source, &name)?.and_then(|stated| stated.phong) {
            let (specular, exponent) = (Vec3::from(phong.specular), phong.exponent);
            Reflection::Phong { diffuse: base_colour, specular, exponent }
        } else if is_lambertian(source) {
            Reflection::Phong { diffuse: base_colour, specular: Vec3::ZERO, exponent: 0.0 }
        } else {
            metallic_roughness(source, base_colour)
        };
    let mut material = Material {
        emission: emission(source),
        double_sided: source.double_sided,
        alpha_cutoff: (source.alpha_mode == Checked::Valid(AlphaMode::Mask))
            .then(|| source.alpha_cutoff.unwrap_or_default().0),
        blends: source.alpha_mode == Checked::Valid(AlphaMode::Blend),
        alpha,
        ..Material::new(name, reflection)
    };
    add_textures(&mut material, index, source, textures)?;
    let is_gltf = matches!(material.reflection, Reflection::MetallicRoughness { .. });
    let base = (unlimited_f0(source), is_gltf);
    material.layers = layers::load(document, index, source, textures, base)?;
    // Diffuse transmission makes a surface double-sided, because transmitted light arrives at the back.
    let transmits_diffusely =
        material.layers.as_ref().is_some_and(|layers| layers.diffuse_transmission.is_some());
    material.double_sided |= transmits_diffusely;
    check_extensions(extensions).and_then(|()| material.check()).map_err(|fault| {
        let item = match fault.property {
            Property::Diffuse | Property::Alpha => "pbrMetallicRoughness.baseColorFactor",
            Property::Metallic => "pbrMetallicRoughness.metallicFactor",
            Property::Roughness => "pbrMetallicRoughness.roughnessFactor",
            Property::Dielectric => "extensions.KHR_materials_specular",
            Property::AlphaCutoff => "alphaCutoff",
            Property::Transmission => "extensions.KHR_materials_transmission.transmissionFactor",
            Property::Ior => "extensions.KHR_materials_ior.ior",
            Property::Absorption => "extensions.KHR_materials_volume",
            Property::Specular => "extras.photoncard.phong.specular",
            Property::Exponent => "extras.photoncard.phong.exponent",
            Property::Emission => "emissiveFactor",
            Property::NormalScale => "normalTexture.scale",
            Property::Coat => "extensions.KHR_materials_clearcoat",
            Property::Sheen => "extensions.KHR_materials_sheen",
            Property::DiffuseTransmission => "extensions.KHR_materials_diffuse_transmission",
        };
        SceneError::Material {
            location: document.location(format!("materials[{index}].{item}")),
            material: material.name.clone(),
            reason: fault.reason,
            remedy: fault.remedy,
        }
    })?;
    Ok(material)
}

/// Adds the textures that the material's reflection and emission use.
fn add_textures(
    material: &mut Material,
    index: usize,
    source: &json::Material,
    textures: &mut Textures,
) -> Result<(), SceneError> {
    let pbr = &source.pbr_metallic_roughness;
    let mut add = |info: Option<&json::texture::Info>, name: &str, taken| {
        info.map(|info| textures.add(&format!("materials[{index}].{name}"), info, taken)).transpose()
    };
    material.base_texture =
        add(pbr.base_color_texture.as_ref(), "pbrMetallicRoughness.baseColorTexture", Use::Colour)?;
    if matches!(material.reflection, Reflection::MetallicRoughness { .. }) {
        let info = pbr.metallic_roughness_texture.as_ref();
        material.metallic_roughness_texture =
            add(info, "pbrMetallicRoughness.metallicRoughnessTexture", Use::MetallicRoughness)?;
    }
    if material.is_emissive() {
        material.emissive_texture = add(source.emissive_texture.as_ref(), "emissiveTexture", Use::Emission)?;
    }
    Ok(())
}

/// Checks values of extensions that [`Reflection`] does not store.
fn check_extensions(extensions: Option<&json::extensions::material::Material>) -> Result<(), OutOfRange> {
    let Some(extensions) = extensions else { return Ok(()) };
    if let Some(specular) = &extensions.specular {
        let (factor, colour) = (specular.specular_factor.0, specular.specular_color_factor.0);
        if !(0.0..=1.0).contains(&factor) || colour.iter().any(|channel| channel.is_nan() || *channel < 0.0) {
            let reason = format!("the specular factor is {factor}, its colour {}", Vec3::from(colour));
            let remedy = "the specular factor is 0 to 1, its colour 0 or more";
            return Err(OutOfRange { property: Property::Dielectric, reason, remedy });
        }
    }
    match extensions.ior.as_ref().map(|ior| ior.ior.0) {
        Some(ior) if !(ior == 0.0 || (1.0..f32::INFINITY).contains(&ior)) => {
            let reason = format!("the index of refraction is {ior}");
            let remedy = "indices of refraction are 1 or more, or 0 for a mirror; glass has 1.5";
            Err(OutOfRange { property: Property::Ior, reason, remedy })
        }
        _ => Ok(()),
    }
}

/// Default index of refraction (`KHR_materials_ior`).
const IOR: f32 = 1.5;

/// Maximum absorption coefficient, 1/m. At this value a layer of one atom is opaque.
const MAX_ABSORPTION: f32 = 1e12;

/// Metallic-roughness reflection, with the extensions for dielectrics.
fn metallic_roughness(source: &json::Material, base_colour: Vec3) -> Reflection {
    let pbr = &source.pbr_metallic_roughness;
    let extensions = source.extensions.as_ref();
    let ior = extensions.and_then(|extensions| extensions.ior.as_ref()).map_or(IOR, |ior| ior.ior.0);
    let specular = extensions.and_then(|extensions| extensions.specular.as_ref());
    let factor = specular.map_or(1.0, |specular| specular.specular_factor.0);
    Reflection::MetallicRoughness {
        base_colour,
        metallic: pbr.metallic_factor.0,
        roughness: pbr.roughness_factor.0,
        dielectric: unlimited_f0(source).min(Vec3::ONE) * factor,
        grazing: factor,
        // A reflectance of 1 leaves no light to transmit.
        transmission: if ior == 0.0 { None } else { transmission(extensions, ior) },
    }
}

/// F0 of the dielectric without `specularFactor` and the limit of 1: `((ior - 1) / (ior + 1))^2
/// specularColorFactor`.
fn unlimited_f0(source: &json::Material) -> Vec3 {
    let extensions = source.extensions.as_ref();
    let ior = extensions.and_then(|extensions| extensions.ior.as_ref()).map_or(IOR, |ior| ior.ior.0);
    // An index of 0 means infinity; the reflectance is then 1 (`KHR_materials_ior`).
    let amplitude = (f64::from(ior) - 1.0) / (f64::from(ior) + 1.0);
    let specular = extensions.and_then(|extensions| extensions.specular.as_ref());
    let colour = specular.map_or(Vec3::ONE, |specular| specular.specular_color_factor.0.into());
    colour * (amplitude * amplitude) as f32
}

/// Emitted radiance: `emissiveFactor` times `emissiveStrength`, W/(sr m^2).
fn emission(material: &json::Material) -> Vec3 {
    let strength = material.extensions.as_ref().and_then(|extensions| extensions.emissive_strength.as_ref());
    Vec3::from(material.emissive_factor.0) * strength.map_or(1.0, |strength| strength.emissive_strength.0)
}

/// Returns whether the material has an emissive texture, but an emissive factor or strength of 0.
pub(super) fn has_dark_texture(material: &json::Material) -> bool {
    material.emissive_texture.is_some() && emission(material) == Vec3::ZERO
}

/// Returns whether the material is purely diffuse: it is no metal, and `specularFactor` 0 removes the
/// reflection of its dielectric part. The default metalness of glTF is 1.
fn is_lambertian(material: &json::Material) -> bool {
    let specular = material.extensions.as_ref().and_then(|extensions| extensions.specular.as_ref());
    specular.is_some_and(|specular| specular.specular_factor.0 == 0.0)
        && material.pbr_metallic_roughness.metallic_factor.0 == 0.0
        && !is_transmissive(material)
        && !has_other_layer(material)
}

fn is_transmissive(material: &json::Material) -> bool {
    let transmission = material.extensions.as_ref().and_then(|extensions| extensions.transmission.as_ref());
    transmission.is_some_and(|transmission| transmission.transmission_factor.0 > 0.0)
}

fn transmission(extensions: Option<&json::extensions::material::Material>, ior: f32) -> Option<Transmission> {
    let factor = extensions?.transmission.as_ref()?.transmission_factor.0;
    let volume = extensions?.volume.as_ref().filter(|volume| volume.thickness_factor.0 > 0.0);
    let absorption = volume.map_or(Vec3::ZERO, |volume| {
        let distance = volume.attenuation_distance.0;
        let coefficient = |colour: f32| match -libm::logf(colour) / distance {
            // The coefficient of a black attenuation colour or of a distance of 0 is infinite.
            infinite if infinite == f32::INFINITY => MAX_ABSORPTION,
            coefficient => coefficient.min(MAX_ABSORPTION),
        };
        Vec3::from(volume.attenuation_color.0.map(coefficient))
    });
    (factor != 0.0).then_some(Transmission { factor, ior, is_volume: volume.is_some(), absorption })
}

/// Light groups that materials state.
///
/// # Errors
/// If the `extras` of a material are not possible.
pub(super) fn light_groups(document: &Document) -> Result<Vec<(LightSource, String)>, SceneError> {
    let mut groups = Vec::new();
    for (index, source) in document.root.materials.iter().enumerate() {
        let name = source.name.as_deref().unwrap_or_default();
        let stated = photoncard(document, index, source, name)?.and_then(|stated| stated.light_group);
        groups.extend(stated.map(|group| (LightSource::Material(index), group)));
    }
    Ok(groups)
}

fn photoncard(
    document: &Document,
    index: usize,
    source: &json::Material,
    name: &str,
) -> Result<Option<Photoncard>, SceneError> {
    extras::read(&source.extras).map_err(|reason| SceneError::Material {
        location: document.location(format!("materials[{index}].extras.photoncard")),
        material: name.to_owned(),
        reason,
        remedy: r#"state some of {"photoncard": {"phong": {"specular": [r, g, b], "exponent": n}, "light_group": "key"}}"#,
    })
}
