//! Invalid scenes are rejected by errors that name the location and the remedy.

use std::fs;
use std::path::Path;

use glam::Vec3;
use miette::{Diagnostic, SourceCode};
use photoncard_scene::error::SceneError;
use photoncard_scene::{Environment, gltf};
use serde_json::{Value, json};

use crate::support::{glb, load_bytes, load_changed, load_with, triangle_bytes, triangle_json};

type Change = fn(&mut Value);

fn check(error: &SceneError, parts: &[&str]) {
    let text = error.to_string();
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in {text:?}");
    }
    assert!(error.help().is_some_and(|help| !help.to_string().is_empty()), "{text}: no remedy");
}

/// Checks that each change of the triangle's file gives an error whose text contains all parts.
fn refused(cases: &[(&[&str], Change)]) {
    for (parts, change) in cases {
        match load_changed(change) {
            Ok(_) => panic!("{parts:?} was loaded"),
            Err(error) => check(&error, parts),
        }
    }
}

fn floats(bytes: &mut [u8], at: usize, value: f32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

#[test]
fn missing_files_and_files_without_a_scene_are_refused() {
    let missing = gltf::load(Path::new("absent/scene.gltf")).unwrap_err();
    assert!(matches!(missing, SceneError::Unreadable { .. }));
    check(&missing, &["absent/scene.gltf"]);
    let folder = gltf::load(Path::new(".")).unwrap_err();
    assert!(matches!(folder, SceneError::OtherFormat { .. }));
    for bytes in [&b""[..], b"  \n", b"\xff\xfe\x00"] {
        let error = load_bytes("scene.gltf", bytes).unwrap_err();
        assert!(matches!(error, SceneError::NotGltf { .. }), "{error}");
    }
    for text in ["[]", "{}", "null", r#"{"asset": {}}"#, r#"{"asset": 3}"#] {
        let error = load_bytes("scene.gltf", text.as_bytes()).unwrap_err();
        assert!(matches!(error, SceneError::Invalid { .. }), "{text}: {error}");
    }
    let deep = "[".repeat(100_000);
    assert!(matches!(load_bytes("scene.gltf", deep.as_bytes()), Err(SceneError::Json { .. })));
}

#[test]
fn json_errors_point_into_the_text() {
    let text = "{\n  \"asset\": {\"version\": \"2.0\"},\n  \"scenes\": [}\n}";
    let error = load_bytes("scene.gltf", text.as_bytes()).unwrap_err();
    check(&error, &["scene.gltf", "line 3"]);
    let label = error.labels().unwrap().next().unwrap();
    let source = error.source_code().unwrap();
    let shown = source.read_span(label.inner(), 0, 0).unwrap();
    assert_eq!((shown.data(), shown.line(), shown.column()), (&b"}"[..], 2, 13));
    // A line of megabytes is shortened.
    let long = format!("{{\"asset\": {{\"version\": \"{}\"}}, }}", "ü".repeat(10_000));
    let error = load_bytes("scene.gltf", long.as_bytes()).unwrap_err();
    let SceneError::Json { text, at, .. } = &error else { panic!("{error}") };
    assert!(text.part.len() < 1000);
    let shown = text.read_span(at, 0, 0).unwrap();
    assert_eq!((shown.data(), shown.line(), shown.column()), (&b"}"[..], 0, long.len() - 1));
    check(&error, &[&format!("line 1 column {}", long.len())]);
}

#[test]
fn a_glb_cut_anywhere_is_refused() {
    let whole = glb(triangle_json(), &triangle_bytes());
    assert!(load_bytes("scene.glb", &whole).is_ok());
    for length in 4..whole.len() {
        let error = load_bytes("scene.glb", &whole[..length]).unwrap_err();
        assert!(matches!(error, SceneError::Truncated { .. }), "{length}: {error}");
    }
    let mut version = whole.clone();
    version[4] = 1;
    assert!(matches!(load_bytes("scene.glb", &version), Err(SceneError::OtherFormat { .. })));
    version[4] = 3;
    assert!(matches!(load_bytes("scene.glb", &version), Err(SceneError::NotGltf { .. })));
    let mut length = whole;
    length[8..12].copy_from_slice(&[0; 4]);
    assert!(load_bytes("scene.glb", &length).is_err());
}

#[test]
fn wrong_versions_extensions_and_indices_are_refused() {
    refused(&[
        (&["asset.version", "1.0"], |json| json["asset"]["version"] = json!("1.0")),
        (&["asset.version", "2.1"], |json| json["asset"]["minVersion"] = json!("2.1")),
        (&["extensionsRequired[0]", "VENDOR_other"], |json| {
            json["extensionsRequired"] = json!(["VENDOR_other"]);
        }),
        (&["meshes[0].primitives[0].attributes.POSITION"], |json| {
            json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(7);
        }),
        (&["no triangles"], |json| {
            json["meshes"][0]["primitives"][0]["attributes"] = json!({});
        }),
        (&["meshes[0].primitives[0].indices"], |json| {
            json["meshes"][0]["primitives"][0]["indices"] = json!(7);
        }),
        (&["meshes[0].primitives[0].material"], |json| {
            json["meshes"][0]["primitives"][0]["material"] = json!(7);
        }),
        (&["nodes[0].mesh"], |json| json["nodes"][0]["mesh"] = json!(7)),
        (&["nodes[1].camera"], |json| json["nodes"][1]["camera"] = json!(7)),
        (&["nodes[0].children[0]"], |json| json["nodes"][0]["children"] = json!([7])),
        (&["scenes[0].nodes[0]"], |json| json["scenes"][0]["nodes"] = json!([7])),
        (&["scene"], |json| json["scene"] = json!(7)),
        (&["accessors[0].bufferView"], |json| json["accessors"][0]["bufferView"] = json!(7)),
        (&["bufferViews[0].buffer"], |json| json["bufferViews"][0]["buffer"] = json!(7)),
        (&["no scene"], |json| {
            json.as_object_mut().unwrap().remove("scene");
            json["scenes"] = json!([]);
        }),
    ]);
}

#[test]
fn accessors_beyond_their_buffer_are_refused() {
    refused(&[
        (&["accessors[0]", "beyond bufferViews[0]"], |json| json["accessors"][0]["count"] = json!(4)),
        (&["accessors[0]", "beyond"], |json| json["accessors"][0]["count"] = json!(u64::MAX)),
        (&["accessors[0]", "beyond"], |json| json["accessors"][0]["byteOffset"] = json!(4)),
        (&["accessors[0]", "beyond"], |json| json["accessors"][0]["byteOffset"] = json!(u64::MAX)),
        (&["accessors[1]", "beyond"], |json| json["accessors"][1]["count"] = json!(6)),
        (&["bufferViews[0]", "beyond its buffer"], |json| json["bufferViews"][0]["byteLength"] = json!(100)),
        (&["bufferViews[0]", "beyond its buffer"], |json| {
            json["bufferViews"][0]["byteOffset"] = json!(u64::MAX);
        }),
        (&["overlap"], |json| json["bufferViews"][0]["byteStride"] = json!(8)),
        (&["byteStride"], |json| json["bufferViews"][0]["byteStride"] = json!(0)),
        (&["beyond"], |json| json["bufferViews"][0]["byteStride"] = json!(16)),
        (&["POSITION", "component type"], |json| json["accessors"][0]["componentType"] = json!(5123)),
        (&["indices", "component type"], |json| json["accessors"][1]["componentType"] = json!(5126)),
        (&["componentType"], |json| json["accessors"][0]["componentType"] = json!(1)),
        (&["POSITION", "Vec3"], |json| json["accessors"][0]["type"] = json!("VEC2")),
        (&["sparse.indices"], |json| {
            json["accessors"][0]["sparse"] = json!({
                "count": 100, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}
            });
        }),
        (&["sparse.indices", "do not increase"], |json| {
            json["accessors"][0]["sparse"] = json!({
                "count": 2, "indices": {"bufferView": 1, "componentType": 5125}, "values": {"bufferView": 0}
            });
            json["bufferViews"][1]["byteLength"] = json!(8);
        }),
        (&["more than", "triangles"], |json| {
            // All positions but a sparse one are zeros without bytes.
            json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
            json["accessors"][0]["count"] = json!(3u64 << 50);
            json["accessors"][0]["sparse"] = json!({
                "count": 1, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}
            });
            json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
        }),
    ]);
}

