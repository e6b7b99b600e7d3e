//! Specular-glossiness materials become metallic-roughness ones by the formula of the extension's examples.

use photoncard_scene::{Encoding, Reflection, Scene};
use serde_json::{Value, json};

use crate::support::{Extended, push};

const NAME: &str = "KHR_materials_pbrSpecularGlossiness";

/// PNG of rows of `width` texels.
fn image(width: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, texels.len() as u32 / width);
    encoder.set_color(png::ColorType::Rgba);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(texels.as_flattened()).unwrap();
    writer.finish().unwrap();
    bytes
}

/// File of the triangle with texture coordinates and a material that has the extension alone.
fn stated(extension: &Value) -> Extended {
    let mut scene = Extended::new();
    let coordinates = scene.floats("VEC2", &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    scene.primitive()["attributes"]["TEXCOORD_0"] = json!(coordinates);
    scene.json["extensionsRequired"] = json!([NAME]);
    scene.json["materials"] = json!([{"name": "old", "extensions": {NAME: extension}}]);
    scene
}

/// Adds a texture with the given image file, and returns its index.
fn texture(scene: &mut Extended, image: &[u8]) -> usize {
    let view = scene.view(image);
    let image = push(&mut scene.json, "images", json!({"bufferView": view, "name": format!("view {view}")}));
    push(&mut scene.json, "textures", json!({"source": image}))
}

fn extension(scene: &mut Extended) -> &mut Value {
    &mut scene.json["materials"][0]["extensions"][NAME]
}

/// Base colour, metalness and roughness of the material.
fn factors(scene: &Scene) -> [f32; 5] {
    let Reflection::MetallicRoughness { base_colour, metallic, roughness, .. } =
        scene.materials[0].reflection
    else {
        panic!("{:?}", scene.materials)
    };
    let [red, green, blue] = base_colour.to_array();
    [red, green, blue, metallic, roughness]
}

/// Texels of the base colour and metallic-roughness images.
fn images(scene: &Scene) -> [Vec<[u8; 4]>; 2] {
    let material = &scene.materials[0];
    let images = [material.base_texture, material.metallic_roughness_texture].map(|texture| {
        let texture = scene.textures[texture.expect("a texture") as usize];
        &scene.images[texture.image as usize]
    });
    assert_eq!(images.map(|image| image.encoding), [Encoding::Srgb, Encoding::Linear]);
    assert_eq!(scene.images.len(), 2, "only what is rendered is kept");
    images.map(|image| image.texels.clone())
}

fn near(found: &[f32], expected: &[f32]) -> bool {
    found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-4)
}

/// Expected values are from the extension's examples in JavaScript.
#[test]
fn factors_are_converted() {
    let cases = [
        // A dielectric of F0 0.04, and the defaults: white, perfectly smooth.
        (
            json!({"diffuseFactor": [0.5, 0.25, 0.1, 1], "specularFactor": [0.04, 0.04, 0.04], "glossinessFactor": 0.7}),
            [0.5, 0.25, 0.1, 0.0, 0.3],
        ),
        (json!({}), [1.0, 1.0, 1.0, 1.0, 0.0]),
        // Gold.
        (
            json!({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1.0, 0.766, 0.336], "glossinessFactor": 0.4}),
            [1.0, 0.766, 0.336, 1.0, 0.6],
        ),
        // Black.
        (
            json!({"diffuseFactor": [0.5, 0.5, 0.5, 1], "specularFactor": [0, 0, 0], "glossinessFactor": 0}),
            [0.520_833, 0.520_833, 0.520_833, 0.0, 1.0],
        ),
        // Between a dielectric and a metal.
        (
            json!({"diffuseFactor": [0.3, 0.2, 0.1, 1], "specularFactor": [0.3, 0.25, 0.2], "glossinessFactor": 0.5}),
            [0.518_684, 0.372_418, 0.226_152, 0.596_741, 0.5],
        ),
    ];
    for (values, expected) in cases {
        let scene = stated(&values).load().unwrap();
        assert!(near(&factors(&scene), &expected), "{values}: {:?}", factors(&scene));
        assert!(scene.images.is_empty() && scene.notices.is_empty(), "{:?}", scene.notices);
    }
}

/// The metallic-roughness values beside the extension are a fallback for programs that do not know it.
#[test]
fn the_extension_replaces_metallic_roughness() {
    let mut scene = stated(&json!({"diffuseFactor": [0, 0, 0, 0.25], "specularFactor": [0.9, 0.9, 0.9]}));
    scene.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorFactor": [0.2, 0.2, 0.2, 1], "metallicFactor": 0, "roughnessFactor": 0.9,
            "baseColorTexture": {"index": 0}});
    scene.json["textures"] = json!([{}]);
    let scene = scene.load().unwrap();
    assert!(near(&factors(&scene), &[0.9, 0.9, 0.9, 1.0, 0.0]), "{:?}", factors(&scene));
    assert_eq!((scene.materials[0].alpha, scene.materials[0].base_texture), (0.25, None));
}

