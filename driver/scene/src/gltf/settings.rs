//! Settings of the loader.

use photoncard_shared::budget::REFERENCE_DRAM_BYTES;

use crate::LightUnits;

/// Settings of the loader. [`Scene::checksum`](crate::Scene::checksum) covers everything that these settings
/// change in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadSettings {
    /// Memory of the cards into which the scene must fit, bytes.
    pub dram_bytes: u64,
    /// Maximum width and height of an image, texels, at least 1. The sides of larger images are divided by a
    /// whole number, and the texels are averaged in linear light. `None` keeps the sizes of the files.
    pub texture_limit: Option<u32>,
    /// Variant of the materials (`KHR_materials_variants`); `None` for the materials that the meshes state.
    pub variant: Option<String>,
    /// Units of the file's punctual lights.
    pub light_units: LightUnits,
    /// True to read `TEXCOORD_1` also where no texture takes it: lightmaps do.
    pub lightmap_coordinates: bool,
}

/// Default settings: memory of the reference chip, images of all sizes, no variant, and units chosen by the
/// exporter.
impl Default for LoadSettings {
    fn default() -> Self {
        Self {
            dram_bytes: REFERENCE_DRAM_BYTES,
            texture_limit: None,
            variant: None,
            light_units: LightUnits::default(),
            lightmap_coordinates: false,
        }
    }
}
