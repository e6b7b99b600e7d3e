//! Subset of the JSON of glTF 2.0 that the scenes use.
//!
//! Structs instead of `serde_json::Value` fix the order of keys, which would otherwise depend on the features
//! of `serde_json`.

use serde::Serialize;

/// Top-level object of a glTF file.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Document {
    pub(crate) asset: Asset,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) extensions_used: Vec<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) extensions: Option<RootExtensions>,
    pub(crate) scene: usize,
    pub(crate) scenes: Vec<Roots>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) meshes: Vec<MeshEntry>,
    pub(crate) materials: Vec<MaterialEntry>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) textures: Vec<TextureEntry>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) samplers: Vec<Sampler>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) images: Vec<ImageEntry>,
    pub(crate) cameras: Vec<CameraEntry>,
    pub(crate) accessors: Vec<Accessor>,
    pub(crate) buffer_views: Vec<BufferView>,
    pub(crate) buffers: Vec<Buffer>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) skins: Vec<Skin>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) animations: Vec<AnimationEntry>,
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

/// Node of the scene graph: a mesh, a camera or a light, with its transform and its children.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Node {
    pub(crate) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) mesh: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) camera: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) skin: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) translation: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rotation: Option<[f32; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) scale: Option<[f32; 3]>,
    /// Transform in column-major order.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) matrix: Option<[f32; 16]>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) children: Vec<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) extensions: Option<NodeExtensions>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct MeshEntry {
    pub(crate) name: String,
    pub(crate) primitives: Vec<Primitive>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Primitive {
    pub(crate) attributes: PrimitiveAttributes,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) indices: Option<usize>,
    pub(crate) material: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) mode: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) targets: Option<Vec<MorphTarget>>,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) struct PrimitiveAttributes {
    pub(crate) position: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) normal: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) texcoord_0: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) color_0: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) joints_0: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) weights_0: Option<usize>,
}

/// Morph target: displacements of a primitive's vertices.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) struct MorphTarget {
    pub(crate) position: usize,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct MaterialEntry {
    pub(crate) name: String,
    pub(crate) pbr_metallic_roughness: MetallicRoughness,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) emissive_factor: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) emissive_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) alpha_mode: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) alpha_cutoff: Option<f64>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(crate) double_sided: bool,
    #[serde(skip_serializing_if = "Extensions::is_empty")]
    pub(crate) extensions: Extensions,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) extras: Option<Extras>,
}

impl MaterialEntry {
    /// Returns `KHR_texture_transform` if the material uses this extension.
    pub(crate) fn transform_extension(&self) -> Option<&'static str> {
        let textures = [self.pbr_metallic_roughness.base_color_texture, self.emissive_texture];
        let is_there = textures.iter().flatten().any(|texture| texture.extensions.is_some());
        is_there.then_some("KHR_texture_transform")
    }
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct MetallicRoughness {
    pub(crate) base_color_factor: [f64; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) base_color_texture: Option<TextureInfo>,
    pub(crate) metallic_factor: f64,
    pub(crate) roughness_factor: f64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Extensions {
    #[serde(rename = "KHR_materials_emissive_strength", skip_serializing_if = "Option::is_none")]
    pub(crate) emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_specular", skip_serializing_if = "Option::is_none")]
    pub(crate) specular: Option<Specular>,
    #[serde(rename = "KHR_materials_transmission", skip_serializing_if = "Option::is_none")]
    pub(crate) transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_ior", skip_serializing_if = "Option::is_none")]
    pub(crate) ior: Option<IndexOfRefraction>,
    #[serde(rename = "KHR_materials_volume", skip_serializing_if = "Option::is_none")]
    pub(crate) volume: Option<Volume>,
}

impl Extensions {
    /// Names of the extensions that are present.
    pub(crate) fn names(&self) -> impl Iterator<Item = &'static str> {
        [
            ("KHR_materials_emissive_strength", self.emissive_strength.is_some()),
            ("KHR_materials_specular", self.specular.is_some()),
            ("KHR_materials_transmission", self.transmission.is_some()),
            ("KHR_materials_ior", self.ior.is_some()),
            ("KHR_materials_volume", self.volume.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, is_there)| is_there.then_some(name))
    }

    fn is_empty(&self) -> bool {
        self.names().next().is_none()
    }
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
#[serde(rename_all = "camelCase")]
pub(crate) struct Transmission {
    pub(crate) transmission_factor: f64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct IndexOfRefraction {
    pub(crate) ior: f64,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Volume {
    pub(crate) thickness_factor: f64,
    pub(crate) attenuation_distance: f64,
    pub(crate) attenuation_color: [f64; 3],
}

/// Reference to a texture with its transform (`textureInfo`).
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct TextureInfo {
    pub(crate) index: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) extensions: Option<TextureExtensions>,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct TextureExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(crate) transform: TextureTransform,
}

/// `KHR_texture_transform`: coordinates are scaled, then rotated, then offset.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct TextureTransform {
    /// Offset, in widths and heights of the image.
    pub offset: [f64; 2],
    /// Rotation, radians, counter-clockwise if the second coordinate grows downwards.
    pub rotation: f64,
    /// Scale: repetitions of the image per unit of each coordinate.
    pub scale: [f64; 2],
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct TextureEntry {
    pub(crate) sampler: usize,
    pub(crate) source: usize,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Sampler {
    pub(crate) mag_filter: u32,
    pub(crate) min_filter: u32,
    pub(crate) wrap_s: u32,
    pub(crate) wrap_t: u32,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ImageEntry {
    pub(crate) name: String,
    pub(crate) buffer_view: usize,
    pub(crate) mime_type: &'static str,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Extras {
    pub(crate) photoncard: PhotoncardExtras,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct PhotoncardExtras {
    pub(crate) phong: Phong,
}

/// Phong cosine lobe: `ks (n + 2) / (2 pi) cos^n(alpha)`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Phong {
    /// `ks`: albedo of the lobe, red, green and blue.
    pub specular: [f64; 3],
    /// `n`: exponent of the lobe.
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
    pub(crate) min: Option<Vec<f32>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) max: Option<Vec<f32>>,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct BufferView {
    pub(crate) buffer: usize,
    pub(crate) byte_offset: usize,
    pub(crate) byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) target: Option<u32>,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Buffer {
    pub(crate) byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) uri: Option<String>,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Skin {
    pub(crate) joints: Vec<usize>,
    pub(crate) inverse_bind_matrices: usize,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct AnimationEntry {
    pub(crate) name: String,
    pub(crate) channels: Vec<Channel>,
    pub(crate) samplers: Vec<KeyframeSampler>,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Channel {
    pub(crate) sampler: usize,
    pub(crate) target: ChannelTarget,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct ChannelTarget {
    pub(crate) node: usize,
    pub(crate) path: &'static str,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct KeyframeSampler {
    pub(crate) input: usize,
    pub(crate) output: usize,
    pub(crate) interpolation: &'static str,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct RootExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(crate) lights: Lights,
}

#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Lights {
    pub(crate) lights: Vec<PointLight>,
}

/// Point light of `KHR_lights_punctual`, with equal intensity in all directions.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct PointLight {
    #[serde(rename = "type")]
    pub(crate) kind: &'static str,
    pub(crate) name: String,
    pub(crate) color: [f64; 3],
    pub(crate) intensity: f64,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(crate) light: LightIndex,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct LightIndex {
    pub(crate) light: usize,
}
