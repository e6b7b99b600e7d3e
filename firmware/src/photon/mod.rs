//! Photon maps: search for the k nearest photons, density estimates of radiance, and precomputed irradiance.

mod candidates;
mod caustic;
mod collector;
mod irradiance;
mod kdtree;
mod leaves;
mod nearest;
mod radiance;
mod region;
mod same_surface;
mod select;

use core::f32::consts::PI;

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::message::Fault;

pub use candidates::{Candidate, CandidateBuffer, CandidateStorage, Candidates};
pub use caustic::{CausticSearch, Caustics, LitBy, reflected_caustics};
pub use irradiance::{FoundIrradiance, PointSearch, nearest_irradiance};
pub use nearest::NearestPhotons;
pub use radiance::{Estimate, Reflected, Sight, reflected_radiance};
pub use region::{SECTORS, Sectors, VisibleRegion};
pub use same_surface::{MIN_NORMAL_COSINE, SameSurface};

use self::region::{All, Filter};
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::{MemoryPort, Stage};
use crate::scene::{PartialReflection, SceneImage};
use crate::simd::{self, Isa, Kernel};

/// One of the two photon maps of a card image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotonMap {
    /// The photon map: one photon for each arrival of light at a surface that is not specular.
    Indirect,
    /// The caustic map (`L S+ D`): photons with at least one bounce, whose bounces were all specular.
    Caustics,
}

impl PhotonMap {
    /// Sections of the map's nodes and of its leaves.
    #[inline(always)]
    fn sections(self) -> [SectionKind; 2] {
        match self {
            Self::Indirect => [SectionKind::PhotonNodes, SectionKind::PhotonLeaves],
            Self::Caustics => [SectionKind::CausticNodes, SectionKind::CausticLeaves],
        }
    }
}

/// Collects in `nearest` the photons of a map that are nearest to `position`. Returns the number of photons
/// tested. A kd-tree and a tree with leaves give the same photons.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub fn gather(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    map: PhotonMap,
    position: Vec3,
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    simd::run(Search { scene, memory, map, position, nearest })
}

/// Does [`gather`] for the photons in the region that is visible from `position`.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub fn gather_visible(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    map: PhotonMap,
    (position, region): (Vec3, &VisibleRegion),
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    nearest.limit_to(region.sectors.reach_squared());
    simd::run(VisibleSearch { scene, memory, map, position, region, nearest })
}

/// Factor of the initial squared search radius in a visible region, `VISIBLE_MOST r^2 (pi r^2 / A)`. `r` is
/// the distance of the k-th photon in the whole sphere, and `A` is the region's area within `r`.
const VISIBLE_MOST: f32 = 1.35;

/// Parameters of a gather.
#[derive(Clone, Copy, Debug)]
pub struct GatherLimits {
    /// Number k of photons to find.
    pub neighbors: u32,
    /// Maximum distance of a photon, metres.
    pub max_distance: f32,
    /// Gather radius, metres, above which a ray tests whether an object covers the point closely. In the
    /// narrow gap below such an object, the nearest photons do not represent the light at the point.
    pub free_within: f32,
    /// Light groups whose light is summed separately.
    pub groups: LightGroups,
}

/// Maximum radius of a visible region, divided by the distance of the k-th photon in the whole sphere.
const MAX_REACH: f32 = 2.0;

