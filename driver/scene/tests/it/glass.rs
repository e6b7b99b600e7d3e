//! Glass in glTF files is solid or thin-walled according to the shape of each mesh, even if meshes share a
//! material.

use photoncard_scene::{Reflection, Scene, Transmission};
use serde_json::{Value, json};

use crate::support::{Extended, push};

const BLENDER: &str = "Khronos glTF Blender I/O v5.0.21";

const CORNERS: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
const SOLID: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

/// Scene of triangle meshes, 3 m apart, that share one glass material with the extension `volume`.
fn glass(generator: &str, volume: &Value, meshes: &[&[[usize; 3]]]) -> Scene {
    let mut file = Extended::new();
    let json = &mut file.json;
    json["asset"]["generator"] = json!(generator);
    push(json, "extensionsUsed", json!("KHR_materials_transmission"));
    push(json, "extensionsUsed", json!("KHR_materials_volume"));
    let mut extensions = json!({"KHR_materials_transmission": {"transmissionFactor": 1.0}});
    if !volume.is_null() {
        extensions["KHR_materials_volume"] = volume.clone();
    }
    let pbr = json!({"metallicFactor": 0.0, "roughnessFactor": 0.0});
    let material = push(
        json,
        "materials",
        json!({"name": "glass", "pbrMetallicRoughness": pbr, "extensions": extensions}),
    );
    for (index, triangles) in meshes.iter().enumerate() {
        let corners: Vec<[f32; 3]> = triangles.iter().flatten().map(|&corner| CORNERS[corner]).collect();
        let positions = file.floats("VEC3", &corners);
        let accessor = &mut file.json["accessors"][positions];
        (accessor["min"], accessor["max"]) = (json!([0, 0, 0]), json!([1, 1, 1]));
        let primitive = json!({"attributes": {"POSITION": positions}, "material": material});
        let mesh = push(&mut file.json, "meshes", json!({"primitives": [primitive]}));
        let translation = json!([3.0 * (index + 1) as f32, 0.0, 0.0]);
        let node = push(&mut file.json, "nodes", json!({"mesh": mesh, "translation": translation}));
        file.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }
    file.load().unwrap_or_else(|error| panic!("{error}"))
}

/// Transmission of every glass triangle.
fn transmissions(scene: &Scene) -> Vec<Transmission> {
    let of = |material: u32| match scene.materials[material as usize].reflection {
        Reflection::MetallicRoughness { transmission, .. } => transmission,
        Reflection::Phong { .. } => None,
    };
    scene.triangles.iter().filter_map(|triangle| of(triangle.material)).collect()
}

fn volumes(scene: &Scene) -> Vec<bool> {
    transmissions(scene).iter().map(|transmission| transmission.is_volume).collect()
}

#[test]
fn a_closed_part_of_a_blender_mesh_is_solid_beside_a_sheet_of_its_material() {
    let alone = glass(BLENDER, &Value::Null, &[&SOLID]);
    assert_eq!((volumes(&alone), alone.materials.len()), (vec![true; 4], 2));
    for (meshes, expected) in [
        (&[&SOLID[..], &SOLID[..1]], [true, true, true, true, false].to_vec()),
        (&[&SOLID[..2], &SOLID[..]], [false, false, true, true, true, true].to_vec()),
    ] {
        let mixed = glass(BLENDER, &Value::Null, meshes);
        assert_eq!((volumes(&mixed), mixed.materials.len()), (expected, 3));
        let [notice] = &mixed.remarks[..] else { panic!("{:?}", mixed.remarks) };
        assert!(notice.contains("solid") && notice.contains("'glass'"), "{notice}");
        assert!(mixed.materials[1..].iter().all(|material| material.name == "glass"), "--set names both");
    }
}

#[test]
fn solids_of_other_programs_are_thin_walls_without_a_thickness() {
    let scene = glass("another", &Value::Null, &[&SOLID, &SOLID[..1]]);
    assert_eq!((volumes(&scene), scene.remarks.len()), (vec![false; 5], 0));
}

#[test]
fn a_flat_sheet_with_a_thickness_is_a_thin_wall_beside_a_solid() {
    let volume = |thickness: f32| {
        let colour = [0.5, 1.0, 0.25];
        json!({"thicknessFactor": thickness, "attenuationDistance": 0.1, "attenuationColor": colour})
    };
    for generator in [BLENDER, "another"] {
        let scene = glass(generator, &volume(0.05), &[&SOLID, &SOLID[..1]]);
        assert_eq!(volumes(&scene), [true, true, true, true, false]);
        let wall = &scene.materials[scene.triangles.last().unwrap().material as usize];
        let Reflection::MetallicRoughness { base_colour, .. } = wall.reflection else { panic!("{wall:?}") };
        let expected = glam::Vec3::new(0.5_f32.sqrt(), 1.0, 0.5);
        assert!((base_colour - expected).length() < 1e-6, "{base_colour}");
        let [notice] = &scene.remarks[..] else { panic!("{:?}", scene.remarks) };
        assert!(notice.contains("flat sheets") && notice.contains("'glass'"), "{notice}");
    }
}

/// A water surface whose thickness is the depth of the water does not become a thin wall.
#[test]
fn a_sheet_of_great_thickness_and_an_open_mesh_stay_surfaces_of_a_volume() {
    let volume = |thickness: f32| json!({"thicknessFactor": thickness});
    for (thickness, mesh) in [(1.0, &SOLID[..1]), (0.01, &SOLID[..2])] {
        let scene = glass("another", &volume(thickness), &[mesh]);
        assert!(volumes(&scene).iter().all(|is_volume| *is_volume));
        let [notice] = &scene.remarks[..] else { panic!("{:?}", scene.remarks) };
        assert!(notice.contains("open meshes") && notice.contains("'glass'"), "{notice}");
    }
}