/// Tests diffuse texels without a specular texture, and specular ones without a diffuse texture. The sRGB
/// code 188 is 0.5 linear; 56 is 0.04.
#[test]
fn textures_are_converted_texel_by_texel() {
    let mut scene = stated(&json!({"specularFactor": [0.04, 0.04, 0.04], "glossinessFactor": 0.7}));
    let diffuse = texture(&mut scene, &image(2, &[[188, 99, 0, 255], [10, 20, 30, 128]]));
    extension(&mut scene)["diffuseTexture"] = json!({"index": diffuse});
    let scene = scene.load().unwrap();
    assert!(near(&factors(&scene), &[1.0, 1.0, 1.0, 1.0, 0.3]), "{:?}", factors(&scene));
    let white = [255, 255, 0, 255];
    assert_eq!(images(&scene), [vec![[188, 99, 0, 255], [10, 20, 30, 128]], vec![white, white]]);

    let mut scene = stated(&json!({"diffuseFactor": [0, 0, 0, 1]}));
    let specular = texture(&mut scene, &image(2, &[[255, 226, 157, 102], [0, 0, 0, 255]]));
    extension(&mut scene)["specularGlossinessTexture"] = json!({"index": specular});
    let scene = scene.load().unwrap();
    assert!(near(&factors(&scene), &[1.0, 1.0, 1.0, 1.0, 1.0]), "{:?}", factors(&scene));
    let expected = [vec![[255, 226, 157, 255], [0, 0, 0, 255]], vec![[255, 153, 255, 255], [255, 0, 0, 255]]];
    assert_eq!(images(&scene), expected);
}

/// The larger image determines the size; the smaller one is interpolated.
#[test]
fn textures_of_two_sizes_are_combined() {
    let mut scene = stated(&json!({"diffuseFactor": [1, 1, 1, 1]}));
    let diffuse = texture(&mut scene, &image(4, &[[0, 0, 0, 255]; 8]));
    let specular = texture(&mut scene, &image(2, &[[255, 255, 255, 0], [255, 255, 255, 255]]));
    extension(&mut scene)["diffuseTexture"] = json!({"index": diffuse});
    extension(&mut scene)["specularGlossinessTexture"] = json!({"index": specular});
    let [base, metallic_roughness] = images(&scene.load().unwrap());
    assert_eq!((base.len(), metallic_roughness.len()), (8, 8));
    assert!(base.iter().all(|texel| *texel == [255; 4]), "{base:?}");
    assert_eq!(metallic_roughness[..4], [255, 191, 64, 0].map(|roughness| [255, roughness, 255, 255]));
}

#[test]
fn a_texture_without_a_readable_image_leaves_the_factor() {
    let mut scene = stated(&json!({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1, 0.5, 0.25]}));
    scene.json["images"] = json!([{"uri": "absent.png"}]);
    scene.json["textures"] = json!([{"source": 0}]);
    extension(&mut scene)["specularGlossinessTexture"] = json!({"index": 0});
    let scene = scene.load().unwrap();
    assert_eq!(images(&scene)[0], [[255, 188, 137, 255]]);
    let [notice] = &scene.notices[..] else { panic!("{:?}", scene.notices) };
    assert!(notice.contains("absent.png"), "{notice}");
}

#[test]
fn textures_that_are_mapped_differently_are_not_combined() {
    for differs in
        [json!({"texCoord": 1}), json!({"extensions": {"KHR_texture_transform": {"scale": [2, 2]}}})]
    {
        let mut scene = stated(&json!({"specularFactor": [0.04, 0.04, 0.04]}));
        let diffuse = texture(&mut scene, &image(1, &[[188, 99, 0, 255]]));
        extension(&mut scene)["diffuseTexture"] = json!({"index": diffuse});
        let mut info = differs.clone();
        info["index"] = json!(diffuse);
        extension(&mut scene)["specularGlossinessTexture"] = info;
        let scene = scene.load().unwrap();
        assert_eq!(images(&scene)[0], [[188, 99, 0, 255]], "{differs}");
        assert!(
            scene
                .notices
                .iter()
                .any(|notice| notice.contains("mapped in another way") && notice.contains("'old'"))
        );
    }
}

#[test]
fn impossible_values_are_refused() {
    for (values, part) in [
        (json!({"glossinessFactor": -1}), "roughness is 2"),
        (json!({"diffuseFactor": [1, 1, 1, 2]}), "alpha is 2"),
        (json!({"diffuseTexture": {"index": 7}}), "diffuseTexture"),
    ] {
        let error = stated(&values).load().unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("materials[0]"), "{error}");
    }
}
