//! The photon map: the k photons nearest to a point, and the radiance that they reflect; or the irradiance that was estimated near it.

mod candidates;
mod collector;
mod irradiance;
mod kdtree;
mod leaves;
mod nearest;
mod radiance;
mod select;

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::message::Fault;

pub use candidates::{Candidate, CandidateBuffer, Candidates};
pub use irradiance::{FoundIrradiance, PointSearch, nearest_irradiance};
pub use nearest::NearestPhotons;
pub use radiance::{Estimate, MIN_NORMAL_COSINE, SameSurface, reflected_radiance};

use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::simd::{self, Isa, Kernel};

/// One of the two photon maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotonMap {
    /// Every arrival at a surface that is not perfectly specular.
    Indirect,
    /// Light that has met perfectly specular surfaces alone, and one at least.
    Caustics,
}

impl PhotonMap {
    /// Its nodes and leaves.
    #[inline(always)]
    fn sections(self) -> [SectionKind; 2] {
        match self {
            Self::Indirect => [SectionKind::PhotonNodes, SectionKind::PhotonLeaves],
            Self::Caustics => [SectionKind::CausticNodes, SectionKind::CausticLeaves],
        }
    }
}

/// Searches the photons of a map nearest to `position` into `nearest`, in whichever layout the map is: what is found is the same.
/// Returns the number of photons tested.
///
/// # Errors
/// If the image is not sound.
#[inline(always)]
pub fn gather(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    map: PhotonMap,
    position: Vec3,
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    simd::run(Search { scene, memory, map, position, nearest })
}

/// What [`gather`] does, for any processor.
pub struct Search<'s, 'n, M> {
    /// The scene, with its photon map.
    pub scene: &'s SceneImage,
    /// Card memory.
    pub memory: &'s mut M,
    /// Which map.
    pub map: PhotonMap,
    /// Where to search, metres.
    pub position: Vec3,
    /// Where to put the photons.
    pub nearest: &'s mut NearestPhotons<'n>,
}

impl<M: MemoryPort> Kernel for Search<'_, '_, M> {
    type Output = Result<u32, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, map, position, nearest } = self;
        let has_leaves = scene.header.section(SectionKind::PhotonLeaves).records > 0;
        let tested = if map == PhotonMap::Caustics || has_leaves {
            leaves::gather(isa, scene, map.sections(), memory, position, nearest)?
        } else {
            kdtree::gather(isa, scene, memory, position, nearest)?
        };
        nearest.finish(isa);
        Ok(tested)
    }
}

/// The selection of the nearest candidates by itself, for any processor: see [`NearestPhotons`].
pub struct Selection<'a> {
    /// From which to select.
    pub candidates: Candidates<'a>,
    /// How many to select.
    pub count: usize,
}

impl Kernel for Selection<'_> {
    type Output = Option<Candidate>;

    /// Moves the first `count` candidates, in their order, to the front, and returns the last of these. What lies behind
    /// is no longer of use. `None`, and no change, if there are none or fewer than `count`.
    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let length = self.candidates.capacity();
        select::select(isa, self.candidates, length, self.count)
    }
}
