//! Notices about scenes: ignored or missing contents are reported even with `--quiet`, and are errors with
//! `--strict`.

use crate::support::{Room, scene};
use photoncard_driver::exr::{Shown, read};
use serde_json::{Value, json};

/// Small scene whose texture has a missing image file.
fn without_texture() -> Value {
    let mut scene = scene();
    scene["images"] = json!([{"uri": "absent.png"}]);
    scene["textures"] = json!([{"source": 0}]);
    scene["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    scene["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(3);
    scene["bufferViews"][0]["byteLength"] = json!(84);
    let coordinates = json!({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC2"});
    scene["accessors"].as_array_mut().unwrap().push(coordinates);
    scene
}

#[test]
fn a_missing_texture_is_reported_and_refused_with_strict() {
    let room = Room::new();
    room.write_scene("scene.gltf", &without_texture());
    let said = room.rendered("scene.gltf", &["-o", "a.exr", "--quiet"]).stderr;
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(
        said.starts_with("photoncard: ignored or missing: textures are left out")
            && said.contains("absent.png"),
        "{said}"
    );
    let arguments = ["prepare", "scene.gltf", "-o", "a.card", "--photons", "100", "--quiet"];
    let prepared = room.run(&arguments);
    assert!(prepared.status == Some(0) && prepared.stderr == said, "{}", prepared.stderr);
    let names = room.names();
    for arguments in [
        &["render", "scene.gltf", "-o", "b.exr", "--strict"][..],
        &["prepare", "scene.gltf", "-o", "b.card", "--strict", "--quiet"],
        &["render", "scene.gltf", "-o", "b.#.exr", "--strict", "--size", "8x8"],
    ] {
        let strict = room.run(arguments);
        let is_named = strict.stderr.contains("absent.png") && strict.stderr.contains("--strict");
        assert!(strict.status == Some(2) && is_named, "{arguments:?}: {}", strict.stderr);
    }
    assert_eq!(room.names(), names);
    room.write_scene("whole.gltf", &scene());
    assert_eq!(room.rendered("whole.gltf", &["-o", "a.exr", "--quiet", "--strict"]).stderr, "");
}

/// No surface is lit: the camera sees the black sky, and a one-sided floor lit from behind.
#[test]
fn a_scene_without_photons_has_a_picture() {
    let room = Room::new();
    let mut scene = scene();
    scene["meshes"][0]["primitives"].as_array_mut().unwrap().truncate(1);
    let point = json!({"lights": [{"type": "directional", "intensity": 1}]});
    scene["extensions"] = json!({"KHR_lights_punctual": point});
    scene["extensionsUsed"] = json!(["KHR_materials_specular", "KHR_lights_punctual"]);
    // Directional light from below the one-sided floor.
    let below = json!({"rotation": [1, 0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}});
    scene["nodes"].as_array_mut().unwrap().push(below);
    scene["scenes"][0]["nodes"] = json!([0, 1, 2]);
    room.write_scene("scene.gltf", &scene);
    for quality in ["paper", "good"] {
        let said = room.rendered("scene.gltf", &["-o", "a.exr", "--quality", quality]).stderr;
        assert!(said.contains("only 0 photons were stored of 10"), "{said}");
        assert!(said.contains("the picture is black: no light reaches what is seen"), "{said}");
    }
    // On a black floor no photons are stored, and the sky is still seen.
    let options = ["-o", "a.exr", "--set", "floor.diffuse=0,0,0", "--environment", "1,1,1"];
    let said = room.rendered("scene.gltf", &options).stderr;
    let picture = read(&room.path("a.exr"), Shown::Rendered).unwrap();
    assert!(picture.pixels.contains(&[1.0; 3]) && picture.pixels.contains(&[0.0; 3]), "{said}");
}

#[test]
fn strict_renders_accept_contents_that_the_command_line_replaces() {
    let room = Room::new();
    let mut bare = scene();
    bare["nodes"][1].as_object_mut().unwrap().remove("camera");
    room.write_scene("bare.gltf", &bare);
    let view = ["--camera-at", "0,1,2", "--look-at", "0,0,0"];
    let options = [&["-o", "a.exr", "--strict", "--quiet"][..], &view].concat();
    assert_eq!(room.rendered("bare.gltf", &options).stderr, "");
    let refused = room.render("bare.gltf", &["-o", "a.exr", "--strict", "--camera-at", "0,1,2"]);
    assert!(refused.status == Some(2) && refused.stderr.contains("has no camera"), "{}", refused.stderr);
}
