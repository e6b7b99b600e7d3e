//! Settings that depend on the scene, from the variances of pilot renders.

use std::ops::RangeInclusive;

use photoncard_map::pack::PackedScene;
use photoncard_map::photon_map::PhotonsFor;
use photoncard_scene::Scene;
use photoncard_shared::message::PROBES;
use serde::Serialize;

use super::level::{Level, Quality};
use super::pilot::{SHADOW_RAYS as PILOT_SHADOW_RAYS, Variances, measure};
use crate::{Integrator, Observer, RenderError, RenderSettings};

/// Settings that suit a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Number of samples of a pixel.
    pub samples: u32,
    /// Number of photons in the map.
    pub photons: usize,
    /// Guiding of the photons: never [`PhotonsFor::Auto`].
    pub photons_for: PhotonsFor,
    /// Number of gather rays of a pixel, and of an irradiance record.
    pub gather_rays: u32,
    /// Number of shadow rays per sample.
    pub shadow_rays: u32,
    /// If irradiance is interpolated: false where hardly any could be.
    pub interpolates: bool,
    /// Maximum error of interpolated irradiance; infinite where the quality's own is small enough.
    pub max_irradiance_error: f32,
    /// Model's adaptive threshold per unit of sample cost, W^(1/2)/(sr^(1/2) m).
    pub unit_threshold: f64,
    /// Adaptive threshold that gives the pilot's pixels 1.1 paths per sample, W^(1/2)/(sr^(1/2) m); `None`
    /// where these paths lower the variance of direct light by less than half.
    pub spent_threshold: Option<f64>,
    /// Numbers that the scene would take beyond the bounds of the quality.
    pub beyond: Beyond,
    /// Noise of the pilot, from which the settings follow.
    pub measured: Measured,
}

/// Numbers that a scene would take, where they exceed the bounds of a quality.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Beyond {
    /// Number of photons in the map.
    pub photons: Option<usize>,
    /// Number of gather rays of a pixel, and of an irradiance record.
    pub gather_rays: Option<u32>,
}

/// Settings that a fit leaves as they are, because they are stated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stated {
    /// Number of samples.
    pub samples: bool,
    /// Number of photons.
    pub photons: bool,
    /// Number of gather rays.
    pub gather_rays: bool,
    /// Number of shadow rays.
    pub shadow_rays: bool,
    /// The irradiance cache, or its error.
    pub cache: bool,
    /// Adaptive sampling, or its threshold.
    pub adaptive: bool,
}

impl Stated {
    /// All settings that a fit would choose.
    pub const ALL: Self = Self {
        samples: true,
        photons: true,
        gather_rays: true,
        shadow_rays: true,
        cache: true,
        adaptive: true,
    };

    /// Returns whether there is a setting that only a pilot can choose. Adaptive sampling alone is none: it
    /// is off then.
    pub fn needs_fit(self) -> bool {
        Self { adaptive: true, ..self } != Self::ALL
    }
}

/// Relative standard deviations of samples in a pilot render, and their costs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// By the place of a sample in its pixel.
    pub place: f64,
    /// By one shadow ray.
    pub shadow_ray: f64,
    /// By one gather ray.
    pub gather_ray: f64,
    /// Error of 4x4 pixels by a map of a million photons.
    pub million_photons: f64,
    /// Squared error of a map for the camera over that of one for any camera; `None` where the camera uses
    /// most photons anyway, or the photons are stated to be for either.
    pub photons_for_camera: Option<f64>,
    /// Number of gather rays that a pixel costs for each one of its own, by irradiance records and samples
    /// without.
    pub gather_rays_per_ray: f64,
}

impl Measured {
    /// Deviation of a sample by its place and some shadow rays, over that by the pilot's; 1 without noise.
    fn deviation_by(&self, shadow_rays: u32) -> f64 {
        let of_rays = |rays: u32| if rays == 0 { 0.0 } else { self.shadow_ray.powi(2) / f64::from(rays) };
        let variance = |rays: u32| self.place.powi(2) + of_rays(rays);
        let ratio = (variance(shadow_rays) / variance(PILOT_SHADOW_RAYS[1])).sqrt();
        if ratio.is_finite() { ratio } else { 1.0 }
    }
}

