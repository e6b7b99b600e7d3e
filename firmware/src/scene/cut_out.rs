//! Cut-outs: where the alpha of a texture or of the corners says that there is nothing.

use photoncard_shared::layout::Triangle;
use photoncard_shared::message::Fault;

use super::SceneImage;
use super::corners::Corners;
use super::surface::read_material;
use crate::memory::MemoryPort;

/// Whether a triangle with cut-outs is there at a place on it.
///
/// # Errors
/// If the image is not sound.
#[inline(never)]
pub(super) fn is_there(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    triangle: &Triangle,
    index: u32,
    weights: [f32; 3],
) -> Result<bool, Fault> {
    let material = read_material(scene, memory, triangle.material)?;
    let Some(corners) = Corners::read(scene, memory, index, weights)? else { return Ok(true) };
    let [base, ..] = material.textures;
    let [.., texture] = corners.texture(scene, memory, base)?;
    let [.., colour] = corners.colour();
    Ok(texture * colour >= material.cutoff)
}