#[test]
fn unavailable_buffers_are_refused() {
    refused(&[
        (&["buffers[0].byteLength", "45"], |json| json["buffers"][0]["byteLength"] = json!(45)),
        (&["buffers[0]", "no uri"], |json| {
            json["buffers"][0].as_object_mut().unwrap().remove("uri");
        }),
        (&["buffers[0].uri", "base64"], |json| json["buffers"][0]["uri"] = json!("data:;base64,*")),
        (&["buffers[0].uri", "relative"], |json| json["buffers"][0]["uri"] = json!("/etc/hostname")),
        (&["buffers[0].uri", "leaves"], |json| json["buffers"][0]["uri"] = json!("../data.bin")),
        (&["buffers[0].uri", "leaves"], |json| json["buffers"][0]["uri"] = json!("%2e./data.bin")),
        (&["buffers[0].uri", "scheme"], |json| {
            json["buffers"][0]["uri"] = json!("https://example.org/data.bin");
        }),
        (&["other.bin"], |json| json["buffers"][0]["uri"] = json!("other.bin")),
    ]);
}

#[cfg(unix)]
#[test]
fn a_link_out_of_the_folder_is_not_followed() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("scene");
    fs::create_dir(&inside).unwrap();
    fs::write(folder.path().join("secret.bin"), triangle_bytes()).unwrap();
    std::os::unix::fs::symlink(folder.path().join("secret.bin"), inside.join("data.bin")).unwrap();
    fs::write(inside.join("scene.gltf"), triangle_json().to_string()).unwrap();
    let error = gltf::load(&inside.join("scene.gltf")).unwrap_err();
    check(&error, &["buffers[0].uri", "link"]);
}

