//! Cut-outs (glTF's `alphaMode` `MASK`): points of a triangle whose alpha is below the material's cutoff.

use photoncard_shared::layout::Triangle;
use photoncard_shared::message::Fault;

use super::SceneImage;
use super::corners::Corners;
use super::surface::read_material;
use crate::memory::MemoryPort;

/// `true` if the alpha at a point of a triangle, with barycentric `weights`, is not below the cutoff.
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