/// Maximum squared error of a map for the camera, over that of one for any camera, for which photons are for
/// the camera: the ratio of two pilots is uncertain by a third.
const MAX_RATIO_FOR_CAMERA: f64 = 0.6;
/// Share of samples with a Lambertian part below which nothing is interpolated.
const FEW_LAMBERTIAN: f64 = 0.05;
/// Number of shadow rays of a sample.
const SHADOW_RAYS: RangeInclusive<u32> = 1..=16;
/// CPU time of a shadow ray over that of a sample without its rays to lights, as measured in rooms and halls.
const COST_OF_SHADOW_RAY: f64 = 0.4;
/// CPU time of a gather ray with its gather, likewise.
const COST_OF_GATHER_RAY: f64 = 1.2;
/// CPU time of tracing and storing a photon, likewise.
const COST_OF_PHOTON: f64 = 2.5;
/// Bounds of the threshold of adaptive sampling, over that of the model.
const FACTORS_OF_THRESHOLD: [f64; 2] = [0.5, 8.0];
/// Minimum number of gather rays that a pixel is taken to cost for each one of its own: the surveyed tiles
/// may miss what gathers.
const MIN_GATHER_RAYS_PER_RAY: f64 = 1.0 / 64.0;
/// Weight of the variance of gather rays where several records are interpolated.
const WEIGHT_OF_RECORDS: f64 = 0.5;
/// Weight of the squared error of the map in 4x4 pixels: it is no noise of a pixel, but a blotch.
const WEIGHT_OF_MAP: f64 = 6.0;
/// Error of 4x4 pixels by the photon map, as a share of the noise that a picture is rendered to. That of
/// single pixels is up to twice as large.
const SHARE_OF_MAP: f64 = 0.25;
/// Error of interpolated irradiance by the rays of its records, likewise.
const SHARE_OF_RECORDS: f64 = 0.5;
/// Allowed error of interpolated irradiance over the noise that a picture is rendered to: the picture then
/// errs by about half of the noise where small objects are seen with few pixels.
const IRRADIANCE_ERROR_OF_NOISE: f64 = 2.5;
/// Maximum numbers of photons, and of rays of a record, for the noise that a picture is rendered to.
const MAX_PHOTONS: usize = 8_000_000;
const MAX_RAYS_OF_RECORD: u32 = 8_000;

impl Fit {
    /// Settings for a picture that gets samples until their noise is `noise`, relative to the mean pixel:
    /// with more photons, and more rays of irradiance records, where the errors that no number of samples
    /// lowers would exceed their share of it.
    pub fn for_noise(self, noise: f64) -> Self {
        let Measured { gather_ray, million_photons, .. } = self.measured;
        let photons = 1e6 * (million_photons / (SHARE_OF_MAP * noise)).powi(2);
        let rays = WEIGHT_OF_RECORDS * (gather_ray / (SHARE_OF_RECORDS * noise)).powi(2);
        let rays = if self.interpolates { within(rays, &(0..=MAX_RAYS_OF_RECORD), 8) } else { 0 };
        let photons = self.photons.max(rounded(photons, &(0..=MAX_PHOTONS)));
        let gather_rays = self.gather_rays.max(rays);
        let Beyond { photons: more_photons, gather_rays: more_rays } = self.beyond;
        Self {
            photons,
            gather_rays,
            beyond: Beyond {
                photons: more_photons.filter(|&more| more > photons),
                gather_rays: more_rays.filter(|&more| more > gather_rays),
            },
            max_irradiance_error: (IRRADIANCE_ERROR_OF_NOISE * noise) as f32,
            ..self
        }
    }

    /// Changes settings to these, but for the stated ones. Samples of a stated number share the shadow rays
    /// of a pixel, and without a cache its gather rays.
    pub fn apply(&self, settings: &mut RenderSettings, stated: Stated) {
        let RenderSettings { photons, integrator, .. } = settings;
        if !stated.samples {
            integrator.samples = self.samples;
        }
        if !stated.photons {
            photons.count = self.photons;
        }
        if photons.photons_for == PhotonsFor::Auto {
            photons.photons_for = self.photons_for;
        }
        if !stated.shadow_rays {
            let of_pixel = f64::from(self.shadow_rays) * f64::from(self.samples);
            integrator.shadow_rays = within(of_pixel / f64::from(integrator.samples.max(1)), &SHADOW_RAYS, 1);
        }
        if !stated.cache {
            let of_fit = |error: f32| self.interpolates.then_some(error.min(self.max_irradiance_error));
            integrator.irradiance_error = integrator.irradiance_error.and_then(of_fit);
        }
        if !stated.gather_rays {
            let of_sample = self.gather_rays.div_ceil(integrator.samples.max(1));
            integrator.gather_rays =
                if integrator.irradiance_error.is_some() { self.gather_rays } else { of_sample };
        }
        if !stated.adaptive {
            integrator.adaptive_threshold = self.adaptive_threshold(integrator);
        }
    }

