//! glTF extensions that the loader supports.

pub(super) const SUPPORTED_EXTENSIONS: [&str; 21] = [
    IES,
    INSTANCING,
    WEBP,
    BASISU,
    MESHOPT[0],
    MESHOPT[1],
    DRACO,
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    // Unlit materials are rendered with lighting, which a notice reports.
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    QUANTIZATION,
    "KHR_texture_transform",
];

/// Extension for integer vertex attributes.
pub(super) const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Extension for lights with photometric files.
pub(super) const IES: &str = "EXT_lights_ies";

/// Extension for instances of a node's mesh.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Extensions for compressed buffer views: one format under two names.
pub(super) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Extension for compressed primitives.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Extension for images in WebP.
pub(super) const WEBP: &str = "EXT_texture_webp";

/// Extension for images in KTX2.
pub(super) const BASISU: &str = "KHR_texture_basisu";
