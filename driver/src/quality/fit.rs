//! Settings that depend on the scene, from the variances of pilot renders.

use std::ops::RangeInclusive;

use serde::Serialize;

use super::level::Quality;
use super::pilot::{Variances, measure};
use crate::pack::PackedScene;
use crate::render::{Observer, RenderError, RenderSettings};
use crate::scene::Scene;

/// Settings that suit a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Number of photons in the map.
    pub photons: usize,
    /// Number of gather rays of a pixel, and of an irradiance record.
    pub gather_rays: u32,
    /// Number of shadow rays per sample.
    pub shadow_rays: u32,
    /// If irradiance is interpolated: false where hardly any could be.
    pub interpolates: bool,
    /// Noise of the pilot, from which the settings follow.
    pub measured: Measured,
}

/// Settings that a fit leaves as they are, because they are stated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stated {
    /// Number of photons.
    pub photons: bool,
    /// Number of gather rays.
    pub gather_rays: bool,
    /// Number of shadow rays.
    pub shadow_rays: bool,
    /// The irradiance cache, or its error.
    pub cache: bool,
}

impl Stated {
    /// All settings that a fit would choose.
    pub const ALL: Self = Self { photons: true, gather_rays: true, shadow_rays: true, cache: true };
}

/// Relative standard deviations of samples in a pilot render.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// By one shadow ray.
    pub shadow_ray: f64,
    /// By one gather ray.
    pub gather_ray: f64,
    /// Error of 4x4 pixels by a map of a million photons.
    pub million_photons: f64,
}

/// Aims of a quality, and the bounds within which they are followed.
struct Aims {
    /// Relative standard deviation of a pixel by its shadow rays.
    noise: f64,
    /// Relative standard deviation of a record, or of a pixel, by its gather rays. Pixels around a record share its error, which shows as
    /// a blotch.
    blotches: f64,
    /// Relative error of 4x4 pixels by the photon map.
    map_error: f64,
    shadow_rays: RangeInclusive<u32>,
    gather_rays: RangeInclusive<u32>,
    photons: RangeInclusive<usize>,
}

/// Share of samples with a Lambertian part below which nothing is interpolated.
const FEW_LAMBERTIAN: f64 = 0.05;

impl Fit {
    /// Changes settings to these, but for the stated ones. Without a cache the samples of a pixel share its gather rays.
    pub fn apply(&self, settings: &mut RenderSettings, stated: Stated) {
        let RenderSettings { photons, integrator, .. } = settings;
        if !stated.photons {
            photons.count = self.photons;
        }
        if !stated.shadow_rays {
            integrator.shadow_rays = self.shadow_rays;
        }
        if !stated.cache && !self.interpolates {
            integrator.irradiance_error = None;
        }
        if !stated.gather_rays {
            let of_sample = self.gather_rays.div_ceil(integrator.samples.max(1));
            integrator.gather_rays =
                if integrator.irradiance_error.is_some() { self.gather_rays } else { of_sample };
        }
    }
}

impl Quality {
    /// Aims of this quality; `None` where no setting depends on the scene.
    fn aims(self) -> Option<Aims> {
        Some(match self {
            Self::Draft => Aims {
                noise: 0.06,
                blotches: 0.06,
                map_error: 0.01,
                shadow_rays: 1..=4,
                gather_rays: 32..=128,
                photons: 100_000..=400_000,
            },
            Self::Good => Aims {
                noise: 0.02,
                blotches: 0.02,
                map_error: 0.003,
                shadow_rays: 1..=8,
                gather_rays: 64..=512,
                photons: 200_000..=1_000_000,
            },
            Self::Final => Aims {
                noise: 0.007,
                blotches: 0.01,
                map_error: 0.0015,
                shadow_rays: 1..=16,
                gather_rays: 200..=1600,
                photons: 1_000_000..=4_000_000,
            },
            Self::Paper => return None,
        })
    }

    /// Settings of this quality that suit a scene, by pilot renders with camera, size, samples and sampling of `settings`; `None` where no
    /// setting depends on the scene. Seed, cards, threads and crop window have no effect.
    ///
    /// # Errors
    /// As [`render`](crate::render::render).
    pub fn fit(
        self,
        scene: &Scene,
        packed: &PackedScene,
        settings: &RenderSettings,
        observer: &dyn Observer,
    ) -> Result<Option<Fit>, RenderError> {
        settings.check()?;
        let Some(aims) = self.aims() else { return Ok(None) };
        let variances = measure(scene, packed, settings, observer)?;
        Ok(Some(aims.fit(&variances, settings.integrator.samples)))
    }
}

