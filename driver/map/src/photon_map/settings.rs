//! Parameters of a photon map.

use photoncard_picture::choice::choices;
use photoncard_shared::message::{Camera, Radiance};
use serde::{Deserialize, Serialize};

/// Parameters of a photon map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Seed of the photon paths.
    pub seed: u32,
    /// Camera whose picture uses the photons. Paths are then guided towards the surfaces that this picture
    /// uses. `None` if photons are for any camera.
    pub camera: Option<Camera>,
    /// Number of photons to store.
    pub photons: usize,
    /// Number of photons per density estimate.
    pub neighbors: u32,
    /// Maximum distance of a gather, metres; `None` to derive it from the density of the photons.
    pub max_distance: Option<f32>,
    /// Number of caustic photons to store; 0 for no caustic map.
    pub caustic_photons: usize,
    /// Number of photons per density estimate in the caustic map.
    pub caustic_neighbors: u32,
    /// Layout of the map in card memory.
    pub layout: PhotonLayout,
    /// Source of the reflected radiance. [`Radiance::Precomputed`] adds irradiance points to the card image.
    pub radiance: Radiance,
}

/// Cameras that can use the photons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PhotonsFor {
    /// Any camera. Photons depend only on the scene.
    #[default]
    Scene,
    /// The picture's camera. Photons are guided towards what its picture uses, without bias.
    Camera,
    /// The picture's camera if a pilot finds that guiding helps, otherwise any camera.
    Auto,
}

choices!(PhotonsFor {
    Auto = "auto": "The camera of the picture, where a pilot finds that this gains",
    Scene = "scene": "Any camera",
    Camera = "camera": "The camera of the picture: fewer where it does not use them",
});

impl PhotonsFor {
    /// Replaces [`Self::Auto`] by [`Self::Scene`], for callers that run no pilot.
    #[must_use]
    pub fn resolved(self) -> Self {
        if self == Self::Auto { Self::Scene } else { self }
    }
}

/// Layout of the photon map in card memory. A gather finds the same photons in both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PhotonLayout {
    /// Left-balanced kd-tree of 20-byte records (Jensen 2001), as in the dissertation.
    Jensen,
    /// Leaves of photons, each of which fills a line of card memory. This layout is smaller and faster to
    /// search.
    #[default]
    Lines,
}

choices!(PhotonLayout {
    Jensen = "jensen": "A left-balanced kd-tree of 20-byte photons",
    Lines = "lines": "Leaves of one memory line each",
});