    /// Threshold of adaptive sampling: [`Self::spent_threshold`] for the picture's shadow rays, within
    /// [`FACTORS_OF_THRESHOLD`] of that by which each pixel has the number of samples that it is worth, `n =
    /// w s sqrt(1 / c)` with `s` its deviation relative to the root of its radiance; `None` where all samples
    /// are probes, or noise is even.
    fn adaptive_threshold(&self, integrator: &Integrator) -> Option<f32> {
        let samples = integrator.planned();
        let cost = 1.0 + COST_OF_SHADOW_RAY * f64::from(integrator.shadow_rays);
        let of_model = f64::from(samples) * cost.sqrt() * self.unit_threshold;
        let [low, high] = FACTORS_OF_THRESHOLD.map(|factor| factor * of_model);
        let spent = self.spent_threshold? * self.measured.deviation_by(integrator.shadow_rays);
        // The bounds, if they are numbers, are in order.
        let threshold = two_digits(spent.max(low).min(high));
        (samples > PROBES && threshold.is_finite() && threshold > 0.0).then_some(threshold)
    }
}

impl Quality {
    /// Settings of this quality that suit a scene, by pilot renders with view, filter and sampling of
    /// `settings`; `None` where no setting depends on the scene. Seed, cards, threads and crop window have no
    /// effect.
    ///
    /// # Errors
    /// As [`render`](crate::render).
    pub fn fit(
        self,
        scene: &Scene,
        packed: &PackedScene,
        settings: &RenderSettings,
        observer: &dyn Observer,
    ) -> Result<Option<Fit>, RenderError> {
        settings.check()?;
        let Some(level) = self.level() else { return Ok(None) };
        let of = Pictured {
            pixels: f64::from(settings.picture.width) * f64::from(settings.picture.height),
            is_cached: settings.integrator.irradiance_error.is_some(),
        };
        Ok(Some(level.fit(&measure(scene, packed, settings, observer)?, &of)))
    }
}

/// A picture, as far as a fit depends on it.
struct Pictured {
    /// Number of pixels.
    pixels: f64,
    /// If the irradiance cache may be used.
    is_cached: bool,
}

impl Level {
    /// Settings for the variances of a scene in a picture: those with the least sum of time and variance.
    ///
    /// With `n` of something, samples or rays or photons, a pixel takes the time `c n` and has the variance
    /// `v / n`. The sum of `c n + w^2 v / n` is the least for `n = w sqrt(v / c)`, `w` the worth of accuracy.
    fn fit(&self, variances: &Variances, of: &Pictured) -> Fit {
        let Variances {
            place,
            shadow_ray,
            gather_ray,
            lambertian,
            gather_rays_per_ray,
            level,
            photon: of_scene,
            for_camera,
            ..
        } = *variances;
        // NaN without errors, and then no gain.
        let gaining = for_camera.filter(|maps| maps.ratio < MAX_RATIO_FOR_CAMERA);
        let photon = gaining.map_or(of_scene, |maps| maps.photon);
        let number = |variance: f64, cost: f64| self.worth * (variance / cost).sqrt();
        let samples = within(number(place, 1.0), &self.samples, 4);
        let shadow_rays = number(shadow_ray, COST_OF_SHADOW_RAY) / f64::from(samples);
        let interpolates = of.is_cached && lambertian >= FEW_LAMBERTIAN;
        let weight = if interpolates { WEIGHT_OF_RECORDS } else { 1.0 };
        let cost = COST_OF_GATHER_RAY * gather_rays_per_ray.max(MIN_GATHER_RAYS_PER_RAY);
        let gather_rays = number(weight * gather_ray, cost);
        let photons = number(WEIGHT_OF_MAP * photon, COST_OF_PHOTON / of.pixels);
        Fit {
            samples,
            photons: rounded(photons, &self.photons),
            photons_for: if gaining.is_some() { PhotonsFor::Camera } else { PhotonsFor::Scene },
            gather_rays: within(gather_rays, &self.gather_rays, 8),
            beyond: Beyond {
                photons: (photons > *self.photons.end() as f64).then(|| rounded(photons, &(0..=MAX_PHOTONS))),
                gather_rays: (gather_rays > f64::from(*self.gather_rays.end()))
                    .then(|| within(gather_rays, &(0..=MAX_RAYS_OF_RECORD), 8)),
            },
            shadow_rays: within(shadow_rays, &SHADOW_RAYS, 1),
            interpolates,
            max_irradiance_error: f32::INFINITY,
            unit_threshold: level.sqrt() / self.worth,
            spent_threshold: variances.deviations.worthy_threshold(),
            measured: Measured {
                place: place.sqrt(),
                shadow_ray: shadow_ray.sqrt(),
                gather_ray: gather_ray.sqrt(),
                million_photons: (photon / 1e6).sqrt(),
                photons_for_camera: for_camera.map(|maps| maps.ratio).filter(|ratio| ratio.is_finite()),
                gather_rays_per_ray,
            },
        }
    }
}

