//! Materials of glTF and its extensions become reflections; values out of range are rejected.

use glam::Vec3;
use miette::Diagnostic;
use photoncard_scene::error::SceneError;
use photoncard_scene::gltf::{self, LoadSettings};
use photoncard_scene::{Material, Reflection, Scene, Transmission};
use serde_json::{Value, json};

use crate::support::{load_changed, push, triangle_bytes, triangle_json};

/// Material of the triangle after `change`, without the `KHR_materials_specular` that makes it Lambertian.
fn material(change: impl FnOnce(&mut Value)) -> Material {
    let scene = load_changed(|json| {
        let material = &mut json["materials"][0];
        material["extensions"].as_object_mut().unwrap().remove("KHR_materials_specular");
        material["pbrMetallicRoughness"].as_object_mut().unwrap().remove("metallicFactor");
        change(material);
    });
    scene.unwrap().materials[0].clone()
}

const BASE: Vec3 = Vec3::new(0.1, 0.2, 0.3);

fn plain() -> (Vec3, f32, f32, Vec3, Option<Transmission>) {
    (BASE, 1.0, 1.0, Vec3::splat(0.04), None)
}

fn parts(material: &Material) -> (Vec3, f32, f32, Vec3, Option<Transmission>) {
    let Reflection::MetallicRoughness { base_colour, metallic, roughness, dielectric, transmission, .. } =
        material.reflection
    else {
        panic!("{material:?}")
    };
    (base_colour, metallic, roughness, dielectric, transmission)
}

