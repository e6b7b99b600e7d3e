//! Files that glTF 2.0 allows but the types of the `gltf` crate reject are loaded; invalid ones are refused
//! with their JSON path.

use glam::Vec3;
use photoncard_scene::error::SceneError;
use photoncard_scene::{Concern, Lens, Projection, Scene};
use photoncard_shared::message;
use serde_json::{Value, json};

use crate::support::{glb, load_bytes, load_changed, load_with, push, triangle_bytes, triangle_json};

type Change = fn(&mut Value);

/// Animation channel whose target is stated by an extension.
fn pointer() -> Value {
    json!({"sampler": 0, "target": {
        "path": "pointer",
        "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}
    }})
}

fn loaded(change: impl FnOnce(&mut Value)) -> Scene {
    load_changed(change).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn unusual_valid_json_is_read_like_its_usual_form() {
    let plain = loaded(|_| ());
    let cases: [(&str, Change); 6] = [
        ("a scene without nodes", |json| {
            push(json, "scenes", json!({"name": "empty"}));
        }),
        ("whole numbers with a fraction", |json| {
            json["scene"] = json!(0.0);
            json["nodes"][0]["mesh"] = json!(0.0);
            json["accessors"][0]["count"] = json!(3.0);
            json["accessors"][0]["componentType"] = json!(5126.0);
        }),
        ("null members", |json| {
            json["nodes"][0]["children"] = json!(null);
            json["materials"][0]["doubleSided"] = json!(null);
            json["accessors"][0]["normalized"] = json!(null);
        }),
        ("another path of a node", |json| {
            let channel = json!({"sampler": 0, "target": {"node": 0, "path": "visibility"}});
            json["animations"] = json!([{"channels": [channel], "samplers": [{"input": 0, "output": 0}]}]);
        }),
        ("an attribute of an extension", |json| {
            json["meshes"][0]["primitives"][0]["attributes"]["KHR_gaussian_splatting:SCALE"] = json!(0);
        }),
        ("a primitive without positions", |json| {
            let primitives = json["meshes"][0]["primitives"].as_array_mut().unwrap();
            primitives.push(json!({"attributes": {}}));
        }),
    ];
    for (what, change) in cases {
        assert_eq!(loaded(change).checksum(), plain.checksum(), "{what}");
    }
    // Chunks of all lengths, of which three in four are padded.
    for generator in ["a", "ab", "abc", "abcd"] {
        let mut json = triangle_json();
        json["asset"]["generator"] = json!(generator);
        let mut padded = glb(json, &triangle_bytes());
        let end = padded.windows(4).position(|bytes| bytes == b"BIN\0").unwrap() - 4;
        padded[..end].iter_mut().rev().take_while(|byte| **byte == b' ').for_each(|byte| *byte = 0);
        assert_eq!(load_bytes("scene.glb", &padded).unwrap().checksum(), plain.checksum(), "{generator}");
    }
}

#[test]
fn channels_of_extensions_are_left_out_and_the_others_stay() {
    let scene = loaded(|json| {
        let stays = json!({"sampler": 0, "target": {"node": 1, "path": "translation"}});
        let samplers = json!([{"input": 0, "output": 0}]);
        json["animations"] = json!([
            {"name": "glow", "channels": [pointer()], "samplers": samplers},
            {"name": "both", "channels": [pointer(), stays], "samplers": samplers}
        ]);
        json["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_animation_pointer"));
    });
    let said = scene.notices.join("; ");
    assert!(said.contains("'glow', 'both'") && said.contains("KHR_animation_pointer"), "{said}");
    // A picture of the scene at rest plays no animation.
    assert_eq!(scene.notices_on(|concern| concern != Concern::Animations), Vec::<&str>::new());
    let sky = loaded(|json| json["extensionsUsed"] = json!(["EXT_lights_image_based", "EXT_other"]));
    let alone = sky.notices_on(|concern| concern != Concern::Environment);
    assert!(sky.notices.len() == 2 && alone.len() == 1 && alone[0].contains("EXT_other"), "{alone:?}");
    // A path that no extension of its channel defines is a mistake.
    let mistaken = loaded(|json| {
        let channel = json!({"sampler": 0, "target": {"node": 0, "path": "rotaton"}});
        let samplers = json!([{"input": 0, "output": 0}]);
        json["nodes"][0]["name"] = json!("lid");
        json["animations"] = json!([{"channels": [pointer(), channel], "samplers": samplers}]);
    });
    let said = mistaken.notices.join("; ");
    let parts = ["none of glTF 2.0", "'rotaton' of node 'lid' (animations[0].channels[1])", "'animation 0'"];
    assert!(mistaken.notices.len() == 2 && parts.iter().all(|part| said.contains(part)), "{said}");
    // A target without a node and without an extension is a mistake, too.
    let aimless = loaded(|json| {
        let channel = json!({"sampler": 0, "target": {"path": "translation"}});
        let samplers = json!([{"input": 0, "output": 0}]);
        json["animations"] = json!([{"name": "lost", "channels": [channel], "samplers": samplers}]);
    });
    let said = aimless.notices.join("; ");
    assert!(
        aimless.notices.len() == 1 && said.contains("is no node are ignored: animation 'lost'"),
        "{said}"
    );
    let named = loaded(|json| {
        let channel = json!({"sampler": 0, "target": {"path": "scale", "extensions": {}}});
        json["animations"] = json!([{"channels": [channel], "samplers": [{"input": 0, "output": 0}]}]);
    });
    assert!(named.notices.concat().contains("is no node"), "{:?}", named.notices);
    let required = load_changed(|json| json["extensionsRequired"] = json!(["KHR_animation_pointer"]));
    assert!(matches!(required, Err(SceneError::RequiredExtension { .. })));
}