/// The least multiple of `step` that is not below a number, within bounds; the maximum for no number.
fn within(number: f64, bounds: &RangeInclusive<u32>, step: u32) -> u32 {
    if number.is_nan() {
        return *bounds.end();
    }
    let steps = (number / f64::from(step)).ceil() as u32;
    steps.saturating_mul(step).clamp(*bounds.start(), *bounds.end())
}

/// A positive number rounded to two digits.
fn two_digits(number: f64) -> f32 {
    format!("{number:.1e}").parse().unwrap_or(f32::NAN)
}

/// A number of photons within bounds, rounded up to two digits; the maximum for none that is finite.
fn rounded(number: f64, bounds: &RangeInclusive<usize>) -> usize {
    let finite = if number.is_finite() { number } else { *bounds.end() as f64 };
    let bounded = finite.clamp(*bounds.start() as f64, *bounds.end() as f64) as usize;
    let digit = 10_usize.pow(bounded.max(10).ilog10() - 1);
    bounded.div_ceil(digit) * digit
}

#[cfg(test)]
mod tests {
    use super::super::paths::Deviations;
    use super::super::pilot::ForCamera;
    use super::*;

    const VARIANCES: Variances = Variances {
        place: 0.0036,
        shadow_ray: 0.04,
        gather_ray: 0.12,
        photon: 3.0,
        lambertian: 1.0,
        gather_rays_per_ray: 0.2,
        for_camera: None,
        level: 4.0,
        deviations: Deviations::NONE,
    };
    const PICTURED: Pictured = Pictured { pixels: 65_536.0, is_cached: true };

    fn good(variances: &Variances) -> Fit {
        Quality::Good.level().unwrap().fit(variances, &PICTURED)
    }

    /// Time and weighted variance of a pixel.
    fn loss(variances: &Variances, [samples, shadow_rays, gather_rays, photons]: [f64; 4]) -> f64 {
        let Variances { place, shadow_ray, gather_ray, photon, gather_rays_per_ray, .. } = variances;
        let rays = samples * shadow_rays;
        let time = samples
            + rays * COST_OF_SHADOW_RAY
            + gather_rays * gather_rays_per_ray * COST_OF_GATHER_RAY
            + photons * COST_OF_PHOTON / PICTURED.pixels;
        let variance = place / samples
            + shadow_ray / rays
            + gather_ray * WEIGHT_OF_RECORDS / gather_rays
            + photon * WEIGHT_OF_MAP / photons;
        time + Quality::Good.level().unwrap().worth.powi(2) * variance
    }

    #[test]
    fn other_settings_cost_more_than_they_are_worth() {
        let fit = good(&VARIANCES);
        let chosen = [fit.samples, fit.shadow_rays, fit.gather_rays, fit.photons as u32].map(f64::from);
        assert_eq!(chosen, [24.0, 6.0, 200.0, 280_000.0]);
        for (index, factor) in (0..4).flat_map(|index| [(index, 0.7), (index, 1.4)]) {
            let mut other = chosen;
            other[index] *= factor;
            if index == 0 {
                // The shadow rays of a pixel, not of a sample.
                other[1] /= factor;
            }
            assert!(loss(&VARIANCES, other) > loss(&VARIANCES, chosen), "{index} {factor}");
        }
    }

