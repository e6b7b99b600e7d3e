//! Parameters of a photon map.

use photoncard_picture::choice::choices;
use photoncard_shared::message::{Camera, Radiance};
use serde::{Deserialize, Serialize};

/// Parameters of a photon map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Seed of the photon paths.
    pub seed: u32,
    /// Camera whose picture alone uses the photons, which are then guided towards what it uses; `None` for
    /// any camera.
    pub camera: Option<Camera>,
    /// Number of photons to store.
    pub photons: usize,
    /// Number of photons of a density estimate.
    pub neighbors: u32,
    /// Maximum distance of a gather, metres; `None` to derive it from the density of the photons.
    pub max_distance: Option<f32>,
    /// Number of caustic photons to store; 0 for no caustic map.
    pub caustic_photons: usize,
    /// Number of photons of a density estimate in the caustic map.
    pub caustic_neighbors: u32,
    /// Layout of the map in card memory.
    pub layout: PhotonLayout,
    /// Estimate of reflected radiance: [`Radiance::Precomputed`] adds irradiance points to the image.
    pub radiance: Radiance,
}

/// Cameras that photons are traced for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PhotonsFor {
    /// Any camera: photons depend on the scene alone.
    #[default]
    Scene,
    /// The camera of the picture: photons are guided towards what it uses, without bias.
    Camera,
    /// The camera of the picture where a pilot measures that it gains, and otherwise any.
    Auto,
}

choices!(PhotonsFor {
    Auto = "auto": "The camera of the picture, where a pilot measures that this gains",
    Scene = "scene": "Any camera",
    Camera = "camera": "The camera of the picture: fewer where it does not use them",
});

impl PhotonsFor {
    /// The cameras without a pilot: any, where one would choose.
    #[must_use]
    pub fn resolved(self) -> Self {
        if self == Self::Auto { Self::Scene } else { self }
    }
}

/// Layout of the photon map in card memory. A gather finds the same photons in each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PhotonLayout {
    /// The left-balanced kd-tree of Jensen (2001), of 20-byte records: the dissertation's.
    Jensen,
    /// Photons in leaves that fill a line of card memory each: smaller, and faster to search.
    #[default]
    Lines,
}

choices!(PhotonLayout {
    Jensen = "jensen": "A left-balanced kd-tree of 20-byte photons",
    Lines = "lines": "Leaves of one memory line each",
});
