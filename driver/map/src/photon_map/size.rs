//! Size of the photon map in a card image.

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::PhotonLeaf;
use serde::{Deserialize, Serialize};

use crate::pack::CardImage;

/// Size of a photon map in card memory, without caustics and irradiance points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotonMapSize {
    /// Number of photons in the map: `N_PM` of Table 7.1 of the dissertation.
    pub photons: u64,
    /// Size of the lines that hold the photons and their tree, bytes.
    pub bytes: u64,
}

impl PhotonMapSize {
    /// Measures the photon map of a card image, in either layout.
    pub fn of(image: &CardImage) -> Self {
        let (scene, _) = image.view();
        let lines = |kind| image.section(kind).len();
        let leaves = image.section(SectionKind::PhotonLeaves);
        let in_leaves: u64 = leaves.iter().map(|line| u64::from(PhotonLeaf::read(&line.0).photons())).sum();
        let kinds = [SectionKind::Photons, SectionKind::PhotonNodes, SectionKind::PhotonLeaves];
        Self {
            photons: in_leaves + u64::from(scene.header.section(SectionKind::Photons).records),
            bytes: kinds.map(lines).iter().sum::<usize>() as u64 * LINE_BYTES as u64,
        }
    }
}
