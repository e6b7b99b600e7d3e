//! Qualities of a picture: settings for what it is needed for.

use photoncard_shared::message::Filter;

use super::RenderSettings;
use super::groups::{Integrator, PhotonMaps, Picture};
use crate::choice::choices;

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
    Final = "final": "A picture to keep: 64 samples a pixel, four million photons",
    Paper = "paper": "The dissertation's nominal values, for studies: one sample a pixel, a hundred gather rays, no cache",
});

impl Quality {
    /// Settings of this quality; the defaults for all that it says nothing of.
    pub fn settings(self) -> RenderSettings {
        match self {
            Self::Draft => with(Values {
                samples: 4,
                gather_rays: 64,
                shadow_rays: 2,
                irradiance_error: 0.2,
                photons: 200_000,
                neighbors: 50,
                caustic_photons: 50_000,
            }),
            Self::Good => with(Values {
                samples: 16,
                gather_rays: 100,
                shadow_rays: 2,
                irradiance_error: 0.1,
                photons: 500_000,
                neighbors: 50,
                caustic_photons: 200_000,
            }),
            Self::Final => with(Values {
                samples: 64,
                gather_rays: 200,
                shadow_rays: 2,
                irradiance_error: 0.05,
                photons: 4_000_000,
                neighbors: 50,
                caustic_photons: 500_000,
            }),
            Self::Paper => RenderSettings::default(),
        }
    }
}

/// Values in which the qualities differ.
#[derive(Clone, Copy)]
struct Values {
    samples: u32,
    gather_rays: u32,
    shadow_rays: u32,
    irradiance_error: f32,
    photons: usize,
    neighbors: u32,
    caustic_photons: usize,
}

/// Settings of the values, with a filter and a cache.
fn with(values: Values) -> RenderSettings {
    let Values { samples, gather_rays, shadow_rays, irradiance_error, photons, neighbors, caustic_photons } =
        values;
    RenderSettings {
        picture: Picture { filter: Filter::BlackmanHarris, ..Picture::default() },
        photons: PhotonMaps {
            count: photons,
            neighbors,
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
