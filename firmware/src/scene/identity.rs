//! Identities of triangles: numbers of pairs of object and material.

use photoncard_shared::image::{IDENTITIES_PER_LINE, SectionKind};
use photoncard_shared::layout::{LEAF_TRIANGLES, NO_INSTANCE, TriangleId};
use photoncard_shared::message::Fault;

use super::SceneImage;
use crate::memory::MemoryPort;

/// Reads the identity of a triangle: its own value or, of a triangle in a group, the sum of its value and the
/// first value of the instance.
///
/// # Errors
/// If the card image has no identities, or is invalid.
pub fn read_identity(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    TriangleId { index, instance }: TriangleId,
) -> Result<u32, Fault> {
    let own = read(scene, memory, index)?;
    if instance == NO_INSTANCE {
        return Ok(own);
    }
    Ok(read(scene, memory, instance.wrapping_mul(LEAF_TRIANGLES as u32))?.wrapping_add(own))
}

fn read(scene: &SceneImage, memory: &mut impl MemoryPort, index: u32) -> Result<u32, Fault> {
    let value = scene.record::<4, IDENTITIES_PER_LINE>(memory, SectionKind::Identities, index)?;
    Ok(u32::from_le_bytes(*value))
}