#[test]
fn json_that_violates_the_schema_is_named_by_its_place() {
    let cases: [(&str, &str, Change); 8] = [
        ("scene", "invalid type", |json| json["scene"] = json!("first")),
        ("textures", "no list", |json| json["textures"] = json!({})),
        ("asset", "version", |json| json["asset"] = json!({})),
        ("cameras[0]", "znear", |json| json["cameras"][0]["perspective"] = json!({"yfov": 1})),
        ("nodes[1]", "camera", |json| json["nodes"][1]["camera"] = json!("camera")),
        ("nodes[0]", "invalid length", |json| json["nodes"][0]["translation"] = json!([1, 2])),
        ("bufferViews[1]", "byteLength", |json| json["bufferViews"][1] = json!({"buffer": 0})),
        ("animations[0]", "samplers", |json| json["animations"] = json!([{"channels": [pointer()]}])),
    ];
    for (place, part, change) in cases {
        match load_changed(change) {
            Err(SceneError::Invalid { location, reason, .. }) => {
                assert_eq!(location.item, place);
                assert!(reason.contains(part) || part == "camera", "{place}: {reason}");
            }
            other => panic!("{place}: {:?}", other.err()),
        }
    }
    // Each key is repeated with and without a number that the `gltf` crate does not take.
    for (text, place) in [
        (r#"{"asset": {"version": "2.0"}, "nodes": [], "nodes": []}"#, "nodes"),
        (
            r#"{"asset": {"version": "2.0"}, "scene": 0.0, "nodes": [{"mesh": 0, "mesh": 1}]}"#,
            "nodes[0].mesh",
        ),
        (
            r#"{"asset": {"version": "2.0"}, "meshes": [{"primitives": [{"attributes": {"A": 0, "A": 1}}]}]}"#,
            "meshes[0].primitives[0].attributes.A",
        ),
        (
            r#"{"asset": {"version": "2.0"}, "materials": [{"extensions": {"E": {}, "E": {"a": 1}}}]}"#,
            "materials[0].extensions.E",
        ),
    ] {
        match load_bytes("scene.gltf", text.as_bytes()) {
            Err(SceneError::Invalid { location, reason, .. }) => {
                assert!(location.item == place && reason.contains("stands twice"), "{location}: {reason}");
            }
            other => panic!("{text}: {:?}", other.err()),
        }
    }
}

#[test]
fn files_of_other_kinds_are_recognised_with_a_command() {
    let refused = |name: &str, bytes: &[u8], parts: &[&str]| {
        let error = load_bytes(name, bytes).err().unwrap_or_else(|| panic!("{name} was loaded"));
        let SceneError::OtherFormat { what, remedy, .. } = &error else { panic!("{name}: {error}") };
        let text = format!("{what}; {remedy}");
        assert!(parts.iter().all(|part| text.contains(part)), "{name}: {text}");
    };
    refused("a.blend", b"BLENDER-v405", &["Blender", "blender -b", "export_scene.gltf", "a.glb"]);
    refused("a b.glb", b"BLENDER17-01v0500", &["Blender", "a b.glb'"]);
    refused("a.fbx", b"Kaydara FBX Binary  \0", &["FBX", "import_scene.fbx"]);
    refused("a.obj", b"v 0 0 0\n", &["OBJ", "wm.obj_import"]);
    refused("a.usda", b"#usda 1.0\n", &["USD", "wm.usd_import"]);
    refused("a.pbrt", b"Film \"rgb\"\n", &["pbrt", "export glTF"]);
    refused("a.zip", b"PK\x03\x04..", &["ZIP", "unzip"]);
    refused("a.card", b"\x89CARD", &["prepared", "--prepared"]);
    refused("a.glb", b"photoncard prepared scene 9\n{}", &["prepared", "--prepared", "/a.glb"]);
    refused("a.bin", b"photoncard part 2\n{}\n", &["part of a picture", "photoncard merge", "/a.bin"]);
    refused("a.data", b"photoncard partial render 5\n{}\n", &["finished tiles", " OUT.exr --resume"]);
    refused("a.exr.partial", b"photoncard partial render 5\n{}\n", &["finished tiles", "/a.exr --resume"]);
    refused(
        "a.gltf",
        br#"{"asset": {"version": "1.0"}, "nodes": {"n": {}}}"#,
        &["glTF 1.0", "gltf-pipeline", "a.2.glb"],
    );
    refused("a.exr", b"\x76\x2f\x31\x01", &["picture", "--environment"]);
    // Whatever its name, a scene is read.
    let text = serde_json::to_vec(&triangle_json()).unwrap();
    let unnamed = load_bytes("scene.obj", &text).unwrap_err();
    assert!(unnamed.to_string().contains("data.bin"), "{unnamed}");
    let folder = tempfile::tempdir().unwrap();
    let refused = |path: &std::path::Path| match photoncard_scene::gltf::load(path) {
        Err(SceneError::OtherFormat { remedy, .. }) => remedy,
        other => panic!("{:?}", other.err()),
    };
    assert!(refused(folder.path()).contains(".gltf or .glb"));
    std::fs::write(folder.path().join("room.glb"), "").unwrap();
    assert!(refused(folder.path()).contains("room.glb"));
    let address = refused("https://example.org/a/duck.glb?v=1".as_ref());
    assert!(address.contains("curl -L -o duck.glb 'https://example.org/a/duck.glb?v=1'"), "{address}");
}

/// A file with one camera, whose object is `camera`.
fn of_camera(camera: Value) -> Result<Scene, SceneError> {
    let mut json = triangle_json();
    json["cameras"][0] = camera;
    load_with(&json, &triangle_bytes())
}

#[test]
fn an_orthographic_camera_shows_its_extents() {
    let of_extents = |xmag: f32, ymag: f32| {
        let extents = json!({"xmag": xmag, "ymag": ymag, "znear": 0.1, "zfar": 9});
        of_camera(json!({"name": "plan", "type": "orthographic", "orthographic": extents}))
    };
    for (xmag, ymag) in [(3.0, 1.5), (-3.0, 1.5), (3.0, -1.5)] {
        let camera = of_extents(xmag, ymag).unwrap().cameras.remove(0);
        assert_eq!(camera.projection, Projection::Orthographic { half_height: 1.5 });
        assert_eq!((camera.origin, camera.size(512)), (Vec3::new(0.25, 0.25, 3.0), Some((512, 256))));
        let message::Camera { right, up, projection, .. } = camera.of_frame(512, 256);
        assert_eq!((right, up), ([3.0, 0.0, 0.0], [0.0, 1.5, 0.0]));
        assert_eq!(projection, message::Projection::Orthographic);
    }
    for (xmag, ymag, field) in [(0.0, 1.0, "xmag"), (1.0, 0.0, "ymag"), (1e38, 1e-38, "")] {
        let error = of_extents(xmag, ymag).unwrap_err().to_string();
        assert!(error.contains("cameras[0].orthographic") && error.contains(field), "{error}");
    }
}

#[test]
fn extras_of_a_camera_state_what_gltf_lacks() {
    let of_extras = |extras: Value| {
        let perspective = json!({"yfov": 1.0, "znear": 0.1, "aspectRatio": 2.0});
        let camera = json!({"type": "perspective", "perspective": perspective, "extras": extras});
        of_camera(camera).map(|mut scene| scene.cameras.remove(0))
    };
    for extras in [json!(null), json!(3), json!({"other": {"shift": 1}}), json!({"photoncard": {}})] {
        let camera = of_extras(extras).unwrap();
        assert_eq!((camera.shift, camera.lens), ([0.0; 2], None));
    }
    let camera =
        of_extras(json!({"photoncard": {"shift": [0.1, -0.2], "aperture": 0.02, "focus": 2.5}})).unwrap();
    assert_eq!((camera.shift, camera.lens), ([0.1, -0.2], Some(Lens { radius: 0.01, focus: 2.5 })));
    // A quarter of 36 mm is half the height of the sensor; f/2 opens half of the focal length.
    let radius = 0.25 * 0.009 / 0.5_f32.tan();
    let Lens { radius: found, .. } =
        of_extras(json!({"photoncard": {"aperture": "f/2", "focus": 1}})).unwrap().lens.unwrap();
    assert!((found / radius - 1.0).abs() < 1e-6, "{found} {radius}");
    let around = of_extras(json!({"photoncard": {"panorama": [360, 180]}})).unwrap();
    assert_eq!((around.projection.name(), around.size(512)), ("panorama", Some((512, 256))));
    for (extras, part) in [
        (json!({"aperture": "f/0", "focus": 1}), "f/2.8"),
        (json!({"aperture": -1, "focus": 1}), "f/2.8"),
        (json!({"aperture": 0.01}), "focus"),
        (json!({"focus": 2}), "needs an aperture"),
        (json!({"aperture": [1], "focus": 2}), "f/2.8"),
        (json!({"shift": [1e38, 0]}), "up to 1e6"),
        (json!({"aperture": 0.01, "focus": 0}), "from 1e-6"),
        (json!({"panorama": [400, 180]}), "360"),
        (json!({"panorama": [360, 180], "shift": [0.1, 0]}), "no lens shift"),
        (json!({"panorama": [360, 180], "aperture": 0.1, "focus": 1}), "perspective"),
        (json!({"shift": [0.1]}), "length"),
        (json!({"sift": [0.1, 0.2]}), "sift"),
    ] {
        let error = of_extras(json!({"photoncard": extras})).unwrap_err().to_string();
        assert!(error.contains("cameras[0].extras.photoncard") && error.contains(part), "{error}");
    }
}

/// Loads a scene of this text, with the bytes of the triangle beside it.
fn load_text(text: &str) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("data.bin"), triangle_bytes()).unwrap();
    std::fs::write(folder.path().join("scene.gltf"), text).unwrap();
    photoncard_scene::gltf::load(&folder.path().join("scene.gltf"))
}