impl Aims {
    /// The cheapest settings within the bounds that meet the aims.
    fn fit(&self, variances: &Variances, samples: u32) -> Fit {
        let Variances { shadow_ray, gather_ray, photon, lambertian } = *variances;
        let allowed = self.noise * self.noise * f64::from(samples.max(1));
        Fit {
            photons: photons(photon / (self.map_error * self.map_error), &self.photons),
            gather_rays: within(gather_ray / (self.blotches * self.blotches), &self.gather_rays, 8),
            shadow_rays: within(shadow_ray / allowed, &self.shadow_rays, 1),
            interpolates: lambertian >= FEW_LAMBERTIAN,
            measured: Measured {
                shadow_ray: shadow_ray.sqrt(),
                gather_ray: gather_ray.sqrt(),
                million_photons: (photon / 1e6).sqrt(),
            },
        }
    }
}

/// The least multiple of `step` that is not below a number, within bounds.
fn within(number: f64, bounds: &RangeInclusive<u32>, step: u32) -> u32 {
    let steps = (number / f64::from(step)).ceil() as u32;
    steps.saturating_mul(step).clamp(*bounds.start(), *bounds.end())
}

/// A number of photons within bounds, rounded up to two digits; the maximum for none that is finite.
fn photons(number: f64, bounds: &RangeInclusive<usize>) -> usize {
    let finite = if number.is_finite() { number } else { *bounds.end() as f64 };
    let bounded = finite.clamp(*bounds.start() as f64, *bounds.end() as f64) as usize;
    let digit = 10_usize.pow(bounded.max(10).ilog10() - 1);
    bounded.div_ceil(digit) * digit
}

#[cfg(test)]
mod tests {
    use super::*;

    const VARIANCES: Variances =
        Variances { shadow_ray: 0.03, gather_ray: 0.1, photon: 5.0, lambertian: 1.0 };

    fn good(variances: Variances) -> Fit {
        Quality::Good.aims().unwrap().fit(&variances, 16)
    }

    /// Variances of 0.03 / (16 * 5) and 0.1 / 256 are the squares of 2 %, and 5 / 560,000 that of 0.3 %.
    #[test]
    fn the_fewest_rays_and_photons_that_meet_the_aims_are_chosen() {
        let fit = good(VARIANCES);
        assert_eq!([fit.shadow_rays, fit.gather_rays], [5, 256]);
        assert_eq!((fit.photons, fit.interpolates), (560_000, true));
    }

    #[test]
    fn light_without_noise_takes_the_fewest_rays_and_noisy_light_no_more_than_the_most() {
        let none = good(Variances { shadow_ray: 0.0, gather_ray: 0.0, photon: 0.0, ..VARIANCES });
        assert_eq!((none.shadow_rays, none.gather_rays, none.photons), (1, 64, 200_000));
        for endless in [1e12, f64::INFINITY] {
            let endless =
                good(Variances { shadow_ray: endless, gather_ray: endless, photon: endless, ..VARIANCES });
            assert_eq!((endless.shadow_rays, endless.gather_rays, endless.photons), (8, 512, 1_000_000));
        }
        assert_eq!(good(Variances { photon: f64::NAN, ..VARIANCES }).photons, 1_000_000);
    }

    #[test]
    fn a_fit_changes_what_is_not_stated() {
        let fit = Fit { interpolates: false, ..good(VARIANCES) };
        let initial = Quality::Good.settings();
        let applied = |stated| initial.clone().with(|settings| fit.apply(settings, stated));
        assert_eq!(applied(Stated::ALL), initial);
        let of_samples = applied(Stated::default()).integrator;
        assert_eq!((of_samples.irradiance_error, of_samples.gather_rays), (None, 16));
        let cached = applied(Stated { cache: true, ..Stated::default() }).integrator;
        assert_eq!((cached.irradiance_error, cached.gather_rays), (initial.integrator.irradiance_error, 256));
        let photons = applied(Stated { photons: true, ..Stated::default() });
        assert_eq!(photons.photons.count, initial.photons.count);
        assert_eq!(photons.integrator.shadow_rays, 5);
    }

    #[test]
    fn a_better_quality_never_takes_fewer_of_anything() {
        let fits = [Quality::Draft, Quality::Good, Quality::Final]
            .map(|quality| quality.aims().unwrap().fit(&VARIANCES, quality.settings().integrator.samples));
        for [worse, better] in [[fits[0], fits[1]], [fits[1], fits[2]]] {
            assert!(worse.photons <= better.photons && worse.gather_rays <= better.gather_rays);
        }
        assert!(Quality::Paper.aims().is_none());
    }
}
