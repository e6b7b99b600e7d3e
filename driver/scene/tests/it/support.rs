//! Small glTF files for the tests.

use std::fs;

use photoncard_scene::error::SceneError;
use photoncard_scene::{Scene, gltf};
use serde_json::{Value, json};

/// Buffer with three vertices of a triangle of 0.5 m^2 that faces +z, and three 16-bit indices.
pub(crate) fn triangle_bytes() -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [0f32, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    bytes
}

/// Document with one emissive triangle in mesh `panel`, material `lamp` and camera `eye`, whose bytes are in
/// `data.bin`.
pub(crate) fn triangle_json() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular", "KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"name": "shown", "mesh": 0},
            {"name": "tripod", "camera": 0, "translation": [0.25, 0.25, 3.0]}
        ],
        "cameras": [
            {"name": "eye", "type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.1}}
        ],
        "meshes": [
            {"name": "panel", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}
        ],
        "materials": [{
            "name": "lamp",
            "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1.0], "metallicFactor": 0.0},
            "emissiveFactor": [1.0, 0.5, 0.25],
            "extensions": {
                "KHR_materials_specular": {"specularFactor": 0.0},
                "KHR_materials_emissive_strength": {"emissiveStrength": 4.0}
            }
        }],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6}
        ],
        "buffers": [{"uri": "data.bin", "byteLength": 44}]
    })
}

/// GLB of `json`. Its first buffer becomes the BIN chunk.
#[allow(dead_code, reason = "not every test file makes one")]
pub(crate) fn glb(mut json: Value, bin: &[u8]) -> Vec<u8> {
    json["buffers"][0].as_object_mut().unwrap().remove("uri");
    let mut text = serde_json::to_vec(&json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + bin.len();
    let mut bytes = b"glTF".to_vec();
    for word in [2, length as u32, text.len() as u32] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(b"JSON");
    bytes.extend(&text);
    bytes.extend((bin.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(bin);
    bytes
}

/// Splits a GLB into its JSON and its binary chunk.
#[allow(dead_code, reason = "not every test file takes one apart")]
pub(crate) fn parts(file: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
    let json = serde_json::from_slice(&file[20..20 + length]).unwrap();
    (json, file[20 + length + 8..].to_vec())
}

/// Loads a scene from the result of [`parts`].
#[allow(dead_code, reason = "not every test file takes one apart")]
pub(crate) fn load_parts((json, bytes): &(Value, Vec<u8>)) -> Result<Scene, SceneError> {
    load_bytes("scene.glb", &glb(json.clone(), bytes))
}

/// File of the triangle, to which tests add buffer views and accessors.
#[allow(dead_code, reason = "not every test file adds accessors")]
pub(crate) struct Extended {
    pub(crate) json: Value,
    pub(crate) bytes: Vec<u8>,
}

#[allow(dead_code, reason = "not every test file adds accessors")]
impl Extended {
    pub(crate) fn new() -> Self {
        Self { json: triangle_json(), bytes: triangle_bytes() }
    }

    /// Adds a buffer view with these bytes, and returns its index.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        self.bytes.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.bytes.len());
        push(&mut self.json, "bufferViews", view)
    }

    /// Adds an accessor with these bytes, and returns its index.
    pub(crate) fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor = json!({"bufferView": view, "componentType": component, "count": count, "type": kind});
        push(&mut self.json, "accessors", accessor)
    }

    /// Adds a single-precision accessor, and returns its index.
    pub(crate) fn floats<const N: usize>(&mut self, kind: &str, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(kind, 5126, values.len(), &bytes)
    }

    /// Returns the only primitive.
    pub(crate) fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    pub(crate) fn load(&self) -> Result<Scene, SceneError> {
        load_with(&self.json, &self.bytes)
    }
}

/// File of the triangle with texture coordinates. Its base colour texture is texture 0, with `image` as image
/// 0.
#[allow(dead_code, reason = "not every test file has textures")]
pub(crate) fn textured(image: &Value) -> Extended {
    let mut scene = Extended::new();
    let coordinates = scene.floats("VEC2", &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    scene.primitive()["attributes"]["TEXCOORD_0"] = json!(coordinates);
    scene.json["images"] = json!([image]);
    scene.json["textures"] = json!([{"source": 0}]);
    pbr(&mut scene.json)["baseColorTexture"] = json!({"index": 0});
    scene
}

#[allow(dead_code, reason = "not every test file has textures")]
pub(crate) fn pbr(json: &mut Value) -> &mut Value {
    &mut json["materials"][0]["pbrMetallicRoughness"]
}

/// [`textured`] with the image in a buffer view.
#[allow(dead_code, reason = "not every test file has textures")]
pub(crate) fn embedded(bytes: &[u8], kind: &str) -> Extended {
    let mut scene = textured(&json!(null));
    let view = scene.view(bytes);
    scene.json["images"] = json!([{"bufferView": view, "mimeType": kind}]);
    scene
}

/// Checks that a scene is loaded without its texture, and that one notice names the image and the reason.
#[allow(dead_code, reason = "not every test file has textures")]
pub(crate) fn check_left_out(scene: &Scene, parts: &[&str]) {
    assert_eq!((scene.images.len(), scene.textures.len()), (0, 0), "{parts:?}");
    assert_eq!((scene.materials[0].base_texture, scene.triangles.len()), (None, 1), "{parts:?}");
    let [notice] = &scene.notices[..] else { panic!("{parts:?}: {:?}", scene.notices) };
    for part in ["left out"].iter().chain(parts) {
        assert!(notice.contains(part), "{part:?} is not in {notice:?}");
    }
}

/// Appends an item to a list of the root, and returns its index.
#[allow(dead_code, reason = "not every test file appends")]
pub(crate) fn push(json: &mut Value, list: &str, item: Value) -> usize {
    let list = json.as_object_mut().unwrap().entry(list).or_insert(json!([])).as_array_mut().unwrap();
    list.push(item);
    list.len() - 1
}

/// Adds a node to the scene.
#[allow(dead_code, reason = "not every test file adds one")]
pub(crate) fn add_node(json: &mut Value, node: Value) {
    let index = push(json, "nodes", node);
    json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
}

/// Loads a file with these bytes.
#[allow(dead_code, reason = "not every test file loads raw bytes")]
pub(crate) fn load_bytes(name: &str, bytes: &[u8]) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    gltf::load(&path)
}

/// Loads `json`; `bin` is `data.bin` in the same folder.
#[allow(dead_code, reason = "not every test file loads JSON")]
pub(crate) fn load_with(json: &Value, bin: &[u8]) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("data.bin"), bin).unwrap();
    let path = folder.path().join("scene.gltf");
    fs::write(&path, serde_json::to_vec(json).unwrap()).unwrap();
    gltf::load(&path)
}

/// Loads the triangle's file after `change`.
#[allow(dead_code, reason = "not every test file changes the triangle")]
pub(crate) fn load_changed(change: impl FnOnce(&mut Value)) -> Result<Scene, SceneError> {
    let mut json = triangle_json();
    change(&mut json);
    load_with(&json, &triangle_bytes())
}
