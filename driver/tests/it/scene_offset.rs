//! Scenes far from the origin of their file equal those at the origin, and keep the file's coordinates
//! outside.

use glam::{DVec3, Vec3};
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::gltf::{LoadSettings, Moment, SceneFile};
use photoncard_driver::scene::{PunctualKind, Scene};
use serde_json::{Value, json};

use crate::support::{Extended, glb, load_bytes, push};

/// Triangle, camera and point light, each placed by a node of its own.
fn room() -> Value {
    let mut json = crate::support::triangle_json();
    json["nodes"][0]["translation"] = json!([0.1, 0.0, -0.3]);
    let lamp = json!({"translation": [0.2, 1.7, 0.4], "extensions": {"KHR_lights_punctual": {"light": 0}}});
    let node = push(&mut json, "nodes", lamp);
    push(&mut json["scenes"][0], "nodes", json!(node));
    json["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_lights_punctual"));
    json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"name": "bulb", "type": "point", "intensity": 2.0}]}});
    json
}

/// The room with all its nodes below one translated node.
fn wrapped(offset: DVec3) -> Value {
    let mut json = room();
    let children = json["scenes"][0]["nodes"].clone();
    let node = push(&mut json, "nodes", json!({"translation": offset.to_array(), "children": children}));
    json["scenes"][0]["nodes"] = json!([node]);
    json
}

/// The room with all its nodes translated, by decimal numbers.
fn moved(offset: DVec3) -> Value {
    let mut json = room();
    for node in json["nodes"].as_array_mut().unwrap() {
        for (axis, value) in node["translation"].as_array_mut().unwrap().iter_mut().enumerate() {
            let sum = format!("{:.6}", value.as_f64().unwrap() + offset[axis]);
            *value = json!(sum.parse::<f64>().unwrap());
        }
    }
    json
}

fn load(json: Value) -> Scene {
    load_bytes("scene.glb", &glb(json, &crate::support::triangle_bytes())).unwrap()
}

fn assert_equal(found: &Scene, expected: &Scene, offset: DVec3) {
    assert_eq!(found.offset, offset);
    assert_eq!((&found.triangles, &found.lights), (&expected.triangles, &expected.lights), "{offset}");
    assert_eq!(found.cameras, expected.cameras, "{offset}");
}

#[test]
fn a_room_far_from_the_origin_equals_one_at_the_origin() {
    let expected = load(room());
    assert_eq!(expected.offset, DVec3::ZERO);
    for offset in [
        DVec3::new(1e4, 0.0, -1e4),
        DVec3::new(-1e5, 0.0, 0.0),
        DVec3::new(5e6, 2e3, 4e6),
        DVec3::new(131_072.0, 0.0, -65_536.0),
    ] {
        assert_equal(&load(wrapped(offset)), &expected, offset);
        assert_equal(&load(moved(offset)), &expected, offset);
    }
    let whole = DVec3::new(12_345.0, 0.0, -77_777.0);
    assert_equal(&load(wrapped(whole)), &expected, whole);
}

#[test]
fn an_offset_in_the_vertices_is_taken_off() {
    let expected = load(crate::support::triangle_json());
    for offset in [10_000.0_f32, -131_072.0, 5e6] {
        let mut json = crate::support::triangle_json();
        json["nodes"][1]["translation"] = json!([f64::from(offset) + 0.25, 0.25, 3.0]);
        let corners = [[offset, 0.0, 0.0], [offset + 1.0, 0.0, 0.0], [offset, 1.0, 0.0]];
        let mut bytes: Vec<u8> =
            corners.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        bytes.extend(&crate::support::triangle_bytes()[36..]);
        let found = load_bytes("scene.glb", &glb(json, &bytes)).unwrap();
        assert_equal(&found, &expected, DVec3::X * f64::from(offset));
    }
}

#[test]
fn coordinates_outside_are_the_files() {
    let offset = DVec3::new(5e6, 0.0, -1e5);
    let mut scene = load(moved(offset));
    assert_eq!(scene.in_file(scene.cameras[0].origin), DVec3::new(5_000_000.25, 0.25, -99_997.0));
    let settings = RenderSettings::default().with(|settings| {
        settings.picture.camera_at = Some([5_000_000.1, 1.5, -99_998.2]);
        settings.picture.look_at = Some([5_000_000.1, 1.5, -100_000.0]);
    });
    let camera = settings.camera(&scene).unwrap();
    assert_eq!((camera.origin, camera.forward), (Vec3::new(0.1, 1.5, 1.8), Vec3::NEG_Z));
    scene.apply("bulb.position=5000000.7,1,-100000.3").unwrap();
    assert_eq!(scene.lights[0].kind, PunctualKind::Point { position: Vec3::new(0.7, 1.0, -0.3) });
    assert_ne!(scene.checksum(), load(room()).checksum(), "places that settings state are others");
    assert_eq!(load(room()).in_file(Vec3::new(0.1, -2.5, 1e-7)), DVec3::new(0.1, -2.5, 1e-7));
}

#[test]
fn all_moments_have_the_offset_of_the_scene_at_rest() {
    let mut file = Extended { json: moved(DVec3::X * 1e4), bytes: crate::support::triangle_bytes() };
    let times = file.floats("SCALAR", &[[0.0], [1.0]]);
    let places = file.floats("VEC3", &[[10_000.0_f32, 0.0, 0.0], [10_500.0, 0.0, 0.0]]);
    let target = json!({"node": 0, "path": "translation"});
    file.json["animations"] = json!([{
        "name": "slide",
        "samplers": [{"input": times, "output": places}],
        "channels": [{"sampler": 0, "target": target}],
    }]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, glb(file.json, &file.bytes)).unwrap();
    let moment = |seconds| Moment { animations: Vec::new(), seconds };
    let file = SceneFile::open(&path, &LoadSettings::default()).unwrap();
    // The cameras are read first, because the offset must not depend on what is read first.
    assert_eq!(file.cameras_at(&moment(1.0)).unwrap()[0].origin, Vec3::new(0.25, 0.25, 3.0));
    for (seconds, x) in [(1.0, 500.0), (0.0, 0.0), (0.5, 250.0)] {
        let scene = file.at(&moment(seconds)).unwrap();
        assert_eq!((scene.offset, scene.triangles[0].vertices[0]), (DVec3::X * 1e4, Vec3::X * x));
    }
}
