//! Scenes contain all that the renderer uses of a glTF file, and notices name the rest.

use std::fs;

use glam::Vec3;
use photoncard_scene::error::SceneError;
use photoncard_scene::{Material, Reflection, Scene, gltf};
use serde_json::{Value, json};

use crate::support::{glb, load_bytes, load_changed, load_with, triangle_bytes, triangle_json};

const NORMAL: Vec3 = Vec3::Z;

fn normals(scene: &Scene) -> Vec<Vec3> {
    scene.triangles.iter().map(|triangle| triangle.scaled_normal().normalize()).collect()
}

#[test]
fn a_triangle_is_loaded_as_stated() {
    let scene = load_changed(|_| {}).unwrap();
    assert_eq!(scene.triangles.len(), 1);
    assert_eq!(scene.triangles[0].vertices, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(scene.bounds(), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    let material = &scene.materials[0];
    assert_eq!(material.name, "lamp");
    let diffuse = Vec3::new(0.1, 0.2, 0.3);
    assert_eq!(material.reflection, Reflection::Phong { diffuse, specular: Vec3::ZERO, exponent: 0.0 });
    assert_eq!(material.emission, Vec3::new(4.0, 2.0, 1.0));
    assert!(!material.double_sided);
    let camera = scene.camera(None).unwrap();
    assert_eq!(camera.name, "eye");
    assert_eq!(camera.origin, Vec3::new(0.25, 0.25, 3.0));
    assert_eq!((camera.right, camera.up, camera.forward), (Vec3::X, Vec3::Y, Vec3::NEG_Z));
    assert_eq!((camera.vertical_fov(), camera.aspect), (Some(0.5), Some(1.5)));
    assert_eq!(scene.notices, Vec::<String>::new());
}

#[test]
fn every_container_gives_the_same_scene() {
    let beside = load_changed(|_| {}).unwrap();
    let binary = load_bytes("scene.glb", &glb(triangle_json(), &triangle_bytes())).unwrap();
    let inline = load_changed(|json| {
        let uri = format!("data:application/octet-stream;base64,{}", base64(&triangle_bytes()));
        json["buffers"][0]["uri"] = json!(uri);
    })
    .unwrap();
    for scene in [binary, inline] {
        assert_eq!(scene.triangles, beside.triangles);
        assert_eq!(scene.materials, beside.materials);
        assert_eq!(scene.cameras, beside.cameras);
    }
}

/// GLB requires readers to skip chunks of unknown types.
#[test]
fn unknown_chunks_of_a_glb_are_skipped() {
    let mut bytes = glb(triangle_json(), &triangle_bytes());
    bytes.extend([4, 0, 0, 0]);
    bytes.extend(b"WHATabcd");
    let length = bytes.len() as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    assert_eq!(load_bytes("scene.glb", &bytes).unwrap().triangles.len(), 1);
}

fn base64(bytes: &[u8]) -> String {
    use base64::Engine;
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

#[test]
fn indices_of_every_size_and_none_give_the_same_triangle() {
    let expected = load_changed(|_| {}).unwrap().triangles.clone();
    for (component, size) in [(5121, 1), (5123, 2), (5125, 4)] {
        let mut bytes = triangle_bytes();
        bytes.truncate(36);
        for index in 0u32..3 {
            bytes.extend(&index.to_le_bytes()[..size]);
        }
        let mut json = triangle_json();
        json["accessors"][1]["componentType"] = json!(component);
        json["bufferViews"][1]["byteLength"] = json!(3 * size);
        json["buffers"][0]["byteLength"] = json!(bytes.len());
        assert_eq!(load_with(&json, &bytes).unwrap().triangles, expected, "{size} bytes");
    }
    let plain = load_changed(|json| {
        json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    });
    assert_eq!(plain.unwrap().triangles, expected);
}

#[test]
fn interleaved_vertices_are_read_by_their_stride() {
    let mut bytes = Vec::new();
    for vertex in [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]] {
        bytes.extend(vertex.iter().flat_map(|value| value.to_le_bytes()));
        bytes.extend([0xff; 8]);
    }
    bytes.extend([0, 0, 1, 0, 2, 0]);
    let mut json = triangle_json();
    // The padding after the last element may be missing.
    json["bufferViews"] = json!([
        {"buffer": 0, "byteOffset": 0, "byteLength": 52, "byteStride": 20},
        {"buffer": 0, "byteOffset": 60, "byteLength": 6}
    ]);
    json["buffers"][0]["byteLength"] = json!(66);
    assert_eq!(load_with(&json, &bytes).unwrap().triangles, load_changed(|_| {}).unwrap().triangles);
}

#[test]
fn sparse_elements_replace_those_of_the_base_and_zeros_fill_the_rest() {
    let mut bytes = triangle_bytes();
    bytes.extend([2, 0, 0, 0]);
    bytes.extend([0f32, 2.0, 0.0].iter().flat_map(|value| value.to_le_bytes()));
    let sparse = |json: &mut Value| {
        json["buffers"][0]["byteLength"] = json!(60);
        let views = json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": 44, "byteLength": 1}));
        views.push(json!({"buffer": 0, "byteOffset": 48, "byteLength": 12}));
        json["accessors"][0]["sparse"] = json!({
            "count": 1,
            "indices": {"bufferView": 2, "componentType": 5121},
            "values": {"bufferView": 3}
        });
    };
    let mut json = triangle_json();
    sparse(&mut json);
    let scene = load_with(&json, &bytes).unwrap();
    assert_eq!(scene.triangles[0].vertices, [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 2.0, 0.0)]);
    // Without a base only one vertex is not zero.
    json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    let error = load_with(&json, &bytes).unwrap_err();
    assert!(matches!(error, SceneError::OnlyZeroArea { skipped: 1, .. }), "{error}");
}

/// glTF 2.0, 3.6.2.1: "When undefined, the accessor MUST be initialized with zeros".
#[test]
fn an_accessor_without_a_view_is_zero() {
    let without_bytes = |json: &mut Value, kind: &str| {
        let accessors = json["accessors"].as_array_mut().unwrap();
        accessors.push(json!({"componentType": 5126, "count": 3, "type": kind}));
        accessors.len() - 1
    };
    let black = load_changed(|json| {
        let index = without_bytes(json, "VEC3");
        json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(index);
    })
    .unwrap();
    assert_eq!(black.attributes[0].colours, [[0.0, 0.0, 0.0, 1.0]; 3]);
    let moving_nothing = load_changed(|json| {
        let index = without_bytes(json, "VEC3");
        json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": index}]);
    })
    .unwrap();
    assert_eq!(moving_nothing.triangles, load_changed(|_| {}).unwrap().triangles);
}

#[test]
fn nodes_place_meshes_by_matrix_or_by_parts_through_their_parents() {
    let scene = load_changed(|json| {
        json["nodes"] = json!([
            {"children": [2], "translation": [10, 0, 0], "scale": [2, 2, 2]},
            {"camera": 0},
            {"mesh": 0, "rotation": [0, 0, std::f32::consts::FRAC_1_SQRT_2, std::f32::consts::FRAC_1_SQRT_2]},
            {"mesh": 0, "matrix": [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 5, 1]}
        ]);
        json["scenes"] = json!([{"nodes": [0, 1, 3]}]);
    })
    .unwrap();
    assert_eq!(scene.triangles.len(), 2);
    let expected = [
        [Vec3::new(10.0, 0.0, 0.0), Vec3::new(10.0, 2.0, 0.0), Vec3::new(8.0, 0.0, 0.0)],
        [Vec3::new(0.0, 0.0, 5.0), Vec3::new(0.0, 0.0, 4.0), Vec3::new(0.0, 1.0, 5.0)],
    ];
    for (triangle, expected) in scene.triangles.iter().zip(expected) {
        for (vertex, expected) in triangle.vertices.iter().zip(expected) {
            assert!(vertex.distance(expected) < 1e-5, "{vertex} {expected}");
        }
    }
}

#[test]
fn an_object_is_a_node_with_triangles() {
    let scene = load_changed(|json| {
        json["nodes"] = json!([
            {"name": "parent", "children": [2]},
            {"camera": 0},
            {"mesh": 0},
            {"name": "chair", "mesh": 0},
            {"name": "table", "mesh": 0}
        ]);
        json["scenes"] = json!([{"nodes": [4, 0, 1, 3]}]);
    })
    .unwrap();
    let names = scene.triangles.iter().map(|triangle| &*scene.objects[triangle.object as usize]);
    assert!(names.eq(["table", "node 2", "chair"]));
}

/// A mirroring transform flips the winding, so that the front stays on the side of the normal.
#[test]
fn mirrored_nodes_keep_their_front() {
    for (scale, normal) in [
        ([-1.0, 1.0, 1.0], NORMAL),
        ([1.0, -1.0, 1.0], NORMAL),
        ([1.0, 1.0, -1.0], -NORMAL),
        ([-1.0, -1.0, 1.0], NORMAL),
        ([-2.0, -2.0, -2.0], -NORMAL),
    ] {
        let scene = load_changed(|json| json["nodes"][0]["scale"] = json!(scale)).unwrap();
        assert_eq!(normals(&scene), [normal], "{scale:?}");
    }
}

#[test]
fn only_the_default_scene_is_loaded() {
    let two = |json: &mut Value| json["scenes"] = json!([{"nodes": [1]}, {"nodes": [0, 1]}]);
    let second = load_changed(|json| {
        two(json);
        json["scene"] = json!(1);
    });
    assert_eq!(second.unwrap().triangles.len(), 1);
    let first = load_changed(|json| {
        two(json);
        json.as_object_mut().unwrap().remove("scene");
    });
    assert!(matches!(first, Err(SceneError::NoGeometry { .. })));
}

#[test]
fn triangles_of_no_area_are_counted_and_left_out() {
    let mut bytes = triangle_bytes();
    bytes[42..44].copy_from_slice(&[0, 0]);
    bytes.extend([0, 0, 1, 0]);
    let mut json = triangle_json();
    json["accessors"][1]["count"] = json!(6);
    json["bufferViews"][1]["byteLength"] = json!(12);
    json["buffers"][0]["byteLength"] = json!(48);
    let scene = load_with(&json, &bytes).unwrap();
    assert_eq!((scene.triangles.len(), scene.skipped_triangles), (1, 1));
}

#[test]
fn a_phong_lobe_in_extras_is_loaded() {
    let scene = load_changed(|json| {
        let phong = json!({"specular": [0.1, 0.2, 0.3], "exponent": 32});
        json["materials"][0]["extras"] = json!({"other": 1, "photoncard": {"phong": phong}});
        json["materials"][0]["doubleSided"] = json!(true);
        json["materials"][0]["extensions"].as_object_mut().unwrap().remove("KHR_materials_specular");
    })
    .unwrap();
    let material = &scene.materials[0];
    let Reflection::Phong { specular, exponent, .. } = material.reflection else { panic!("{material:?}") };
    assert_eq!((specular, exponent), (Vec3::new(0.1, 0.2, 0.3), 32.0));
    assert!(material.double_sided);
    assert!(scene.notices.is_empty(), "{:?}", scene.notices);
    for extras in [json!("text"), json!([1, 2]), json!({"photoncard": {}}), json!(null)] {
        let scene = load_changed(|json| json["materials"][0]["extras"] = extras).unwrap();
        let reflection = scene.materials[0].reflection;
        assert!(matches!(reflection, Reflection::Phong { specular: Vec3::ZERO, .. }), "{reflection:?}");
    }
}

#[test]
fn a_primitive_without_a_material_has_the_default_one() {
    let scene = load_changed(|json| {
        let mut bare = json["meshes"][0]["primitives"][0].clone();
        bare.as_object_mut().unwrap().remove("material");
        json["meshes"][0]["primitives"].as_array_mut().unwrap().push(bare);
    })
    .unwrap();
    let material = &scene.materials[scene.triangles[1].material as usize];
    let white_metal = Reflection::MetallicRoughness {
        base_colour: Vec3::ONE,
        metallic: 1.0,
        roughness: 1.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    assert_eq!(material, &Material::new("default", white_metal));
    assert_eq!(scene.notices, Vec::<String>::new());
}

#[test]
fn a_scene_without_a_camera_is_framed_and_says_so() {
    for aspect in [1.0, 20.0, 0.05] {
        let scene = load_changed(|json| {
            json["nodes"] = json!([{"mesh": 0, "translation": [5, -3, 2], "scale": [aspect, 1, 1]}, {}]);
            json["cameras"] = json!([]);
        })
        .unwrap();
        let camera = scene.camera(Some("framed")).unwrap();
        let half = (0.5 * camera.vertical_fov().unwrap()).tan();
        for vertex in scene.triangles.iter().flat_map(|triangle| triangle.vertices) {
            let seen = vertex - camera.origin;
            let depth = seen.dot(camera.forward);
            assert!(depth > 0.0);
            assert!(seen.dot(camera.right).abs() <= half * depth, "{vertex}");
            assert!(seen.dot(camera.up).abs() <= half * depth, "{vertex}");
        }
        assert_eq!(scene.notices.len(), 1, "{:?}", scene.notices);
        assert!(scene.notices[0].contains("framed"), "{:?}", scene.notices);
    }
}

#[test]
fn cameras_are_found_by_name_and_have_unit_axes() {
    let scene = load_changed(|json| {
        json["nodes"] = json!([
            {"mesh": 0},
            {"camera": 0, "scale": [2, 3, 4]},
            {"name": "second", "camera": 0, "matrix": [0, 0, -1, 0, 0.5, 1, 0, 0, 1, 0, 0, 0, 0, 0, 5, 1]}
        ]);
        json["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    })
    .unwrap();
    assert_eq!(scene.camera(Some("eye")).unwrap().forward, Vec3::NEG_Z);
    for camera in &scene.cameras {
        for axis in [camera.right, camera.up, camera.forward] {
            assert!((axis.length() - 1.0).abs() < 1e-6);
        }
        assert!(camera.right.cross(camera.up).distance(-camera.forward) < 1e-6);
    }
    assert!(scene.camera(Some("second")).unwrap().forward.distance(Vec3::NEG_X) < 1e-6);
    let error = scene.camera(Some("third")).unwrap_err();
    let help = miette::Diagnostic::help(&error).unwrap().to_string();
    assert!(help.contains("'eye'") && help.contains("'second'"), "{help}");
}

/// Each unused feature gives exactly one notice that names its location.
#[test]
fn each_unused_feature_is_named_once() {
    type Change = fn(&mut Value);
    let cases: [(&str, &str, Change); 11] = [
        ("occlusion textures", "'lamp'", |json| {
            json["textures"] = json!([{"source": 0}]);
            json["images"] = json!([{"uri": "absent.png"}]);
            json["materials"][0]["occlusionTexture"] = json!({"index": 0});
        }),
        ("emissive textures", "'lamp'", |json| {
            json["textures"] = json!([{"source": 0}]);
            json["images"] = json!([{"uri": "absent.png"}]);
            json["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
            json["materials"][0]["emissiveTexture"] = json!({"index": 0});
        }),
        ("unlit", "'lamp'", |json| {
            json["extensionsRequired"] = json!(["KHR_materials_unlit"]);
            json["materials"][0]["extensions"]["KHR_materials_unlit"] = json!({});
        }),
        ("points and lines", "'panel'", |json| {
            let mut lines = json["meshes"][0]["primitives"][0].clone();
            lines["mode"] = json!(1);
            json["meshes"][0]["primitives"].as_array_mut().unwrap().push(lines);
        }),
        ("animations", "'spin'", |json| {
            json["animations"] = json!([{"name": "spin", "channels": [], "samplers": []}]);
        }),
        ("without positions", "'panel'", |json| {
            json["meshes"][0]["primitives"].as_array_mut().unwrap().push(json!({"attributes": {}}));
        }),
        ("vertex attributes", "'panel'", |json| {
            json["meshes"][0]["primitives"][0]["attributes"]["OTHER"] = json!(0);
        }),
        ("range of lights", "'bulb'", |json| {
            let lights = json!([{"name": "bulb", "type": "point", "range": 3}, {"type": "point"}]);
            json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
        }),
        ("KHR_materials_iridescence", "'lamp'", |json| {
            json["materials"][0]["extensions"]["KHR_materials_iridescence"] = json!({});
        }),
        ("KHR_materials_dispersion", "KHR_materials_dispersion", |json| {
            json["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_materials_dispersion"));
        }),
        ("no camera", "framed", |json| {
            json["nodes"][1].as_object_mut().unwrap().remove("camera");
        }),
    ];
    for (what, place, change) in cases {
        let scene = load_changed(change).unwrap_or_else(|error| panic!("{what}: {error}"));
        let said = [&scene.notices[..], &scene.remarks[..]].concat();
        let [notice] = &said[..] else { panic!("{what}: {said:?}") };
        assert!(notice.contains(what) && notice.contains(place), "{what}: {notice}");
    }
}

#[test]
fn a_buffer_in_a_folder_below_is_found_by_its_escaped_name() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("sub")).unwrap();
    fs::write(folder.path().join("sub/my data.bin"), triangle_bytes()).unwrap();
    let mut json = triangle_json();
    json["buffers"][0]["uri"] = json!("sub/my%20data.bin");
    let path = folder.path().join("scene.gltf");
    fs::write(&path, json.to_string()).unwrap();
    assert_eq!(gltf::load(&path).unwrap().triangles.len(), 1);
}
