//! Photon maps: search for the k nearest photons, radiance estimate, precomputed irradiance.

mod candidates;
mod caustic;
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

pub use candidates::{Candidate, CandidateBuffer, CandidateStorage, Candidates};
pub use caustic::{CausticSearch, Caustics, reflected_caustics};
pub use irradiance::{FoundIrradiance, PointSearch, nearest_irradiance};
pub use nearest::NearestPhotons;
pub use radiance::{Estimate, LitBy, MIN_NORMAL_COSINE, Reflected, SameSurface, reflected_radiance};

use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::simd::{self, Isa, Kernel};

/// One of the two photon maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotonMap {
    /// The photon map: every arrival of light at a surface that is not specular.
    Indirect,
    /// The caustic map: photons whose bounces, one at least, were all specular (`L S+ D`).
    Caustics,
}

impl PhotonMap {
    /// Sections of the nodes and leaves.
    #[inline(always)]
    fn sections(self) -> [SectionKind; 2] {
        match self {
            Self::Indirect => [SectionKind::PhotonNodes, SectionKind::PhotonLeaves],
            Self::Caustics => [SectionKind::CausticNodes, SectionKind::CausticLeaves],
        }
    }
}

/// Collects the photons of a map nearest to `position` in `nearest`; both layouts of the map give equal sets. Returns
/// the number of photons tested.
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

/// Kernel of [`gather`].
pub struct Search<'s, 'n, M> {
    /// The scene, with its photon map.
    pub scene: &'s SceneImage,
    /// Card memory.
    pub memory: &'s mut M,
    /// Photon map to search.
    pub map: PhotonMap,
    /// Query position, metres.
    pub position: Vec3,
    /// Set of the nearest photons.
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

/// Kernel of the selection of the nearest candidates alone: see [`NearestPhotons`].
pub struct Selection<'a> {
    /// Candidates to select from.
    pub candidates: Candidates<'a>,
    /// Number of candidates to select.
    pub count: usize,
}

impl Kernel for Selection<'_> {
    type Output = Option<Candidate>;

    /// Moves the `count` nearest candidates to the front, unordered, and returns the farthest of them. The elements
    /// behind are meaningless afterwards. `None`, without a change, if `count` is 0 or above the number of candidates.
    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let length = self.candidates.capacity();
        select::select(isa, self.candidates, length, self.count).map(|chosen| chosen.last)
    }
}
