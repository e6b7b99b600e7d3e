//! Small files that describe large contents are refused with a remedy, or rendered in 4 GB of address space
//! and some seconds (docs/architecture.md, "What a file may cost").
#![cfg(unix)]

use crate::support::{Outcome, Room, glb, scene};
use serde_json::{Value, json};

/// Limit of processor time, seconds, far above what any of these files takes.
const SECONDS: u32 = 100;
const KILOBYTES: u32 = 4_000_000;

/// Runs the command with limited address space and processor time. If the time is used up, a signal ends the
/// command, and the outcome has no exit status.
fn limited(room: &Room, arguments: &[&str]) -> Outcome {
    let mut shell = std::process::Command::new("sh");
    let script = format!("ulimit -v {KILOBYTES} && ulimit -t {SECONDS} && exec \"$0\" \"$@\"");
    let command = room.command();
    shell.current_dir(room.path(".")).args(["-c", &script]).arg(command.get_program()).args(arguments);
    Outcome::of(&shell.output().unwrap())
}

/// Checks that a render of `scene.glb` is refused with these words.
fn refused(room: &Room, words: &[&str]) {
    let options = ["-o", "out.exr", "--size", "8x8", "--photons", "100", "--card-memory", "512M"];
    let outcome = limited(room, &[&["render", "scene.glb"], &options[..]].concat());
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    for word in words.iter().chain(&["scene.glb"]) {
        assert!(outcome.stderr.contains(word), "{word:?} is not in: {}", outcome.stderr);
    }
    assert_eq!(room.names(), ["scene.glb"]);
}

fn refused_scene(json: &Value, bytes: &[u8], words: &[&str]) {
    let room = Room::new();
    room.write("scene.glb", glb(&serde_json::to_vec(json).unwrap(), bytes));
    refused(&room, words);
}

/// Checks that a scene is refused if its JSON array `list` has `count` nearly empty elements.
fn refused_list(list: &str, element: &str, count: usize) {
    let room = Room::new();
    let mut elements = vec![element; count - 1].join(",");
    elements.push_str(",{}");
    room.write("scene.glb", format!("{{\"asset\": {{\"version\": \"2.0\"}}, \"{list}\": [{elements}]}}"));
    refused(&room, &["of JSON would take more than", "leave out what is empty"]);
}

/// Emissive mesh of equal primitives: all have accessor 0 for positions, and accessor `indices` for indices.
fn meshes(primitives: usize, indices: Option<usize>) -> Value {
    let mut primitive = json!({"attributes": {"POSITION": 0}, "material": 0});
    if let Some(indices) = indices {
        primitive["indices"] = json!(indices);
    }
    json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": vec![primitive; primitives]}],
        "materials": [{"emissiveFactor": [1, 1, 1]}],
    })
}

/// Positions of `count` vertices, all different, as bytes of a glTF buffer.
fn places(count: u32) -> Vec<u8> {
    let scattered = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 16_777_216.0;
    (0..3 * count).flat_map(|i| scattered(i).to_le_bytes()).collect()
}

#[test]
fn instances_are_counted_before_they_are_placed() {
    const TRIANGLES: u32 = 4096;
    const INSTANCES: usize = 4090;
    let bytes = places(3 * TRIANGLES);
    let mut scene = meshes(1, None);
    scene["accessors"] =
        json!([{"bufferView": 0, "componentType": 5126, "count": 3 * TRIANGLES, "type": "VEC3"}]);
    scene["bufferViews"] = json!([{"buffer": 0, "byteLength": bytes.len()}]);
    scene["buffers"] = json!([{"byteLength": bytes.len()}]);
    let node = |i: usize| json!({"mesh": 0, "translation": [i % 64, i / 64, 0]});
    scene["nodes"] = (0..INSTANCES).map(node).collect();
    scene["scenes"][0]["nodes"] = (0..INSTANCES).collect();
    let words =
        ["16752640 triangles", "of a card's memory or more, and the card has 536870912", "fewer instances"];
    refused_scene(&scene, &bytes, &words);
}

#[test]
fn primitives_that_share_their_indices_are_not_packed_beyond_memory() {
    const INDICES: usize = 3_000_000;
    let vertices = places(256);
    let indices = (0..INDICES as u32).map(|i| (i.wrapping_mul(2_246_822_519) >> 13) as u8);
    let bytes: Vec<u8> = vertices.iter().copied().chain(indices).collect();
    let mut scene = meshes(16, Some(1));
    scene["accessors"] = json!([
        {"bufferView": 0, "componentType": 5126, "count": 256, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5121, "count": INDICES, "type": "SCALAR"},
    ]);
    scene["bufferViews"] = json!([
        {"buffer": 0, "byteLength": vertices.len()},
        {"buffer": 0, "byteOffset": vertices.len(), "byteLength": INDICES},
    ]);
    scene["buffers"] = json!([{"byteLength": bytes.len()}]);
    let room = Room::new();
    room.write("scene.glb", glb(&serde_json::to_vec(&scene).unwrap(), &bytes));
    let outcome = limited(&room, &["render", "scene.glb", "-o", "out.exr", "--size", "8x8"]);
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    for words in ["bytes of memory, which the system does not give", "simplify", "ulimit -v"] {
        assert!(outcome.stderr.contains(words), "{}", outcome.stderr);
    }
}

#[test]
fn lists_of_nearly_empty_elements_are_not_parsed() {
    refused_list("materials", "{}", 6_000_000);
    refused_list("nodes", "{}", 16_000_000);
}

#[test]
fn texels_are_counted_before_they_are_decoded() {
    let file = |side: u32| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, side, side);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::One);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&vec![0; (side * side / 8) as usize]).unwrap();
        writer.finish().unwrap();
        bytes
    };
    let textured = |room: &Room, side| {
        room.write("image.png", file(side));
        let mut scene = scene();
        scene["materials"][1]["emissiveTexture"] = json!({"index": 0});
        scene["meshes"][0]["primitives"][1]["attributes"]["TEXCOORD_0"] = json!(3);
        scene["accessors"]
            .as_array_mut()
            .unwrap()
            .push(json!({"componentType": 5126, "count": 3, "type": "VEC2"}));
        scene["textures"] = json!([{"source": 0}]);
        scene["images"] = json!([{"uri": "image.png"}]);
        room.write_scene("scene.gltf", &scene);
        limited(room, &["scene", "info", "scene.gltf"])
    };
    let room = Room::new();
    let small = textured(&room, 4096);
    assert_eq!(small.status, Some(0), "{}", small.stderr);
    assert!(small.stdout.contains("16777216 texels"), "{}", small.stdout);
    let large = textured(&room, 16_384);
    assert_eq!(large.status, Some(2), "{}", large.stderr);
    for words in ["images and materials take 10737", "the card has 536870912", "smaller textures"] {
        assert!(large.stderr.contains(words), "{}", large.stderr);
    }
}

#[test]
fn a_file_that_many_buffers_refer_to_is_read_once() {
    let room = Room::new();
    let mut scene = scene();
    let own = scene["buffers"][0].clone();
    let itself = json!({"uri": "scene.gltf", "byteLength": 4});
    scene["buffers"] = std::iter::once(own).chain(vec![itself; 20_000]).collect();
    room.write_scene("scene.gltf", &scene);
    let outcome = limited(&room, &["scene", "info", "scene.gltf"]);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
}
