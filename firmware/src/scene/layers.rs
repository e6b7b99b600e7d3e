//! Layers of materials, read from card memory with their textures.

use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Layers, Material, Record};
use photoncard_shared::message::Fault;

use super::SceneImage;
use crate::memory::MemoryPort;

const LAYERS_PER_LINE: u32 = Layers::PER_LINE as u32;

/// Layers of a material.
pub(super) fn read_layers(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    material: &Material,
) -> Result<Layers, Fault> {
    let Some(index) = material.layers else { return Ok(Layers::NONE) };
    let bytes = scene.record::<{ Layers::BYTES }, LAYERS_PER_LINE>(memory, SectionKind::Layers, index)?;
    Ok(Layers::read(bytes))
}
