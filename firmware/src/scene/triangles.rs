//! Triangles, instances and identities in card memory.

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::{IDENTITIES_PER_LINE, SectionKind};
use photoncard_shared::layout::{
    BvhLeaf, Instance, LEAF_TRIANGLES, NO_INSTANCE, Triangle, TriangleId, placed_point,
};
use photoncard_shared::message::{Fault, FaultCode};

use super::SceneImage;
use crate::memory::MemoryPort;

/// Reads a triangle, in world space.
///
/// # Errors
/// If the card image is invalid.
#[inline(always)]
pub(super) fn read_triangle(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    TriangleId { index, instance }: TriangleId,
) -> Result<Triangle, Fault> {
    let [leaf, slot] = [index / LEAF_TRIANGLES as u32, index % LEAF_TRIANGLES as u32];
    let line = scene.line(memory, SectionKind::Triangles, leaf, BvhLeaf::OF_TRIANGLE)?;
    let mut triangle = BvhLeaf(line).triangle(slot as usize);
    if instance != NO_INSTANCE {
        let Instance { to_world, .. } = read_instance(scene, memory, instance)?;
        triangle.vertices = triangle.vertices.map(|vertex| placed_point(&to_world, vertex));
    }
    Ok(triangle)
}

/// Reads the instance that is stored in line `index` of the leaves' section.
///
/// # Errors
/// [`FaultCode::Record`] if the line is a leaf with triangles, or if there is no such line.
pub(super) fn read_instance(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    index: u32,
) -> Result<Instance, Fault> {
    let line = scene.line(memory, SectionKind::Triangles, index, 0..LINE_BYTES as u32)?;
    Instance::read(line).ok_or(Fault { code: FaultCode::Record, detail: index })
}

/// Transforms a leaf of an instance's group to world space and writes it to `moved`.
#[cold]
#[inline(never)]
pub(super) fn place_leaf(line: &[u8; LINE_BYTES], instance: &Instance, moved: &mut [u8; LINE_BYTES]) {
    *moved = BvhLeaf(line).placed(&instance.to_world);
}

/// Reads the identity of a triangle, the number of a pair of object and material: its own value or, of a
/// triangle in a group, the sum of its value and the first value of the instance.
///
/// # Errors
/// If the card image has no identities, or is invalid.
pub fn read_identity(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    TriangleId { index, instance }: TriangleId,
) -> Result<u32, Fault> {
    let mut read = |index| {
        let value = scene.record::<4, IDENTITIES_PER_LINE>(memory, SectionKind::Identities, index)?;
        Ok(u32::from_le_bytes(*value))
    };
    let own = read(index)?;
    if instance == NO_INSTANCE {
        return Ok(own);
    }
    Ok(read(instance.wrapping_mul(LEAF_TRIANGLES as u32))?.wrapping_add(own))
}