#[test]
fn positions_that_are_not_finite_or_too_large_are_refused() {
    for value in [f32::NAN, f32::INFINITY, -1e30] {
        let mut bytes = triangle_bytes();
        floats(&mut bytes, 16, value);
        let error = load_with(&triangle_json(), &bytes).unwrap_err();
        assert!(matches!(error, SceneError::Vertex { vertex: 1, primitive: 0, .. }), "{error}");
        check(&error, &["meshes[0].primitives[0].attributes.POSITION", "vertex 1", "'panel'"]);
    }
    let huge = load_changed(|json| json["nodes"][0]["scale"] = json!([1e30, 1e30, 1e30])).unwrap_err();
    assert!(matches!(huge, SceneError::Vertex { .. }), "{huge}");
}

#[test]
fn an_index_beyond_the_vertices_is_named() {
    let mut bytes = triangle_bytes();
    bytes[38] = 3;
    let error = load_with(&triangle_json(), &bytes).unwrap_err();
    check(&error, &["meshes[0].primitives[0].indices", "index 1 is 3", "'panel'", "3 vertices"]);
}

#[test]
fn node_hierarchies_that_are_no_trees_are_refused() {
    refused(&[
        (&["nodes[0]", "twice"], |json| json["nodes"][0]["children"] = json!([0])),
        (&["twice"], |json| {
            json["nodes"] = json!([{"children": [2]}, {"children": [2]}, {"mesh": 0}]);
        }),
        (&["deep"], |json| {
            let chain = (0..3000).map(|i| json!({"children": [i + 1]})).chain([json!({"mesh": 0})]);
            json["nodes"] = chain.collect();
            json["scenes"][0]["nodes"] = json!([0]);
        }),
        (&["nodes[0]", "transform"], |json| json["nodes"][0]["rotation"] = json!([0, 0, 0, 0])),
        (&["out of range", "line 1"], |json| json["nodes"][0]["scale"] = json!([1e300, 1, 1])),
        (&["nodes[0]", "transform"], |json| {
            json["nodes"][0]["matrix"] = json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
        }),
    ]);
}

