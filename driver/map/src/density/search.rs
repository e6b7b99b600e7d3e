//! Determines the maximum distance of gathers by searching the photon map on the host.

use glam::Vec3;
use photoncard_firmware::kind::ReferenceCandidates;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::photon::{NearestPhotons, PhotonMap, gather};
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Photon, PhotonLeaf, PhotonNode, WideNode};
use photoncard_shared::message::{Fault, FaultCode};
use rayon::prelude::*;

use crate::pack::CardImage;
use crate::photon::Importons;

/// Squared radius with which a search that begins in a node starts, divided by the squared distance of the
/// k-th neighbour of the photon sampled in this node.
const MOST: f32 = 1.4;
/// Fraction of the sampled photons whose k-th neighbour lies within `GatherDistances::usual`.
const USUAL_SHARE: f64 = 0.95;
/// Maximum distance of gathers divided by the greatest sampled distance. It exceeds 1 because photons that
/// are not sampled may have greater distances.
const BEYOND_SAMPLES: f32 = 1.5;

/// Search of the photon map, with its buffer.
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

    /// Number k of photons of a gather.
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
    /// Maximum distance of gathers. All sampled photons have k neighbours within it, so that the radius of a
    /// gather follows the density at its point.
    pub(crate) greatest: f32,
}

/// Distances of the k-th neighbours of sampled photons. For each node of the photon map that has leaves, one
/// photon in them is sampled.
pub(crate) struct SampledDistances {
    neighbors: u32,
    samples: Vec<Sample>,
}

/// Distance of the k-th neighbour of one photon.
struct Sample {
    /// Index of the node whose leaf holds the photon.
    node: usize,
    position: Vec3,
    normal: u8,
    /// Distance, metres; [`UNLIMITED`] in a map with at most k photons.
    distance: f32,
}

/// Distance that exceeds any other and whose square is finite.
const UNLIMITED: f32 = 1e18;

impl SampledDistances {
    /// Samples the photon map of a card image for `k = neighbors`.
    ///
    /// # Errors
    /// If the card image is malformed.
    pub(crate) fn new(image: &CardImage, neighbors: u32) -> Result<Self, Fault> {
        let nodes = image.section(SectionKind::PhotonNodes);
        let samples: Result<Vec<Option<Sample>>, Fault> = nodes
            .par_iter()
            .enumerate()
            .map_init(
                || Searcher::new(image, neighbors, UNLIMITED),
                |searcher, (node, line)| {
                    let links = WideNode(&line.0).links();
                    let middle = (links.leaves > 0).then_some(links.first_leaf + links.leaves / 2);
                    middle.map(|leaf| Sample::new(searcher, image, node, leaf)).transpose()
                },
            )
            .collect();
        Ok(Self { neighbors, samples: samples?.into_iter().flatten().collect() })
    }

    /// Writes the squared radius with which a search starts, divided by k, into each node with a sample
    /// ([`PhotonNode::photon_share`]).
    pub(crate) fn write_shares(&self, image: &mut CardImage) {
        let nodes = image.section_mut(SectionKind::PhotonNodes);
        for sample in self.samples.iter().filter(|sample| sample.distance < UNLIMITED) {
            let share = MOST * sample.distance * sample.distance / self.neighbors as f32;
            PhotonNode::set_photon_share(&mut nodes[sample.node].0, share);
        }
    }

    /// Returns the distances of gathers. They follow from the samples near importons or, without importons,
    /// from all samples. If there is no such sample, they are the scene's diagonal.
    pub(crate) fn of_gathers(&self, image: &CardImage, importons: Option<&Importons>) -> GatherDistances {
        let is_used = |sample: &&Sample| {
            importons.is_none_or(|importons| importons.indirect.is_used(sample.position, sample.normal))
        };
        let used = self.samples.iter().filter(is_used).map(|sample| sample.distance);
        // `distances` is empty in a map with no more photons than neighbours, and if no sample is near an
        // importon.
        let mut distances: Vec<f32> = used.filter(|&distance| distance < UNLIMITED).collect();
        distances.sort_by(f32::total_cmp);
        let within = |share: f64| {
            let place = (distances.len() as f64 * share) as usize;
            let covered = distances.get(place.min(distances.len().saturating_sub(1))).copied();
            covered.unwrap_or_else(|| image.diagonal()).max(f32::MIN_POSITIVE.sqrt())
        };
        let greatest = (BEYOND_SAMPLES * within(1.0)).min(image.diagonal());
        GatherDistances { usual: within(USUAL_SHARE), greatest }
    }
}

impl Sample {
    /// Measures the distance of the k-th neighbour of one photon in leaf `leaf`, a child of node `node`.
    fn new(searcher: &mut Searcher, image: &CardImage, node: usize, leaf: u32) -> Result<Self, Fault> {
        let fault = Fault { code: FaultCode::Record, detail: leaf };
        let line = image.section(SectionKind::PhotonLeaves).get(leaf as usize).ok_or(fault)?;
        let photons = PhotonLeaf::read(&line.0);
        let photon = leaf % photons.photons().max(1);
        let position = searcher.scene.header.photon_grid.position(photons.point(photon)).into();
        let [.., low, high] = photons.content(photon);
        let normal = Photon::normal_of_flags(u16::from_le_bytes([low, high]));
        Ok(Self { node, position, normal, distance: searcher.radius(position)? })
    }
}
