//! Settings that depend on the scene, from the variances of pilot renders.

use std::ops::RangeInclusive;

use super::Quality;
use super::pilot::{Variances, measure};
use crate::pack::PackedScene;
use crate::render::{Observer, RenderError, RenderSettings};
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
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Relative standard deviation of a pixel by shadow rays, and by gather rays.
    noise: f64,
    /// Relative error of 4x4 pixels by the photon map.
    map_error: f64,
    shadow_rays: RangeInclusive<u32>,
    gather_rays: RangeInclusive<u32>,
    photons: RangeInclusive<usize>,
}

/// Variance of a pixel whose irradiance is interpolated between records, over that of one record.
const INTERPOLATED: f64 = 0.5;
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
                map_error: 0.015,
                shadow_rays: 1..=4,
                gather_rays: 32..=128,
                photons: 50_000..=400_000,
            },
            Self::Good => Aims {
                noise: 0.02,
                map_error: 0.006,
                shadow_rays: 1..=8,
                gather_rays: 64..=400,
                photons: 100_000..=1_000_000,
            },
            Self::Final => Aims {
                noise: 0.007,
                map_error: 0.003,
                shadow_rays: 1..=16,
                gather_rays: 200..=1600,
                photons: 500_000..=4_000_000,
            },
            Self::Paper => return None,
        })
    }

    /// Settings of this quality that suit a scene, by pilot renders with the camera, the size, the samples and the materials of
    /// `settings`; `None` where no setting depends on the scene. They depend on nothing else, such as cards or threads.
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
        let error = self.settings().integrator.irradiance_error;
        Ok(Some(aims.fit(&variances, settings.integrator.samples, error)))
    }
}

impl Aims {
    /// The cheapest settings within the bounds that meet the aims.
    fn fit(&self, variances: &Variances, samples: u32, error: Option<f32>) -> Fit {
        let Variances { shadow_ray, gather_ray, photon, lambertian } = *variances;
        let allowed = self.noise * self.noise;
        let of_pixel = INTERPOLATED * gather_ray / allowed;
        let gather_rays = within(of_pixel, &self.gather_rays, 8);
        let is_cached = lambertian >= FEW_LAMBERTIAN;
        Fit {
            photons: photons(photon / (self.map_error * self.map_error), &self.photons),
            gather_rays: if is_cached { gather_rays } else { gather_rays.div_ceil(samples.max(1)) },
            shadow_rays: within(shadow_ray / (allowed * f64::from(samples.max(1))), &self.shadow_rays, 1),
            irradiance_error: error.filter(|_| is_cached),
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
