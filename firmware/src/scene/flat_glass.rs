//! Transmittance of flat glass (thin walls and panes), which shadow rays pass without a change of direction.

use glam::Vec3;
use photoncard_shared::layout::{Triangle, TriangleId};
use photoncard_shared::message::Fault;

use super::surface::{Detail, Surface, surface_of};
use super::{Ray, SceneImage};
use crate::memory::MemoryPort;

/// Transmittance, 0 to 1, of a flat glass triangle for a ray that hits it at the barycentric coordinates
/// `weights`.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub(super) fn of_flat_glass(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    (id, triangle): (TriangleId, &Triangle),
    weights: [f32; 3],
) -> Result<Vec3, Fault> {
    let mut surface = Surface::NOWHERE;
    // The random value 0 chooses the base, the only layer that transmits.
    let place = (id, triangle, Detail::Shading);
    surface_of(scene, memory, ray, place, weights, &|_| 0.0, &mut surface)?;
    Ok(surface.specular.transmitted * surface.specular.straight)
}