/// `extras` may contain JSON that `serde_json::Value` cannot hold, in files that are amended, too.
#[test]
fn contents_of_extras_are_free() {
    let deep = "[".repeat(200) + &"]".repeat(200);
    for contents in ["1e999", r#""\ud800""#, &deep, r#"{"a": 1, "a": 2}"#] {
        for is_amended in [false, true] {
            let mut json = triangle_json();
            if is_amended {
                json["scenes"].as_array_mut().unwrap().push(json!({}));
            }
            json["extras"] = json!("contents");
            let text = json.to_string().replace("\"contents\"", contents);
            let loaded = load_text(&text);
            assert!(loaded.is_ok(), "{contents}, {is_amended}: {:?}", loaded.err());
            let repeated = text.replace("\"meshes\":", "\"meshes\": [], \"meshes\":");
            let Err(SceneError::Invalid { location, .. }) = load_text(&repeated) else {
                panic!("{contents}")
            };
            assert_eq!(location.item, "meshes");
        }
    }
}

/// A buffer that nothing uses may be absent, or belong to an extension.
#[test]
fn buffers_without_use_are_not_read() {
    for buffer in [json!({"byteLength": 10}), json!({"byteLength": 10, "uri": "absent.bin"})] {
        let scene = loaded(|json| {
            push(json, "buffers", buffer);
        });
        assert_eq!(scene.notices, Vec::<String>::new());
    }
}
