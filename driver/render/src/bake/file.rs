//! A binary glTF file that is being written.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use super::error::BakeError;
use crate::PROGRAM;

/// Component types of glTF.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
/// Chunk types of a glb file.
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// Contents of a glTF file with one buffer.
#[derive(Default)]
pub(super) struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
    samplers: Vec<Value>,
    textures: Vec<Value>,
    extensions: BTreeSet<String>,
    pub(super) materials: Vec<Value>,
    pub(super) meshes: Vec<Value>,
    pub(super) nodes: Vec<Value>,
}

impl File {
    /// Records that the file uses an extension.
    pub(super) fn uses(&mut self, extension: &str) {
        self.extensions.insert(extension.to_owned());
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = Map::new();
        view.insert("buffer".into(), json!(0));
        view.insert("byteOffset".into(), json!(self.bytes.len()));
        view.insert("byteLength".into(), json!(bytes.len()));
        if let Some(target) = target {
            view.insert("target".into(), json!(target));
        }
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view.into());
        self.views.len() - 1
    }

    /// Adds vectors of a vertex attribute. `has_bounds` for positions, whose bounds glTF wants.
    pub(super) fn vectors<const N: usize>(&mut self, vectors: &[[f32; N]], has_bounds: bool) -> usize {
        let bytes: Vec<u8> = vectors.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(34_962));
        let mut accessor = Map::new();
        accessor.insert("bufferView".into(), json!(view));
        accessor.insert("componentType".into(), json!(FLOAT));
        accessor.insert("count".into(), json!(vectors.len()));
        accessor.insert("type".into(), json!(format!("VEC{N}")));
        if has_bounds {
            let extreme = |choose: fn(f32, f32) -> f32, from: f32| {
                let fold = |axis: usize| vectors.iter().map(|vector| vector[axis]).fold(from, choose);
                (0..N).map(fold).collect::<Vec<f32>>()
            };
            accessor.insert("min".into(), json!(extreme(f32::min, f32::INFINITY)));
            accessor.insert("max".into(), json!(extreme(f32::max, f32::NEG_INFINITY)));
        }
        self.accessors.push(accessor.into());
        self.accessors.len() - 1
    }

    /// Adds indices of vertices.
    pub(super) fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(34_963));
        let count = indices.len();
        self.accessors.push(
            json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": count, "type": "SCALAR" }),
        );
        self.accessors.len() - 1
    }

    /// Adds a PNG image.
    pub(super) fn image(&mut self, name: &str, png: &[u8]) -> usize {
        let view = self.view(png, None);
        self.images.push(json!({ "name": name, "mimeType": "image/png", "bufferView": view }));
        self.images.len() - 1
    }

    /// Adds a texture with the filters of magnification and minification, and the wrap modes.
    pub(super) fn texture(&mut self, image: usize, filters: [u32; 2], wrap: [u32; 2]) -> usize {
        let [magnify, minify] = filters;
        let sampler =
            json!({ "magFilter": magnify, "minFilter": minify, "wrapS": wrap[0], "wrapT": wrap[1] });
        let sampler = self.samplers.iter().position(|other| *other == sampler).unwrap_or_else(|| {
            self.samplers.push(sampler);
            self.samplers.len() - 1
        });
        self.textures.push(json!({ "source": image, "sampler": sampler }));
        self.textures.len() - 1
    }

    /// Bytes of the glb file, whose scene has the nodes `roots`.
    ///
    /// # Errors
    /// If the file has 4 GB or more.
    pub(super) fn finish(self, roots: &[usize], extras: &Value) -> Result<Vec<u8>, BakeError> {
        let failed = |reason: &str| BakeError::Encode { what: "glb", reason: reason.to_owned() };
        let mut root = Map::new();
        root.insert("asset".into(), json!({ "version": "2.0", "generator": PROGRAM }));
        root.insert("scene".into(), json!(0));
        root.insert("scenes".into(), json!([{ "nodes": roots }]));
        root.insert("extras".into(), json!({ "photoncard": extras }));
        root.insert("buffers".into(), json!([{ "byteLength": self.bytes.len() }]));
        let extensions: Vec<Value> = self.extensions.into_iter().map(Value::from).collect();
        for (name, list) in [
            ("nodes", self.nodes),
            ("meshes", self.meshes),
            ("materials", self.materials),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
            ("images", self.images),
            ("samplers", self.samplers),
            ("textures", self.textures),
            ("extensionsUsed", extensions),
        ] {
            if !list.is_empty() {
                root.insert(name.into(), list.into());
            }
        }
        let mut text = serde_json::to_vec(&root).map_err(|error| failed(&error.to_string()))?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let size = |bytes: usize| u32::try_from(bytes).map_err(|_| failed("it has 4 GB or more"));
        let mut file = Vec::with_capacity(28 + text.len() + self.bytes.len());
        file.extend(b"glTF");
        file.extend(2_u32.to_le_bytes());
        file.extend(size(28 + text.len() + self.bytes.len())?.to_le_bytes());
        for (kind, chunk) in [(JSON, &text), (BIN, &self.bytes)] {
            file.extend(size(chunk.len())?.to_le_bytes());
            file.extend(kind.to_le_bytes());
            file.extend(chunk);
        }
        Ok(file)
    }
}
