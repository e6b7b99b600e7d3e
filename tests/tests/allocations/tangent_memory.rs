//! Computing tangents takes at most the memory that was reserved for it.

use std::fs;

use photoncard_driver::scene::gltf;
use serde_json::{Value, json};

use crate::{ALONE, MEMORY};

const SIDE: u32 = 200;
const TRIANGLES: usize = (2 * SIDE * SIDE) as usize;
/// Copy of `BYTES_OF_A_TRIANGLE` of `driver::scene::gltf::mikktspace`.
const BYTES_A_TRIANGLE: usize = 1600;
const TEXEL: &[u8] = include_bytes!("../../../driver/scene/tests/it/images/texel.png");

/// Buffer of a hilly square of triangles that share no vertices, and its number of vertices.
fn mesh() -> (Vec<u8>, usize) {
    let corners = (0..SIDE * SIDE).flat_map(|cell| {
        let (x, y) = (cell % SIDE, cell / SIDE);
        [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]].map(|[right, up]| (x + right, y + up))
    });
    let place = |(x, y): (u32, u32)| [x as f32, y as f32, ((x * 7 + y * 3) % 5) as f32];
    let positions: Vec<f32> = corners.clone().flat_map(place).collect();
    let coordinates: Vec<f32> = corners.flat_map(|(x, y)| [x as f32 * 0.01, y as f32 * 0.02]).collect();
    let bytes = positions.iter().chain(&coordinates).flat_map(|value| value.to_le_bytes()).collect();
    (bytes, positions.len() / 3)
}

fn scene(count: usize, bytes: usize) -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [{}],
        "textures": [{"source": 0}],
        "images": [{"uri": "texel.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC2"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": count * 12},
            {"buffer": 0, "byteOffset": count * 12, "byteLength": count * 8}
        ],
        "buffers": [{"uri": "mesh.bin", "byteLength": bytes}]
    })
}

#[test]
fn tangents_take_no_more_memory_than_is_requested() {
    let _alone = ALONE.lock();
    let folder = tempfile::tempdir().unwrap();
    let (bytes, count) = mesh();
    fs::write(folder.path().join("mesh.bin"), &bytes).unwrap();
    fs::write(folder.path().join("texel.png"), TEXEL).unwrap();
    let peak = |json: &Value| {
        let path = folder.path().join("scene.gltf");
        fs::write(&path, json.to_string()).unwrap();
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        let scene = gltf::load(&path).unwrap();
        assert_eq!(scene.triangles.len(), TRIANGLES);
        (scene.tangents.len(), MEMORY.peak_usage() - before)
    };
    let mut plain = scene(count, bytes.len());
    plain["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0}});
    let mut mapped = scene(count, bytes.len());
    mapped["materials"][0]["normalTexture"] = json!({"index": 0});
    let ((none, without), (all, with)) = (peak(&plain), peak(&mapped));
    assert_eq!((none, all), (0, TRIANGLES));
    println!("{} bytes a triangle, {} without tangents", with / TRIANGLES, without / TRIANGLES);
    assert!(with < BYTES_A_TRIANGLE * TRIANGLES + without, "{with} bytes, {without} without tangents");
}
