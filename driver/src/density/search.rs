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
/// Share of the sampled photons whose k-th neighbour lies within the automatic maximum distance.
const COVERED_SHARE: f64 = 0.95;

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

    /// Maximum distance of gathers, metres.
    pub(super) fn max_distance(&self) -> f32 {
        self.max_distance
    }

    /// Radius of a gather at `position`, metres: the distance of the k-th photon, or the maximum distance.
    pub(super) fn radius(&mut self, position: Vec3) -> Result<f32, Fault> {
        let mut nearest = NearestPhotons::new(self.buffer.view(), self.neighbors, self.max_distance);
        gather(&self.scene, &mut self.memory, self.map, position, &mut nearest)?;
        if !nearest.is_full() {
            return Ok(self.max_distance);
        }
        let farthest = nearest.candidates().map(|candidate| candidate.distance_squared()).fold(0.0, f32::max);
        Ok(farthest.sqrt())
    }
}

/// Automatic maximum distance of gathers, metres: the 95th percentile of the distance of the k-th neighbour,
/// `k = neighbors`; with importons, the lesser of those among all photons and among photons where there are importons. A distance by few
/// photons in the dark alone would reach into the light beyond a corner.
///
/// # Errors
/// If the image is malformed.
pub(crate) fn automatic_max_distance(
    image: &CardImage,
    neighbors: u32,
    importons: Option<&Importons>,
) -> Result<f32, Fault> {
    let among = |importons| distance_within(image, importons, neighbors, COVERED_SHARE);
    let of_all = among(None)?;
    Ok(match importons {
        Some(importons) => of_all.min(among(Some(&importons.indirect))?),
        None => of_all,
    })
}

/// Distance within which the share `share` of the photons, of those at importons, have `neighbors` neighbours.
fn distance_within(
    image: &CardImage,
    importons: Option<&ImportonGrid>,
    neighbors: u32,
    share: f64,
) -> Result<f32, Fault> {
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
    let place = (distances.len() as f64 * share) as usize;
    let covered = distances.get(place.min(distances.len().saturating_sub(1))).copied();
    Ok(covered.unwrap_or_else(|| image.diagonal()).max(f32::MIN_POSITIVE.sqrt()))
}