#[test]
fn scenes_without_light_or_geometry_are_refused() {
    refused(&[
        (&["no triangles"], |json| json["scenes"][0]["nodes"] = json!([1])),
        (&["no triangles"], |json| json["meshes"][0]["primitives"][0]["mode"] = json!(1)),
        (&["all 1 triangles have zero area"], |json| json["nodes"][0]["scale"] = json!([1, 0, 1])),
    ]);
}

#[test]
fn a_scene_without_light_loads_and_is_then_refused() {
    let dark = load_changed(|json| json["materials"][0]["emissiveFactor"] = json!([0, 0, 0])).unwrap();
    check(&dark.check_light().unwrap_err(), &["no light"]);
    let lit = dark.with(|scene| scene.environment = Some(Environment::constant(Vec3::ONE)));
    assert!(lit.check_light().is_ok());
}

#[test]
fn materials_out_of_range_are_refused() {
    refused(&[
        (&["materials[0]", "baseColorFactor", "'lamp'", "1.5"], |json| {
            json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0, 1.5, 0, 1]);
        }),
        (&["materials[0]", "baseColorFactor"], |json| {
            json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0, -0.1, 0, 1]);
        }),
        (&["materials[0].emissiveFactor", "'lamp'"], |json| {
            json["materials"][0]["emissiveFactor"] = json!([1e20, 0, 0]);
            json["materials"][0]["extensions"]["KHR_materials_emissive_strength"] =
                json!({"emissiveStrength": 1e20});
        }),
        (&["materials[0].emissiveFactor"], |json| json["materials"][0]["emissiveFactor"] = json!([-1, 0, 0])),
    ]);
    let phong: [(Value, &str); 9] = [
        (json!({"specular": [-0.1, 0, 0], "exponent": 1}), "specular"),
        (json!({"specular": [0.95, 0, 0], "exponent": 1}), "more light leaves"),
        (json!({"specular": [0, 0, 0], "exponent": -1}), "exponent"),
        (json!({"specular": [0, 0, 0], "exponent": 10001}), "exponent"),
        (json!({"specular": [0, 0, 0]}), "exponent"),
        (json!({"specular": [0, 0], "exponent": 1}), "extras.photoncard"),
        (json!({"specular": "red", "exponent": 1}), "extras.photoncard"),
        (json!({"specular": [0, 0, 0], "exponent": 1, "gloss": 1}), "gloss"),
        (json!(7), "extras.photoncard"),
    ];
    for (phong, part) in phong {
        let error =
            load_changed(|json| json["materials"][0]["extras"] = json!({"photoncard": {"phong": phong}}));
        check(&error.unwrap_err(), &["materials[0].extras", "'lamp'", part]);
    }
}

#[test]
fn cameras_without_a_valid_view_are_refused() {
    refused(&[
        (&["cameras[0].perspective.yfov"], |json| json["cameras"][0]["perspective"]["yfov"] = json!(0)),
        (&["cameras[0].perspective.yfov"], |json| json["cameras"][0]["perspective"]["yfov"] = json!(4)),
        (&["cameras[0].perspective.aspectRatio"], |json| {
            json["cameras"][0]["perspective"]["aspectRatio"] = json!(-1);
        }),
        (&["nodes[1]", "inverted"], |json| json["nodes"][1]["scale"] = json!([1, 0, 1])),
    ]);
}

#[test]
fn the_remedy_for_a_required_extension_names_those_that_are_read() {
    let error = load_changed(|json| json["extensionsRequired"] = json!(["VENDOR_other"])).unwrap_err();
    let help = error.help().unwrap().to_string();
    assert!(help.contains("without VENDOR_other") && help.contains("EXT_meshopt_compression"), "{help}");
}
