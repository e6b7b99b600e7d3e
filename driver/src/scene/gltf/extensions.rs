//! Extensions of glTF.

/// Extensions whose meaning the loader knows.
pub(super) const SUPPORTED_EXTENSIONS: [&str; 10] = [
    INSTANCING,
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    // Lit all the same, which a notice tells.
    "KHR_materials_unlit",
    "KHR_materials_volume",
    QUANTIZATION,
    "KHR_texture_transform",
];

/// Vertices may be integers.
pub(super) const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Meshes that a node shows many times.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";
