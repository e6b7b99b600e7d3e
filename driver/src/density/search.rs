//! Maximum distance of gathers, from searches of the photon map on the host.

use glam::Vec3;
use photoncard_firmware::kind::ReferenceCandidates;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::photon::{NearestPhotons, PhotonMap, gather};
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Photon, PhotonLeaf};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use crate::pack::CardImage;
use crate::photon::{ImportonGrid, Importons};

/// Number of leaves that the automatic maximum distance is estimated from, one photon of each.
const SAMPLED_LEAVES: usize = 2048;
/// Share of the sampled photons whose k-th neighbour lies within the usual distance.
const USUAL_SHARE: f64 = 0.95;
/// Automatic maximum distance over the greatest distance of a sampled photon's k-th neighbour: there may be greater ones.
const BEYOND_SAMPLES: f32 = 1.5;

/// A search of the photon map, with its buffer.
pub(super) struct Searcher<'a> {
    pub(super) scene: SceneImage,
    pub(super) memory: Lines<'a>,
    buffer: Box<ReferenceCandidates>,
    map: PhotonMap,
    neighbors: u32,
    max_distance: f32,
}

impl<'a> Searcher<'a> {
    pub(super) fn new(image: &'a CardImage, neighbors: u32, max_distance: f32) -> Self {
        let (scene, memory) = image.view();
        Self { scene, memory, buffer: Box::default(), map: PhotonMap::Indirect, neighbors, max_distance }
    }

    /// Number of photons of a gather.
    pub(super) fn neighbors(&self) -> u32 {
        self.neighbors
    }

    /// Radius of a gather at `position`, metres: the distance of the k-th photon, or the maximum distance.
    pub(super) fn radius(&mut self, position: Vec3) -> Result<f32, Fault> {
        let mut nearest = NearestPhotons::new(self.buffer.view(), self.neighbors, self.max_distance);
        gather(&self.scene, &mut self.memory, self.map, position, &mut nearest)?;
        Ok(nearest.radius())
    }
}

/// Distances of the k-th neighbours of photons, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GatherDistances {
    /// Distance within which most photons have k neighbours.
    pub(crate) usual: f32,
    /// Maximum distance of gathers: all sampled photons have k neighbours within, so that the radius of a gather follows the density at its
    /// point.
    pub(crate) greatest: f32,
}

/// Distances of gathers, `k = neighbors`; with importons, among photons where there are any.
///
/// # Errors
/// If the image is malformed.
pub(crate) fn gather_distances(
    image: &CardImage,
    neighbors: u32,
    importons: Option<&Importons>,
) -> Result<GatherDistances, Fault> {
    let importons = importons.map(|importons| &importons.indirect);
    let [usual, greatest] = distances_within(image, importons, neighbors, [USUAL_SHARE, 1.0])?;
    Ok(GatherDistances { usual, greatest: (BEYOND_SAMPLES * greatest).min(image.diagonal()) })
}

/// Distances within which some shares of the photons, of those at importons, have `neighbors` neighbours.
fn distances_within<const N: usize>(
    image: &CardImage,
    importons: Option<&ImportonGrid>,
    neighbors: u32,
    shares: [f64; N],
) -> Result<[f32; N], Fault> {
    let leaves = image.section(SectionKind::PhotonLeaves);
    let grid = image.view().0.header.photon_grid;
    let unlimited = f32::MAX.sqrt() * 0.5;
    let distances: Result<Vec<f32>, Fault> = leaves
        .par_iter()
        .step_by(leaves.len().div_ceil(SAMPLED_LEAVES).max(1))
        .enumerate()
        .map_init(
            || Searcher::new(image, neighbors, unlimited),
            |searcher, (sample, line)| {
                let leaf = PhotonLeaf::read(&line.0);
                let photon = sample as u32 % leaf.photons().max(1);
                let position = grid.position(leaf.point(photon)).into();
                let [.., low, high] = leaf.content(photon);
                let normal = Photon::normal_of_flags(u16::from_le_bytes([low, high]));
                let is_used = importons.is_none_or(|importons| importons.is_used(position, normal));
                if is_used { searcher.radius(position) } else { Ok(unlimited) }
            },
        )
        .collect();
    let mut distances = distances?;
    // A map of fewer photons than neighbours has no such distances, nor has a photon without importons.
    distances.retain(|&distance| distance < unlimited);
    distances.sort_by(f32::total_cmp);
    Ok(shares.map(|share| {
        let place = (distances.len() as f64 * share) as usize;
        let covered = distances.get(place.min(distances.len().saturating_sub(1))).copied();
        covered.unwrap_or_else(|| image.diagonal()).max(f32::MIN_POSITIVE.sqrt())
    }))
}
