//! Layers of materials in glTF files: clearcoat, sheen, diffuse transmission, textures of the specular
//! reflectance, partial coverage, solid glass.

use glam::Vec3;
use photoncard_scene::{Coat, DiffuseTransmission, Layers, Material, Reflection, Sheen};
use serde_json::{Value, json};

use crate::support::{Extended, load_changed, push};

/// PNG image of one texel, as a data URI.
const TEXEL: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nGNoOPC/AQAGwwLAqODXqAAAAABJRU5ErkJggg==";

/// Material of the triangle after `change`; the file has one texture.
fn material(change: impl FnOnce(&mut Value)) -> Result<Material, String> {
    let mut scene = Extended::new();
    let coordinates = scene.floats("VEC2", &[[0.0; 2], [1.0, 0.0], [0.0, 1.0]]);
    scene.primitive()["attributes"]["TEXCOORD_0"] = json!(coordinates);
    scene.json["images"] = json!([{"uri": TEXEL}]);
    scene.json["textures"] = json!([{"source": 0}]);
    let material = &mut scene.json["materials"][0];
    material["extensions"].as_object_mut().unwrap().remove("KHR_materials_specular");
    change(material);
    scene.load().map(|scene| scene.materials[0].clone()).map_err(|error| error.to_string())
}

fn layers(change: impl FnOnce(&mut Value)) -> Layers {
    *material(change).unwrap().layers.expect("layers")
}

#[test]
fn each_layer_is_read_with_its_textures() {
    let found = layers(|material| {
        material["extensions"]["KHR_materials_clearcoat"] = json!({
            "clearcoatFactor": 0.5, "clearcoatTexture": {"index": 0},
            "clearcoatRoughnessFactor": 0.25, "clearcoatNormalTexture": {"index": 0, "scale": 2.0}});
        material["extensions"]["KHR_materials_sheen"] =
            json!({"sheenColorFactor": [0.1, 0.2, 0.3], "sheenRoughnessFactor": 0.75});
        material["extensions"]["KHR_materials_diffuse_transmission"] = json!({
            "diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [0.3, 0.2, 0.1],
            "diffuseTransmissionColorTexture": {"index": 0}});
    });
    let Coat { factor, roughness, factor_texture, roughness_texture, normal } = found.coat.unwrap();
    assert_eq!((factor, roughness, roughness_texture), (0.5, 0.25, None));
    assert!(factor_texture.is_some() && normal.is_some_and(|map| map.scale == 2.0));
    let Sheen { colour, roughness, .. } = found.sheen.unwrap();
    assert_eq!((colour, roughness), (Vec3::new(0.1, 0.2, 0.3), 0.75));
    let DiffuseTransmission { factor, colour, factor_texture, colour_texture } =
        found.diffuse_transmission.unwrap();
    assert_eq!((factor, colour, factor_texture), (0.5, Vec3::new(0.3, 0.2, 0.1), None));
    assert!(colour_texture.is_some());
}

#[test]
fn a_layer_with_factor_zero_is_left_out() {
    let found = material(|material| {
        material["extensions"]["KHR_materials_clearcoat"] = json!({"clearcoatTexture": {"index": 0}});
        material["extensions"]["KHR_materials_sheen"] = json!({"sheenRoughnessFactor": 0.5});
    });
    assert_eq!(found.unwrap().layers, None);
}

/// Uses an index of refraction of 1000 with the reflectance as a colour, as converters from
/// specular-glossiness do.
#[test]
fn an_index_of_1000_keeps_the_textures_of_its_reflectance() {
    let found = layers(|material| {
        material["extensions"]["KHR_materials_ior"] = json!({"ior": 1000.0});
        material["extensions"]["KHR_materials_specular"] =
            json!({"specularColorTexture": {"index": 0}, "specularTexture": {"index": 0}});
    });
    assert!((found.specular.x - 0.996).abs() < 1e-3, "{}", found.specular);
    assert_eq!(found.specular_texture, found.specular_colour_texture, "one texture for both");
}

#[test]
fn layers_out_of_range_are_refused_with_their_path() {
    for (name, value, place) in [
        ("KHR_materials_clearcoat", json!({"clearcoatFactor": 1.5}), "KHR_materials_clearcoat"),
        ("KHR_materials_clearcoat", json!({"clearcoatFactor": "much"}), "KHR_materials_clearcoat"),
        (
            "KHR_materials_clearcoat",
            json!({"clearcoatFactor": 1.0, "clearcoatTexture": {"index": 9}}),
            "KHR_materials_clearcoat.clearcoatTexture",
        ),
        ("KHR_materials_sheen", json!({"sheenColorFactor": [2.0, 0.0, 0.0]}), "KHR_materials_sheen"),
        ("KHR_materials_sheen", json!("silk"), "KHR_materials_sheen"),
        (
            "KHR_materials_diffuse_transmission",
            json!({"diffuseTransmissionFactor": -1.0}),
            "KHR_materials_diffuse_transmission",
        ),
    ] {
        let error = material(|material| material["extensions"][name] = value.clone()).expect_err("refused");
        assert!(error.contains("materials[0]") && error.contains(place), "{value}: {error}");
    }
}

#[test]
fn alpha_blends_and_covers() {
    let found = material(|material| {
        material["alphaMode"] = json!("BLEND");
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([1.0, 1.0, 1.0, 0.25]);
    })
    .unwrap();
    assert!(found.blends && found.alpha == 0.25 && found.alpha_cutoff.is_none());
}

/// Blender's open meshes stay thin walls, and so do closed meshes of other programs.
#[test]
fn glass_of_an_open_mesh_is_a_thin_wall() {
    let scene = load_changed(|json| {
        json["asset"]["generator"] = json!("Khronos glTF Blender I/O v4.2.60");
        push(json, "extensionsUsed", json!("KHR_materials_transmission"));
        json["materials"][0]["extensions"]["KHR_materials_transmission"] = json!({"transmissionFactor": 1.0});
        json["materials"][0]["extensions"].as_object_mut().unwrap().remove("KHR_materials_specular");
    })
    .unwrap();
    let Reflection::MetallicRoughness { transmission: Some(transmission), .. } =
        scene.materials[0].reflection
    else {
        panic!("{:?}", scene.materials[0]);
    };
    assert!(!transmission.is_volume && scene.notices.is_empty(), "{:?}", scene.notices);
}
