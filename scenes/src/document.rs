//! The part of glTF 2.0's JSON that the scenes use.
//!
//! Plain structs rather than `serde_json::Value`, so that the order of the keys, and with it every
//! byte of the file, does not depend on how `serde_json` was built.

use serde::Serialize;

/// The top of a glTF file.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Document {
    pub(crate) asset: Asset,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) extensions_used: Vec<&'static str>,
    pub(crate) scene: usize,
    pub(crate) scenes: Vec<Roots>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) meshes: Vec<MeshEntry>,
    pub(crate) materials: Vec<MaterialEntry>,
    pub(crate) cameras: Vec<CameraEntry>,
    pub(crate) accessors: Vec<Accessor>,
    pub(crate) buffer_views: Vec<BufferView>,
    pub(crate) buffers: Vec<Buffer>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Asset {
    version: &'static str,
    generator: &'static str,
}

impl Default for Asset {
    fn default() -> Self {
        Self { version: "2.0", generator: "photoncard-scenes" }
    }
}

#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Roots {
    pub(crate) nodes: Vec<usize>,
}

/// A place in the hierarchy: what stands there, and where.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Node {
    pub(crate) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) mesh: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) camera: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) translation: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) scale: Option<[f32; 3]>,
    /// Column by column, as glTF wants it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) matrix: Option<[f32; 16]>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) children: Vec<usize>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct MeshEntry {
    pub(crate) name: String,
    pub(crate) primitives: Vec<Primitive>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Primitive {
    pub(crate) attributes: Attributes,
    pub(crate) indices: usize,
    pub(crate) material: usize,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) struct Attributes {
    pub(crate) position: usize,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct MaterialEntry {
    pub(crate) name: String,
    pub(crate) pbr_metallic_roughness: MetallicRoughness,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) emissive_factor: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(crate) double_sided: bool,
    pub(crate) extensions: Extensions,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) extras: Option<Extras>,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct MetallicRoughness {
    pub(crate) base_color_factor: [f64; 4],
    pub(crate) metallic_factor: f64,
    pub(crate) roughness_factor: f64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Extensions {
    #[serde(rename = "KHR_materials_emissive_strength", skip_serializing_if = "Option::is_none")]
    pub(crate) emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_specular")]
    pub(crate) specular: Specular,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct EmissiveStrength {
    pub(crate) emissive_strength: f64,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Specular {
    pub(crate) specular_factor: f64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Extras {
    pub(crate) photoncard: PhotoncardExtras,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct PhotoncardExtras {
    pub(crate) phong: Phong,
}

/// One Phong cosine lobe: `ks (n + 2) / (2 pi) cos^n(alpha)`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Phong {
    /// `ks`, red, green and blue.
    pub specular: [f64; 3],
    /// `n`.
    pub exponent: f64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct CameraEntry {
    pub(crate) name: String,
    #[serde(rename = "type")]
    pub(crate) kind: &'static str,
    pub(crate) perspective: Perspective,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Perspective {
    pub(crate) aspect_ratio: f64,
    pub(crate) yfov: f64,
    pub(crate) znear: f64,
    pub(crate) zfar: f64,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Accessor {
    pub(crate) buffer_view: usize,
    pub(crate) component_type: u32,
    pub(crate) count: usize,
    #[serde(rename = "type")]
    pub(crate) kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) min: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) max: Option<[f32; 3]>,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct BufferView {
    pub(crate) buffer: usize,
    pub(crate) byte_offset: usize,
    pub(crate) byte_length: usize,
    pub(crate) target: u32,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Buffer {
    pub(crate) byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) uri: Option<String>,
}
