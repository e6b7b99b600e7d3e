//! Qualities, and their settings for a scene that is not known.

use crate::choice::choices;
use crate::render::{Filter, Integrator, PhotonMaps, Picture, RenderSettings};

/// Quality of a picture, by which settings that are not stated are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// A look at the scene.
    Draft,
    /// A picture to show.
    #[default]
    Good,
    /// A picture to keep.
    Final,
    /// The dissertation's nominal values (Table 7.1): those of studies.
    Paper,
}

choices!(Quality {
    Draft = "draft": "A look at the scene: 4 samples a pixel, visible noise",
    Good = "good": "A picture to show: 16 samples a pixel, without visible noise in a room",
    Final = "final": "A picture to keep: 64 samples a pixel",
    Paper = "paper": "The dissertation's nominal values, for studies: one sample a pixel, a hundred gather rays, no cache",
});

/// Photons that a gather searches for: fewer blur less, and 24 leave the noise of gather rays as it is.
const NEIGHBORS: u32 = 24;

impl Quality {
    /// Settings of this quality for a scene that is not known: middle values where [`Self::fit`] chooses.
    pub fn settings(self) -> RenderSettings {
        let [samples, gather_rays, shadow_rays] = match self {
            Self::Draft => [4, 64, 2],
            Self::Good => [16, 200, 2],
            Self::Final => [64, 400, 2],
            Self::Paper => return RenderSettings::default(),
        };
        let (irradiance_error, count, caustic_photons) = match self {
            Self::Draft => (0.2, 200_000, 50_000),
            Self::Good => (0.1, 500_000, 200_000),
            Self::Final | Self::Paper => (0.05, 2_000_000, 500_000),
        };
        RenderSettings {
            picture: Picture { filter: Filter::BlackmanHarris, ..Picture::default() },
            photons: PhotonMaps {
                count,
                neighbors: NEIGHBORS,
                caustic_photons: Some(caustic_photons),
                ..PhotonMaps::default()
            },
            integrator: Integrator {
                samples,
                gather_rays,
                shadow_rays,
                irradiance_error: Some(irradiance_error),
                ..Integrator::default()
            },
            ..RenderSettings::default()
        }
    }
}