#[test]
fn a_material_is_metallic_roughness_by_default() {
    assert_eq!(parts(&material(|_| {})), plain());
    let rough = material(|material| {
        material["pbrMetallicRoughness"]["metallicFactor"] = json!(0.25);
        material["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.5);
    });
    assert_eq!(parts(&rough), (BASE, 0.25, 0.5, Vec3::splat(0.04), None));
    assert_eq!(rough.emission, Vec3::new(4.0, 2.0, 1.0));
    let lambertian = load_changed(|_| {}).unwrap().materials[0].clone();
    assert_eq!(lambertian.reflection, Material::lambertian("", BASE).reflection);
}

#[test]
fn the_reflectance_at_grazing_incidence_is_the_specular_factor() {
    let grazing = |extensions: Value| {
        let material = material(|material| {
            material["extensions"].as_object_mut().unwrap().extend(extensions.as_object().unwrap().clone());
        });
        let Reflection::MetallicRoughness { grazing, .. } = material.reflection else {
            panic!("{material:?}")
        };
        grazing
    };
    assert_eq!(grazing(json!({})), 1.0);
    assert_eq!(grazing(json!({"KHR_materials_ior": {"ior": 1.1}})), 1.0);
    assert_eq!(grazing(json!({"KHR_materials_specular": {"specularFactor": 0.25}})), 0.25);
}

#[test]
fn the_reflectance_at_normal_incidence_follows_from_ior_and_specular() {
    let dielectric = |extensions: Value| {
        parts(&material(|material| {
            let all = material["extensions"].as_object_mut().unwrap();
            all.extend(extensions.as_object().unwrap().clone());
        }))
        .3
    };
    let close = |found: Vec3, expected: Vec3| assert!(found.distance(expected) < 1e-6, "{found} {expected}");
    close(dielectric(json!({"KHR_materials_ior": {"ior": 1.0}})), Vec3::ZERO);
    close(dielectric(json!({"KHR_materials_ior": {"ior": 3.0}})), Vec3::splat(0.25));
    close(dielectric(json!({"KHR_materials_ior": {"ior": 0}})), Vec3::ONE);
    close(dielectric(json!({"KHR_materials_ior": {}})), Vec3::splat(0.04));
    let specular = json!({"specularFactor": 0.5, "specularColorFactor": [1, 2, 0.5]});
    close(dielectric(json!({"KHR_materials_specular": specular})), Vec3::new(0.02, 0.04, 0.01));
    // The colour is limited before the factor.
    let bright = json!({"specularFactor": 0.5, "specularColorFactor": [100, 1, 1]});
    close(dielectric(json!({"KHR_materials_specular": bright})), Vec3::new(0.5, 0.02, 0.02));
}

/// A `specularFactor` of 0 removes only the reflection of the dielectric part. The default metalness is 1.
#[test]
fn a_specular_factor_of_zero_leaves_the_reflection_of_metal() {
    for (factor, metallic) in [(None, 1.0), (Some(1.0), 1.0), (Some(0.25), 0.25)] {
        let metal = material(|material| {
            material["extensions"]["KHR_materials_specular"] = json!({"specularFactor": 0});
            if let Some(factor) = factor {
                material["pbrMetallicRoughness"]["metallicFactor"] = json!(factor);
            }
        });
        assert_eq!(parts(&metal), (BASE, metallic, 1.0, Vec3::ZERO, None), "{factor:?}");
    }
}

#[test]
fn transmission_is_thin_walled_or_into_a_volume() {
    let transmission = |extensions: Value| {
        parts(&material(|material| {
            material["pbrMetallicRoughness"]["roughnessFactor"] = json!(0);
            let all = material["extensions"].as_object_mut().unwrap();
            all.extend(extensions.as_object().unwrap().clone());
        }))
        .4
    };
    let wall = Transmission { factor: 0.75, ior: 1.5, is_volume: false, absorption: Vec3::ZERO };
    let part = json!({"transmissionFactor": 0.75});
    assert_eq!(transmission(json!({"KHR_materials_transmission": part})), Some(wall));
    assert_eq!(transmission(json!({"KHR_materials_transmission": {}})), None);
    // An infinite index of refraction leaves no light to transmit.
    let mirror = json!({"KHR_materials_transmission": part, "KHR_materials_ior": {"ior": 0}});
    assert_eq!(transmission(mirror), None);
    // Without a thickness the absorption of a volume is ignored.
    let thin = json!({"attenuationDistance": 1.0, "attenuationColor": [0, 0, 0]});
    let thin = json!({"KHR_materials_transmission": part, "KHR_materials_volume": thin});
    assert_eq!(transmission(thin), Some(wall));

    let absorbing = |volume: Value| {
        let extensions = json!({
            "KHR_materials_transmission": part, "KHR_materials_ior": {"ior": 1.33}, "KHR_materials_volume": volume
        });
        let found = transmission(extensions).unwrap();
        assert!(found.is_volume && found.ior == 1.33, "{found:?}");
        found.absorption
    };
    assert_eq!(absorbing(json!({"thicknessFactor": 1})), Vec3::ZERO);
    let grey = absorbing(json!({"thicknessFactor": 1, "attenuationDistance": 2.0,
                                "attenuationColor": [1, 0.5, (-4.0_f64).exp()]}));
    assert!(grey.distance(Vec3::new(0.0, 0.5 * 2_f32.ln(), 2.0)) < 1e-6, "{grey}");
    let black =
        absorbing(json!({"thicknessFactor": 1, "attenuationDistance": 2.0, "attenuationColor": [0, 0, 0]}));
    assert!(black.is_finite() && black.min_element() > 1e6, "{black}");
}

/// A `specularFactor` of 0 makes a surface Lambertian, unless it transmits light.
#[test]
fn a_specular_factor_of_zero_leaves_the_transmission_of_glass() {
    let scene = load_changed(|json| {
        json["materials"][0]["extensions"]["KHR_materials_transmission"] = json!({"transmissionFactor": 1});
    });
    let (_, _, _, dielectric, transmission) = parts(&scene.unwrap().materials[0]);
    assert_eq!((dielectric, transmission.map(|found| found.factor)), (Vec3::ZERO, Some(1.0)));
}

#[test]
fn only_a_mask_has_an_alpha_cutoff() {
    let alphas = |mode: &str, cutoff: Option<f64>| {
        let material = material(|material| {
            material["alphaMode"] = json!(mode);
            material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.1, 0.2, 0.3, 0.25]);
            if let Some(cutoff) = cutoff {
                material["alphaCutoff"] = json!(cutoff);
            }
        });
        (material.alpha, material.alpha_cutoff)
    };
    assert_eq!(alphas("MASK", None), (0.25, Some(0.5)));
    assert_eq!(alphas("MASK", Some(0.75)), (0.25, Some(0.75)));
    assert_eq!(alphas("BLEND", None), (0.25, None));
    assert_eq!(alphas("OPAQUE", None), (0.25, None));
}

