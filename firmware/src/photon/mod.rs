//! The photon map: the k photons nearest to a point, and the radiance that they reflect.

mod kdtree;
mod leaves;
mod nearest;
mod radiance;
mod select;

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::message::Fault;

pub use nearest::{Candidate, NearestPhotons};
pub use radiance::{MIN_NORMAL_COSINE, SameSurface, reflected_radiance};
pub use select::select;

use crate::memory::MemoryPort;
use crate::scene::SceneImage;

/// Searches the photons nearest to `position` into `nearest`, in whichever layout the map is: what is found is the same.
/// Returns the number of photons tested.
///
/// # Errors
/// If the image is not sound.
#[inline(always)]
pub fn gather(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    position: Vec3,
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    let tested = if scene.header.section(SectionKind::PhotonLeaves).records > 0 {
        leaves::gather(scene, memory, position, nearest)?
    } else {
        kdtree::gather(scene, memory, position, nearest)?
    };
    nearest.finish();
    Ok(tested)
}