    #[test]
    fn light_without_noise_takes_the_fewest_rays_and_noisy_light_no_more_than_the_most() {
        let all = |value| {
            let values =
                Variances { place: value, shadow_ray: value, gather_ray: value, photon: value, ..VARIANCES };
            let fit = good(&values);
            (fit.samples, fit.shadow_rays, fit.gather_rays, fit.photons)
        };
        assert_eq!(all(0.0), (24, 1, 128, 200_000));
        for endless in [1e12, f64::INFINITY] {
            assert_eq!(all(endless), (48, 16, 1024, 1_000_000));
        }
        assert_eq!(good(&Variances { photon: f64::NAN, ..VARIANCES }).photons, 1_000_000);
        assert_eq!(
            good(&Variances { gather_ray: 0.0, gather_rays_per_ray: 0.0, ..VARIANCES }).gather_rays,
            128
        );
    }

    #[test]
    fn photons_are_for_the_camera_where_that_gains_and_are_then_fewer() {
        let by = |ratio: f64| {
            let maps = ForCamera { photon: 0.25 * VARIANCES.photon, ratio };
            good(&Variances { for_camera: Some(maps), ..VARIANCES })
        };
        let [gaining, even] = [by(0.25), by(0.8)];
        assert_eq!([gaining.photons_for, even.photons_for], [PhotonsFor::Camera, PhotonsFor::Scene]);
        assert_eq!(even.photons, good(&VARIANCES).photons);
        assert!(gaining.photons < even.photons && gaining.measured.photons_for_camera == Some(0.25));
        let applied = |photons_for| {
            let mut settings = Quality::Good.settings();
            settings.photons.photons_for = photons_for;
            gaining.apply(&mut settings, Stated::default());
            settings.photons.photons_for
        };
        assert_eq!(applied(PhotonsFor::Auto), PhotonsFor::Camera);
        assert_eq!(applied(PhotonsFor::Scene), PhotonsFor::Scene);
    }

    #[test]
    fn numbers_beyond_the_bounds_are_those_that_the_scene_would_take() {
        let beyond = |photon, gather_ray| good(&Variances { photon, gather_ray, ..VARIANCES }).beyond;
        assert_eq!(beyond(VARIANCES.photon, VARIANCES.gather_ray), Beyond::default());
        let Beyond { photons, gather_rays } = beyond(100.0 * VARIANCES.photon, 100.0 * VARIANCES.gather_ray);
        assert_eq!([photons, gather_rays.map(|rays| rays as usize)], [Some(2_800_000), Some(2000)]);
        let most = beyond(f64::INFINITY, f64::INFINITY);
        assert_eq!(most, Beyond { photons: Some(MAX_PHOTONS), gather_rays: Some(MAX_RAYS_OF_RECORD) });
    }

    /// Rays of records are shared by the pixels around them.
    #[test]
    fn pixels_without_records_take_more_rays_for_equal_costs() {
        let level = Quality::Good.level().unwrap();
        let alone = level.fit(&VARIANCES, &Pictured { is_cached: false, ..PICTURED });
        assert!(!alone.interpolates && alone.gather_rays > good(&VARIANCES).gather_rays);
        assert_eq!(alone.gather_rays, good(&Variances { lambertian: 0.0, ..VARIANCES }).gather_rays);
    }

    #[test]
    fn little_noise_takes_the_photons_and_rays_of_records_that_keep_their_errors_below_it() {
        let fit = good(&VARIANCES);
        assert_eq!(Fit { max_irradiance_error: f32::INFINITY, ..fit.for_noise(1.0) }, fit);
        for noise in [0.02, 0.01, 0.005] {
            let Fit { photons, gather_rays, interpolates, .. } = fit.for_noise(noise);
            assert!(interpolates);
            let of_map = VARIANCES.photon / photons as f64;
            let of_records = WEIGHT_OF_RECORDS * VARIANCES.gather_ray / f64::from(gather_rays);
            let settings = Quality::Good
                .settings()
                .with(|settings| fit.for_noise(noise).apply(settings, Stated::default()));
            assert!(
                settings.integrator.irradiance_error.is_some_and(|error| f64::from(error) <= 2.501 * noise)
            );
            assert!(of_map <= (0.25 * noise).powi(2), "{of_map}");
            assert!(of_records <= (0.5 * noise).powi(2) || gather_rays == MAX_RAYS_OF_RECORD, "{of_records}");
        }
        let least = fit.for_noise(1e-6);
        assert_eq!((least.photons, least.gather_rays), (MAX_PHOTONS, MAX_RAYS_OF_RECORD));
        let alone = Fit { interpolates: false, ..fit };
        assert_eq!(alone.for_noise(1e-3).gather_rays, fit.gather_rays);
    }