/// Radiance that the nearest photons of the photon map reflect at a position. If walls may hide photons, a
/// second search is limited to the region that is visible from the position. `count` is called after each
/// search, with the number of photons tested, the photons found, and their reflected light.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub fn gathered_radiance(
    (scene, memory): (&SceneImage, &mut impl MemoryPort),
    position: Vec3,
    reflection: &PartialReflection,
    GatherLimits { neighbors, max_distance, free_within, groups }: GatherLimits,
    mut candidates: Candidates,
    count: &mut impl FnMut(u32, &NearestPhotons, &Reflected),
) -> Result<GroupedLight, Fault> {
    let mut nearest = NearestPhotons::new(candidates.reborrow(), neighbors, max_distance);
    let tested = gather(scene, memory, PhotonMap::Indirect, position, &mut nearest)?;
    let cell = scene.header.photon_grid.cell;
    let of_all = reflected_radiance(&nearest, cell, None, reflection, groups);
    count(tested, &nearest, &of_all);
    let radius = nearest.radius();
    let surface = (position, reflection.normal());
    if of_all.sight == Sight::Free {
        let may_be_covered = radius > free_within && !nearest.is_empty();
        if !may_be_covered || !region::is_covered(scene, memory, surface, radius)? {
            return Ok(of_all.radiance);
        }
    }
    let reach = crate::vector::min(MAX_REACH * radius, max_distance);
    memory.enter(Stage::GatherRay);
    let region = VisibleRegion::new(scene, memory, surface, radius, reach)?;
    memory.enter(Stage::Gather);
    let mut nearest = NearestPhotons::new(candidates, neighbors, reach);
    nearest.narrow_to(
        VISIBLE_MOST * radius * radius * (PI * radius * radius / region.sectors.area(radius * radius)),
    );
    let tested = gather_visible(scene, memory, PhotonMap::Indirect, (position, &region), &mut nearest)?;
    let of_region = reflected_radiance(&nearest, cell, Some(&region.sectors), reflection, groups);
    count(tested, &nearest, &of_region);
    // The closest photon is visible, and walls hide nothing around it: all photons represent the point.
    let is_vouched = of_all.sight == Sight::Unknown && of_all.closest == of_region.closest;
    Ok(if is_vouched { of_all } else { of_region }.radiance)
}

/// Search of [`gather`], compiled for every instruction set.
pub struct Search<'s, 'n, M> {
    /// The scene, with its photon maps.
    pub scene: &'s SceneImage,
    /// Card memory.
    pub memory: &'s mut M,
    /// Photon map to search.
    pub map: PhotonMap,
    /// Query position, metres.
    pub position: Vec3,
    /// Collector of the nearest photons.
    pub nearest: &'s mut NearestPhotons<'n>,
}

impl<M: MemoryPort> Kernel for Search<'_, '_, M> {
    type Output = Result<u32, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, map, position, nearest } = self;
        search(isa, (scene, memory), map, (position, &All), nearest)
    }
}

/// Search of [`gather_visible`], compiled for every instruction set.
struct VisibleSearch<'s, 'n, M> {
    scene: &'s SceneImage,
    memory: &'s mut M,
    map: PhotonMap,
    position: Vec3,
    region: &'s VisibleRegion,
    nearest: &'s mut NearestPhotons<'n>,
}

impl<M: MemoryPort> Kernel for VisibleSearch<'_, '_, M> {
    type Output = Result<u32, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, map, position, region, nearest } = self;
        search(isa, (scene, memory), map, (position, region), nearest)
    }
}

/// Collects in `nearest` the photons of a map that are nearest to the position `query.0` and that the filter
/// `query.1` accepts. Returns the number of photons tested.
#[inline(always)]
fn search<M: MemoryPort>(
    isa: impl Isa,
    (scene, memory): (&SceneImage, &mut M),
    map: PhotonMap,
    query: (Vec3, &impl Filter),
    nearest: &mut NearestPhotons,
) -> Result<u32, Fault> {
    let has_leaves =
        map == PhotonMap::Caustics || scene.header.section(SectionKind::PhotonLeaves).records > 0;
    let mut tested = 0;
    loop {
        tested += if has_leaves {
            leaves::gather(isa, scene, map.sections(), memory, query, nearest)?
        } else {
            kdtree::gather(isa, scene, memory, query, nearest)?
        };
        if !nearest.widen() {
            break;
        }
    }
    nearest.finish(isa);
    Ok(tested)
}

/// Selection of the nearest of given candidates, as by [`NearestPhotons`], compiled for every instruction
/// set.
pub struct Selection<'a> {
    /// Candidates to select from.
    pub candidates: Candidates<'a>,
    /// Number of candidates to select.
    pub count: usize,
}

impl Kernel for Selection<'_> {
    type Output = Option<Candidate>;

    /// Moves the `count` nearest candidates to the front, unordered, and returns the farthest of these. The
    /// other elements become meaningless. Returns `None` and changes nothing if `count` is 0 or above the
    /// number of candidates.
    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let length = self.candidates.capacity();
        select::select(isa, self.candidates, length, self.count).map(|chosen| chosen.last)
    }
}
