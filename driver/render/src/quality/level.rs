//! Parameters of each quality: worth of accuracy relative to time, limits, settings for an unknown scene.

use std::ops::RangeInclusive;

use photoncard_picture::choice::choices;

use crate::{Filter, Integrator, PhotonMaps, Picture, RenderSettings, Sampling};

/// Quality of a picture. It determines the settings that the user does not state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// Quality for a quick look at the scene.
    Draft,
    /// Quality for a picture to show.
    #[default]
    Good,
    /// Quality for a picture to keep.
    Final,
    /// Nominal values of the dissertation (Table 7.1), which studies use.
    Paper,
}

/// Finish of a picture: whether a denoiser follows the render. The settings of a quality depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Finish {
    /// The picture is shown as it is.
    #[default]
    Rendered,
    /// A denoiser removes noise that is independent in each pixel; fewer samples and rays suffice. Nothing is
    /// interpolated, because the denoiser would take errors that neighbouring pixels share for light.
    Denoised,
}

impl Finish {
    /// Returns [`Self::Denoised`] if `is_denoised`, otherwise [`Self::Rendered`].
    pub fn new(is_denoised: bool) -> Self {
        if is_denoised { Self::Denoised } else { Self::Rendered }
    }
}

choices!(Quality {
    Draft = "draft": "A look at the scene: visible noise, 8 to 16 samples a pixel",
    Good = "good": "A picture to show: without visible noise in a room, 24 to 48 samples a pixel",
    Final = "final": "A picture to keep: 64 to 256 samples a pixel",
    Paper = "paper": "The dissertation's nominal values, for studies: one sample a pixel, a hundred gather rays, no cache",
});

/// Number of photons that a gather searches for. Fewer photons blur less and take less time. With 24 photons,
/// the noise of gather rays still exceeds that of photons.
const NEIGHBORS: u32 = 24;

/// Parameters of a quality whose settings depend on the scene: the worth of accuracy relative to time, and
/// limits of the settings.
pub(super) struct Level {
    /// Worth of accuracy, `w` in [`Self::fit`]. A relative variance of 1 in a pixel counts as much as the
    /// time of `w^2` samples.
    pub(super) worth: f64,
    /// Range of the number of samples per pixel.
    pub(super) samples: RangeInclusive<u32>,
    /// Range of the number of gather rays per irradiance record, and per pixel without interpolation.
    pub(super) gather_rays: RangeInclusive<u32>,
    /// Range of the number of photons in the map.
    pub(super) photons: RangeInclusive<usize>,
    /// Number of photons in the caustic map.
    caustic_photons: usize,
    /// Relative error bound of interpolated irradiance; `None` if every sample casts gather rays.
    irradiance_error: Option<f32>,
}

impl Level {
    /// Parameters for a picture that is denoised: half the worth of accuracy, half of the fewest samples, an
    /// eighth of the gather rays of a pixel, and no interpolation.
    fn denoised(self) -> Self {
        let share = |range: RangeInclusive<u32>, divisor| range.start() / divisor..=range.end() / divisor;
        Self {
            worth: 0.5 * self.worth,
            samples: self.samples.start() / 2..=*self.samples.end(),
            gather_rays: share(self.gather_rays, 8),
            irradiance_error: None,
            ..self
        }
    }
}

impl Quality {
    /// Parameters of this quality; `None` if none of its settings depends on the scene.
    pub(super) fn level(self, finish: Finish) -> Option<Level> {
        let level = match self {
            Self::Draft => Level {
                worth: 50.0,
                samples: 8..=16,
                gather_rays: 32..=128,
                photons: 100_000..=400_000,
                caustic_photons: 50_000,
                irradiance_error: Some(0.2),
            },
            Self::Good => Level {
                worth: 400.0,
                samples: 24..=48,
                gather_rays: 128..=1024,
                photons: 200_000..=4_000_000,
                caustic_photons: 200_000,
                irradiance_error: Some(0.1),
            },
            Self::Final => Level {
                worth: 2500.0,
                samples: 64..=256,
                gather_rays: 200..=2000,
                photons: 1_000_000..=8_000_000,
                caustic_photons: 500_000,
                irradiance_error: Some(0.05),
            },
            Self::Paper => return None,
        };
        Some(match finish {
            Finish::Rendered => level,
            Finish::Denoised => level.denoised(),
        })
    }

    /// Settings of this quality for an unknown scene, without a pilot. They have the fewest samples of the
    /// quality, four shadow rays, and the geometric mean of its limits for photons and gather rays.
    pub fn settings(self) -> RenderSettings {
        self.settings_for(Finish::Rendered)
    }

    /// Settings like [`Self::settings`], but for a picture with the finish `finish`.
    pub fn settings_for(self, finish: Finish) -> RenderSettings {
        let Some(level) = self.level(finish) else {
            return RenderSettings::default().with(|s| {
                (s.integrator.near_distance, s.integrator.sampling) = (Some(0.0), Sampling::Product);
            });
        };
        let samples = *level.samples.start();
        let rays = middle(*level.gather_rays.start() as usize, *level.gather_rays.end() as usize) as u32;
        let gather_rays = if level.irradiance_error.is_some() { rays } else { rays.div_ceil(samples) };
        RenderSettings {
            picture: Picture { filter: Filter::BlackmanHarris, ..Picture::default() },
            photons: PhotonMaps {
                count: middle(*level.photons.start(), *level.photons.end()),
                neighbors: NEIGHBORS,
                caustic_photons: Some(level.caustic_photons),
                ..PhotonMaps::default()
            },
            integrator: Integrator {
                samples,
                gather_rays,
                shadow_rays: 4,
                irradiance_error: level.irradiance_error,
                ..Integrator::default()
            },
            ..RenderSettings::default()
        }
    }
}

/// Geometric mean of two numbers.
fn middle(low: usize, high: usize) -> usize {
    (low * high).isqrt()
}