#[test]
fn values_out_of_range_are_refused() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change); 10] = [
        ("metallicFactor", |material| material["pbrMetallicRoughness"]["metallicFactor"] = json!(1.5)),
        ("roughnessFactor", |material| material["pbrMetallicRoughness"]["roughnessFactor"] = json!(-0.5)),
        ("baseColorFactor", |material| {
            material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0, 0, 0, 2]);
        }),
        ("alphaCutoff", |material| {
            material["alphaMode"] = json!("MASK");
            material["alphaCutoff"] = json!(-1);
        }),
        ("KHR_materials_specular", |material| {
            material["extensions"]["KHR_materials_specular"] = json!({"specularFactor": 2});
        }),
        ("KHR_materials_specular", |material| {
            material["extensions"]["KHR_materials_specular"] = json!({"specularColorFactor": [-1, 0, 0]});
        }),
        ("transmissionFactor", |material| {
            material["extensions"]["KHR_materials_transmission"] = json!({"transmissionFactor": 2});
        }),
        ("KHR_materials_ior", |material| {
            material["extensions"]["KHR_materials_ior"] = json!({"ior": 0.5});
        }),
        ("KHR_materials_volume", |material| {
            material["extensions"]["KHR_materials_transmission"] = json!({"transmissionFactor": 1});
            let volume =
                json!({"thicknessFactor": 1, "attenuationDistance": -1, "attenuationColor": [0.5, 1, 1]});
            material["extensions"]["KHR_materials_volume"] = volume;
        }),
        ("KHR_materials_volume", |material| {
            material["extensions"]["KHR_materials_transmission"] = json!({"transmissionFactor": 1});
            let volume =
                json!({"thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": [-1, 2, 1]});
            material["extensions"]["KHR_materials_volume"] = volume;
        }),
    ];
    for (part, change) in cases {
        let loaded = load_changed(|json| {
            let material = &mut json["materials"][0];
            material["extensions"].as_object_mut().unwrap().remove("KHR_materials_specular");
            change(material);
        });
        let Err(error) = loaded else { panic!("{part} was loaded") };
        let text = error.to_string();
        assert!(text.contains("materials[0]") && text.contains(part), "{part}: {text}");
        assert!(error.help().is_some());
    }
}

/// File with two materials and two variants. One variant maps the primitive to the other material, one does
/// not map it.
fn with_variants() -> Value {
    let mut json = triangle_json();
    push(&mut json, "materials", json!({"name": "other", "emissiveFactor": [1, 1, 1]}));
    json["extensionsRequired"] = json!(["KHR_materials_variants"]);
    json["extensions"] =
        json!({"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}});
    json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}});
    json
}

fn load_variant(json: &Value, variant: Option<&str>) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("data.bin"), triangle_bytes()).unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, json.to_string()).unwrap();
    let variant = variant.map(str::to_owned);
    gltf::load_with(&path, &LoadSettings { dram_bytes: u64::MAX, variant, ..LoadSettings::default() })
}

#[test]
fn a_variant_chooses_materials() {
    let json = with_variants();
    let used = |variant| {
        let scene = load_variant(&json, variant).unwrap();
        assert_eq!((scene.variants.join(" "), scene.notices.len()), ("day night".to_owned(), 0));
        (scene.materials[scene.triangles[0].material as usize].name.clone(), scene.checksum().to_owned())
    };
    let [stated, day, night] = [None, Some("day"), Some("night")].map(used);
    assert_eq!((stated.0.as_str(), night.0.as_str()), ("lamp", "other"));
    assert_eq!(stated, day);
    assert_ne!(stated.1, night.1);
}

#[test]
fn variants_that_do_not_exist_are_refused() {
    let message = |json: &Value, name: &str| {
        let error = load_variant(json, Some(name)).unwrap_err();
        format!("{error}; {}", error.help().unwrap())
    };
    let unknown = message(&with_variants(), "dusk");
    assert!(unknown.contains("no variant 'dusk'") && unknown.contains("'day', 'night'"), "{unknown}");
    assert!(message(&triangle_json(), "dusk").contains("leave the option out"));
    let mut beyond = with_variants();
    beyond["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"]["mappings"][0]["material"] =
        json!(7);
    assert!(message(&beyond, "night").contains("material 7 does not exist"), "{}", message(&beyond, "night"));
    assert!(load_variant(&beyond, Some("day")).is_ok());
}