    #[test]
    fn a_fit_changes_what_is_not_stated() {
        let fit = Fit { interpolates: false, ..good(&VARIANCES) };
        let initial = Quality::Good.settings();
        let applied = |stated| initial.clone().with(|settings| fit.apply(settings, stated));
        assert_eq!(applied(Stated::ALL), initial);
        let of_samples = applied(Stated::default()).integrator;
        assert_eq!((of_samples.irradiance_error, of_samples.gather_rays), (None, 9));
        assert_eq!((of_samples.samples, of_samples.shadow_rays), (24, 6));
        let cached = applied(Stated { cache: true, ..Stated::default() }).integrator;
        assert_eq!((cached.irradiance_error, cached.gather_rays), (initial.integrator.irradiance_error, 200));
        let photons = applied(Stated { photons: true, ..Stated::default() });
        assert_eq!(photons.photons.count, initial.photons.count);
        assert_eq!(photons.integrator.shadow_rays, 6);
    }

    #[test]
    fn the_threshold_spends_what_the_pilot_measured_near_that_of_the_model() {
        let fit = good(&VARIANCES);
        let threshold = |spent, samples| {
            let integrator = Integrator { samples, shadow_rays: 4, ..Quality::Good.settings().integrator };
            Fit { spent_threshold: spent, ..fit }.adaptive_threshold(&integrator)
        };
        // 24 samples of cost 2.6, median radiance 4, worth 400.
        let of_model = 24.0 * (4.0 * 2.6_f64).sqrt() / 400.0;
        for (spent, expected) in [(0.0, 0.5), (0.9, 0.9), (7.0, 7.0), (1e9, 8.0)] {
            let found = f64::from(threshold(Some(spent * of_model), 24).unwrap());
            assert!((found / (expected * of_model) - 1.0).abs() < 0.05, "{spent}: {found} {expected}");
        }
        assert_eq!([threshold(Some(of_model), PROBES), threshold(None, 24)], [None; 2]);
    }

    #[test]
    fn a_shadow_ray_alone_has_twice_the_deviation_of_four() {
        let Measured { place, .. } = good(&VARIANCES).measured;
        let by_rays = Measured { place: 0.0, ..good(&VARIANCES).measured };
        assert!(
            (by_rays.deviation_by(1) - 2.0).abs() < 1e-9 && (by_rays.deviation_by(16) - 0.5).abs() < 1e-9
        );
        let by_place = Measured { place, shadow_ray: 0.0, ..by_rays };
        assert_eq!([0, 1, 16].map(|rays| by_place.deviation_by(rays)), [1.0; 3]);
        assert_eq!(by_rays.deviation_by(0), 0.0);
        assert_eq!(Measured { shadow_ray: 0.0, ..by_rays }.deviation_by(1), 1.0);
    }

    #[test]
    fn samples_of_a_stated_number_share_the_rays_of_a_pixel() {
        let fit = good(&VARIANCES);
        for (samples, shadow_rays) in [(1, 16), (64, 3), (1000, 1)] {
            let mut settings = Quality::Good.settings();
            settings.integrator.samples = samples;
            fit.apply(&mut settings, Stated { samples: true, ..Stated::default() });
            assert_eq!(
                (settings.integrator.samples, settings.integrator.shadow_rays),
                (samples, shadow_rays)
            );
        }
    }

    #[test]
    fn a_better_quality_never_takes_fewer_of_anything() {
        let fits = [Quality::Draft, Quality::Good, Quality::Final]
            .map(|quality| quality.level().unwrap().fit(&VARIANCES, &PICTURED));
        for [worse, better] in [[fits[0], fits[1]], [fits[1], fits[2]]] {
            assert!(worse.samples <= better.samples && worse.photons <= better.photons);
            assert!(worse.gather_rays <= better.gather_rays);
            assert!(worse.samples * worse.shadow_rays <= better.samples * better.shadow_rays);
        }
        assert!(Quality::Paper.level().is_none());
    }
}
