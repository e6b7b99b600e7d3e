//! Settings of loading.

use photoncard_shared::budget::REFERENCE_DRAM_BYTES;

use crate::LightUnits;

/// Settings with which a scene is loaded. All that changes the scene is in
/// [`Scene::checksum`](crate::Scene::checksum).
#[derive(Clone, Debug, PartialEq)]
pub struct LoadSettings {
    /// Memory of the cards that the scene must fit, bytes.
    pub dram_bytes: u32,
    /// Variant of the materials (`KHR_materials_variants`); `None` for the materials that the meshes state.
    pub variant: Option<String>,
    /// Units of the file's lights without extent.
    pub light_units: LightUnits,
}

/// The memory of the reference chip, no variant, and units by the exporter.
impl Default for LoadSettings {
    fn default() -> Self {
        Self { dram_bytes: REFERENCE_DRAM_BYTES, variant: None, light_units: LightUnits::default() }
    }
}
