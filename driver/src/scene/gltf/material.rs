//! Materials: base colour, emission, and the Phong lobe that `extras` may state.

use glam::Vec3;
use gltf::json;
use serde::Deserialize;

use super::document::Document;
use super::notices::Notices;
use crate::error::SceneError;
use crate::scene::Material;
use crate::scene::material::Property;

/// What `extras` may hold for this renderer; everything else in `extras` is other programs' business.
#[derive(Deserialize)]
struct Extras {
    photoncard: Option<Photoncard>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Photoncard {
    phong: Option<Phong>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Phong {
    specular: [f32; 3],
    exponent: f32,
}

/// The material of primitives that state none: glTF's default.
pub(super) fn default_material() -> Material {
    Material {
        name: "default".to_owned(),
        diffuse: Vec3::ONE,
        specular: Vec3::ZERO,
        exponent: 0.0,
        emission: Vec3::ZERO,
        double_sided: false,
    }
}

/// Every material of the file, in its order.
pub(super) fn load(document: &Document, notices: &mut Notices) -> Result<Vec<Material>, SceneError> {
    let materials = document.root.materials.iter().enumerate();
    materials.map(|(index, material)| load_one(document, index, material, notices)).collect()
}

fn load_one(
    document: &Document,
    index: usize,
    source: &json::Material,
    notices: &mut Notices,
) -> Result<Material, SceneError> {
    let name = source.name.clone().unwrap_or_else(|| format!("material {index}"));
    let [red, green, blue, _] = source.pbr_metallic_roughness.base_color_factor.0;
    let extensions = source.extensions.as_ref();
    let strength = extensions.and_then(|extensions| extensions.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
    let mut material = Material {
        name,
        diffuse: Vec3::new(red, green, blue),
        specular: Vec3::ZERO,
        exponent: 0.0,
        emission: Vec3::from(source.emissive_factor.0) * strength,
        double_sided: source.double_sided,
    };
    let specular = extensions.and_then(|extensions| extensions.specular.as_ref());
    let is_lambertian = specular.is_some_and(|specular| specular.specular_factor.0 == 0.0);
    if let Some(phong) = read_phong(document, index, source, &material.name)? {
        material.specular = Vec3::from(phong.specular);
        material.exponent = phong.exponent;
    } else if !is_lambertian {
        notices.metallic_roughness.push(material.name.clone());
    }
    material.check().map_err(|fault| {
        let item = match fault.property {
            Property::Diffuse => "pbrMetallicRoughness.baseColorFactor",
            Property::Specular => "extras.photoncard.phong.specular",
            Property::Exponent => "extras.photoncard.phong.exponent",
            Property::Emission => "emissiveFactor",
        };
        SceneError::Material {
            place: document.place(format!("materials[{index}].{item}")),
            material: material.name.clone(),
            reason: fault.reason,
            remedy: fault.remedy,
        }
    })?;
    Ok(material)
}

fn read_phong(
    document: &Document,
    index: usize,
    source: &json::Material,
    name: &str,
) -> Result<Option<Phong>, SceneError> {
    let Some(extras) = &source.extras else { return Ok(None) };
    // `extras` may be of any type; only an object can be meant for us.
    if !extras.get().trim_start().starts_with('{') {
        return Ok(None);
    }
    let extras: Extras = serde_json::from_str(extras.get()).map_err(|error| {
        // The line and column are those of the extract, which helps nobody.
        let message = error.to_string();
        let message = message.split(" at line ").next().unwrap_or_default();
        SceneError::Material {
            place: document.place(format!("materials[{index}].extras.photoncard")),
            material: name.to_owned(),
            reason: message.to_owned(),
            remedy: r#"state it as {"photoncard": {"phong": {"specular": [r, g, b], "exponent": n}}}"#,
        }
    })?;
    Ok(extras.photoncard.and_then(|photoncard| photoncard.phong))
}
