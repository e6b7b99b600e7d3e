//! Settings that depend on the scene, from the variances of pilot renders.

use std::ops::RangeInclusive;

use serde::Serialize;

use super::Quality;
use super::pilot::{Variances, measure};
use crate::pack::PackedScene;
use crate::render::{Integrator, Observer, RenderError, RenderSettings};
use crate::scene::Scene;

/// Settings that suit a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Number of photons in the map.
    pub photons: usize,
    /// Number of gather rays, of a record and of a pixel with the irradiance cache, else of a sample.
    pub gather_rays: u32,
    /// Number of shadow rays per sample.
    pub shadow_rays: u32,
    /// Maximum relative error of interpolated irradiance; `None` where hardly anything could be interpolated.
    pub irradiance_error: Option<f32>,
    /// What the settings follow from.
    pub measured: Measured,
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
    /// Relative standard deviation of a record, or of a pixel, by its gather rays: less, as pixels around a record share its error, which
    /// shows as a blotch.
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
    /// Changes settings to these.
    pub fn apply(&self, settings: &mut RenderSettings) {
        let Self { photons, gather_rays, shadow_rays, irradiance_error, measured: _ } = *self;
        settings.photons.count = photons;
        settings.integrator.gather_rays = gather_rays;
        settings.integrator.shadow_rays = shadow_rays;
        settings.integrator.irradiance_error = irradiance_error;
    }
}

impl Quality {
    /// Aims of this quality; `None` where no setting depends on the scene.
    fn aims(self) -> Option<Aims> {
        Some(match self {
            Self::Draft => Aims {
                noise: 0.06,
                blotches: 0.06,
                map_error: 0.015,
                shadow_rays: 1..=4,
                gather_rays: 32..=128,
                photons: 50_000..=400_000,
            },
            Self::Good => Aims {
                noise: 0.02,
                blotches: 0.02,
                map_error: 0.006,
                shadow_rays: 1..=8,
                gather_rays: 64..=512,
                photons: 100_000..=1_000_000,
            },
            Self::Final => Aims {
                noise: 0.007,
                blotches: 0.01,
                map_error: 0.003,
                shadow_rays: 1..=16,
                gather_rays: 200..=1600,
                photons: 500_000..=4_000_000,
            },
            Self::Paper => return None,
        })
    }

    /// Settings of this quality that suit a scene, by pilot renders with the camera, the size, the samples and the seed of `settings`;
    /// `None` where no setting depends on the scene. Without an irradiance cache in `settings` there is none. Cards, threads and the crop
    /// window have no effect.
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
        let Integrator { samples, irradiance_error, .. } = settings.integrator;
        Ok(Some(aims.fit(&variances, samples, irradiance_error)))
    }
}

impl Aims {
    /// The cheapest settings within the bounds that meet the aims.
    fn fit(&self, variances: &Variances, samples: u32, error: Option<f32>) -> Fit {
        let Variances { shadow_ray, gather_ray, photon, lambertian } = *variances;
        let gather_rays = within(gather_ray / (self.blotches * self.blotches), &self.gather_rays, 8);
        let allowed = self.noise * self.noise * f64::from(samples.max(1));
        let error = error.filter(|_| lambertian >= FEW_LAMBERTIAN);
        Fit {
            photons: photons(photon / (self.map_error * self.map_error), &self.photons),
            gather_rays: if error.is_some() { gather_rays } else { gather_rays.div_ceil(samples.max(1)) },
            shadow_rays: within(shadow_ray / allowed, &self.shadow_rays, 1),
            irradiance_error: error,
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

/// A number of photons within bounds, rounded up to two digits.
fn photons(number: f64, bounds: &RangeInclusive<usize>) -> usize {
    let bounded = number.clamp(*bounds.start() as f64, *bounds.end() as f64) as usize;
    let digit = 10_usize.pow(bounded.max(10).ilog10() - 1);
    bounded.div_ceil(digit) * digit
}

#[cfg(test)]
mod tests {
    use super::*;

    const VARIANCES: Variances =
        Variances { shadow_ray: 0.03, gather_ray: 0.1, photon: 10.0, lambertian: 1.0 };

    fn good(variances: Variances) -> Fit {
        Quality::Good.aims().unwrap().fit(&variances, 16, Some(0.1))
    }

    /// Variances of 0.03 / (16 * 5) and 0.1 / 256 are the squares of 2 %, and 10 / 280,000 that of 0.6 %.
    #[test]
    fn the_fewest_rays_and_photons_that_meet_the_aims_are_chosen() {
        let fit = good(VARIANCES);
        assert_eq!([fit.shadow_rays, fit.gather_rays], [5, 256]);
        assert_eq!((fit.photons, fit.irradiance_error), (280_000, Some(0.1)));
    }

    #[test]
    fn light_without_noise_takes_the_fewest_rays_and_noisy_light_no_more_than_the_most() {
        let none = good(Variances { shadow_ray: 0.0, gather_ray: 0.0, photon: 0.0, ..VARIANCES });
        assert_eq!((none.shadow_rays, none.gather_rays, none.photons), (1, 64, 100_000));
        let endless =
            good(Variances { shadow_ray: 1e9, gather_ray: 1e9, photon: f64::INFINITY, ..VARIANCES });
        assert_eq!((endless.shadow_rays, endless.gather_rays, endless.photons), (8, 512, 1_000_000));
    }

    #[test]
    fn without_lambertian_surfaces_samples_share_a_pixels_gather_rays() {
        let fit = good(Variances { lambertian: 0.01, ..VARIANCES });
        assert_eq!((fit.irradiance_error, fit.gather_rays), (None, 16));
    }

    #[test]
    fn a_better_quality_never_takes_fewer_of_anything() {
        let fits = [Quality::Draft, Quality::Good, Quality::Final].map(|quality| {
            quality.aims().unwrap().fit(&VARIANCES, quality.settings().integrator.samples, Some(0.1))
        });
        for [worse, better] in [[fits[0], fits[1]], [fits[1], fits[2]]] {
            assert!(worse.photons <= better.photons && worse.gather_rays <= better.gather_rays);
        }
        assert!(Quality::Paper.aims().is_none());
    }
}
