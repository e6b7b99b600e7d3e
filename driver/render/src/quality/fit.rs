//! Chooses settings that depend on the scene, from the variances of pilot renders.

#[cfg(test)]
mod tests;

use std::ops::RangeInclusive;

use photoncard_map::pack::PackedScene;
use photoncard_map::photon_map::PhotonsFor;
use photoncard_scene::Scene;
use photoncard_shared::message::PROBES;
use serde::Serialize;

use super::level::{Finish, Level, Quality};
use super::pilot::{Effort, SHADOW_RAYS as PILOT_SHADOW_RAYS, Variances, measure};
use crate::{Integrator, Observer, RenderError, RenderSettings};

/// Settings that pilot renders have chosen for a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Number of samples per pixel.
    pub samples: u32,
    /// Number of photons in the map.
    pub photons: usize,
    /// Maximum number of photons in the caustic map; 0 if gather rays carry the light of caustics.
    pub max_caustic_photons: usize,
    /// Cameras for which photons are traced: any, or the picture's; never [`PhotonsFor::Auto`].
    pub photons_for: PhotonsFor,
    /// Number of gather rays per irradiance record, and per pixel if irradiance is not interpolated.
    pub gather_rays: u32,
    /// Number of shadow rays per sample.
    pub shadow_rays: u32,
    /// True if irradiance is interpolated between irradiance records.
    pub interpolates: bool,
    /// Upper limit of the error bound of interpolated irradiance; infinite if the bound of the quality
    /// suffices.
    pub max_irradiance_error: f32,
    /// Adaptive threshold of the cost model, `sqrt(M) / w`, W^(1/2)/(sr^(1/2) m), for one sample per pixel
    /// and paths of cost 1. `M` is the median radiance of the lit pixels, and `w` the worth of accuracy: a
    /// relative variance of 1 in a pixel counts as much as the time of `w^2` samples.
    pub unit_threshold: f64,
    /// Adaptive threshold, W^(1/2)/(sr^(1/2) m), at which a sample after the probes has 1.1 paths on average
    /// in the pixels of the pilot. `None` if the additional paths do not at least halve the variance of
    /// direct light.
    pub spent_threshold: Option<f64>,
    /// Numbers that the scene would need, where they exceed the limits of the quality.
    pub beyond: Beyond,
    /// Noise and errors that the pilot measured, from which the settings follow.
    pub measured: Measured,
}

/// Numbers that a scene would need, where they exceed the limits of a quality or of a time; `None` elsewhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Beyond {
    /// Number of photons in the map.
    pub photons: Option<usize>,
    /// Number of gather rays per irradiance record, and per pixel without interpolation.
    pub gather_rays: Option<u32>,
    /// Number of photons needed within the limits of the quality, if the time allows fewer.
    pub photons_in_time: Option<usize>,
}

/// CPU time limit of a picture, and the properties of the picture that determine how the time is divided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeOfPicture {
    /// Time limit times the number of threads, in seconds.
    pub cpu_seconds: f64,
    /// Number of pixels.
    pub pixels: f64,
    /// Finish of the picture. A denoiser takes a part of the time.
    pub finish: Finish,
}

impl TimeOfPicture {
    /// Approximate CPU time of the denoiser, seconds; 0 without one.
    pub fn cpu_seconds_of_denoiser(&self) -> f64 {
        let seconds = SECONDS_OF_DENOISER + SECONDS_OF_DENOISED_PIXEL * self.pixels;
        if self.finish == Finish::Denoised { seconds } else { 0.0 }
    }

    /// Cost that the time limit allows for the first [`SAMPLES_IN_TIME`] samples of a pixel, in the unit of
    /// [`COST_OF_SHADOW_RAY`].
    fn cost_of_pixel(&self) -> f64 {
        let of_render = SHARE_OF_SAMPLES * self.cpu_seconds - self.cpu_seconds_of_denoiser();
        of_render / (SECONDS_OF_COST * self.pixels.max(1.0))
    }
}

/// Flags of the settings that the user stated. A fit does not change these settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stated {
    /// True if the number of samples is stated.
    pub samples: bool,
    /// True if the number of photons is stated.
    pub photons: bool,
    /// True if the number of caustic photons is stated.
    pub caustic_photons: bool,
    /// True if the number of photons of a gather is stated.
    pub neighbors: bool,
    /// True if the number of gather rays is stated.
    pub gather_rays: bool,
    /// True if the number of shadow rays is stated.
    pub shadow_rays: bool,
    /// True if the irradiance cache or its error bound is stated.
    pub cache: bool,
    /// True if adaptive sampling or its threshold is stated.
    pub adaptive: bool,
}

impl Stated {
    /// All settings that a fit would choose are stated.
    pub const ALL: Self = Self {
        samples: true,
        photons: true,
        caustic_photons: true,
        neighbors: true,
        gather_rays: true,
        shadow_rays: true,
        cache: true,
        adaptive: true,
    };

    /// Returns whether a pilot is needed to choose settings. Three settings do not count: adaptive sampling,
    /// which is off without a pilot; caustic photons, which only a short time limit changes; and the number
    /// of photons of a gather, which no pilot changes.
    pub fn needs_fit(self) -> bool {
        Self { adaptive: true, caustic_photons: true, neighbors: true, ..self } != Self::ALL
    }
}

/// Noise and photon map errors measured by pilot renders, and the number of gather rays per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Relative standard deviation of a sample caused by its position in the pixel.
    pub place: f64,
    /// Relative standard deviation of a sample caused by one shadow ray.
    pub shadow_ray: f64,
    /// Relative standard deviation of a sample caused by one gather ray.
    pub gather_ray: f64,
    /// Relative root mean square error that a map of a million photons causes in the mean of 4x4 pixels.
    pub million_photons: f64,
    /// Squared error of a photon map traced for the camera, divided by the error of a map with as many
    /// photons traced for any camera. `None` if the camera uses most photons anyway, or the user stated for
    /// which cameras photons are.
    pub photons_for_camera: Option<f64>,
    /// Number of gather rays cast per pixel, divided by the setting `gather_rays`. It includes the rays of
    /// irradiance records and of samples without interpolation.
    pub gather_rays_per_ray: f64,
    /// Number of paths from the lights per stored photon.
    pub paths_of_photon: f64,
}

impl Measured {
    /// Standard deviation of a sample with `shadow_rays` shadow rays, divided by the standard deviation with
    /// the greater of the pilot's two numbers; 1 without noise. Only the noise of positions and shadow rays
    /// counts.
    fn deviation_by(&self, shadow_rays: u32) -> f64 {
        let of_rays = |rays: u32| if rays == 0 { 0.0 } else { self.shadow_ray.powi(2) / f64::from(rays) };
        let variance = |rays: u32| self.place.powi(2) + of_rays(rays);
        let ratio = (variance(shadow_rays) / variance(PILOT_SHADOW_RAYS[1])).sqrt();
        if ratio.is_finite() { ratio } else { 1.0 }
    }
}

/// Maximum of `Measured::photons_for_camera` at which photons are traced for the camera. It is well below 1,
/// because the measured ratio is uncertain by a third.
const MAX_RATIO_FOR_CAMERA: f64 = 0.6;
/// Minimum fraction of the samples with gather rays that see a surface with a Lambertian part. Below it
/// nothing is interpolated.
const FEW_LAMBERTIAN: f64 = 0.05;
/// Range of the number of shadow rays per sample.
const SHADOW_RAYS: RangeInclusive<u32> = 1..=16;
/// Cost of a shadow ray: its CPU time divided by the CPU time of a sample without shadow rays, in rooms and
/// halls.
const COST_OF_SHADOW_RAY: f64 = 0.4;
/// Cost of a gather ray and the photon gather at its end, in the unit of [`COST_OF_SHADOW_RAY`].
const COST_OF_GATHER_RAY: f64 = 1.2;
/// Cost of tracing and storing a photon whose path stores at least one, in the unit of
/// [`COST_OF_SHADOW_RAY`].
const COST_OF_PHOTON: f64 = 2.5;
/// Cost of each further path that a photon takes, in the same unit.
const COST_OF_PATH: f64 = 0.3;
/// Maximum number of paths by which the least numbers of photons are divided where a photon takes several.
const MAX_PATHS_OF_PHOTON: f64 = 8.0;
/// Minimum and maximum of the adaptive threshold, as multiples of the cost model's threshold.
const FACTORS_OF_THRESHOLD: [f64; 2] = [0.5, 8.0];
/// Minimum of [`Variances::gather_rays_per_ray`] in the computation of costs. The measured value may be too
/// small, because the surveyed tiles may miss samples that gather.
const MIN_GATHER_RAYS_PER_RAY: f64 = 1.0 / 64.0;
/// Weight of the variance of gather rays if irradiance is interpolated between several records.
const WEIGHT_OF_RECORDS: f64 = 0.5;
/// Weight of the squared error that the photon map causes in the mean of 4x4 pixels, relative to other
/// variance. It is above 1, because the error appears as a blotch and not as noise of single pixels.
const WEIGHT_OF_MAP: f64 = 6.0;
/// [`WEIGHT_OF_MAP`] for a map that is guided to the camera. It is greater, because most photons of such a
/// map are in few places of the scene. Each place lights a large part of the picture, so that blotches are
/// wide. The pilot's small map is guided less, and shows only a third of the blotches' squared error.
const WEIGHT_OF_GUIDED_MAP: f64 = 8.0 * WEIGHT_OF_MAP;
/// Minimum number of photons in the map, per triangle of the scene; in total at most [`MOST_FOR_TRIANGLES`].
/// If photons are farther apart than the furniture is large, a room becomes too dark. The pilot does not
/// measure this bias.
const PHOTONS_OF_TRIANGLE: usize = 8;
const MOST_FOR_TRIANGLES: usize = 1_000_000;
/// Maximum error of 4x4 pixels caused by the photon map, divided by the requested noise of the picture. The
/// error of single pixels is up to twice as large.
const SHARE_OF_MAP: f64 = 0.25;
/// Maximum error of interpolated irradiance caused by the gather rays of its records, divided by the
/// requested noise of the picture.
const SHARE_OF_RECORDS: f64 = 0.5;
/// Error bound of interpolated irradiance, divided by the requested noise of the picture. Where small objects
/// cover few pixels, the error is then about half of the noise.
const IRRADIANCE_ERROR_OF_NOISE: f64 = 2.5;
/// Maximum number of photons that a requested noise can lead to. [`MAX_RAYS_OF_RECORD`] is the maximum number
/// of gather rays per irradiance record.
const MAX_PHOTONS: usize = 16_000_000;
const MAX_RAYS_OF_RECORD: u32 = 8_000;
/// Number of photons that a thread traces and stores in a second, as measured in furnished rooms.
const PHOTONS_IN_A_SECOND: f64 = 80_000.0;
/// CPU seconds per unit of cost ([`COST_OF_SHADOW_RAY`]), as measured in furnished rooms.
const SECONDS_OF_COST: f64 = 6e-6;
/// CPU seconds of a denoiser, plus `SECONDS_OF_DENOISED_PIXEL` for each pixel.
const SECONDS_OF_DENOISER: f64 = 0.05;
const SECONDS_OF_DENOISED_PIXEL: f64 = 12e-6;
/// Maximum fraction of a picture's time that its photons take.
const SHARE_OF_PHOTONS: f64 = 0.25;
/// Maximum fraction of a picture's time that its first [`SAMPLES_IN_TIME`] samples and a denoiser take.
const SHARE_OF_SAMPLES: f64 = 0.5;
/// Number of samples per pixel that every time limit should allow. With fewer samples, the time that remains
/// after the last whole pass would be a large part of the limit.
const SAMPLES_IN_TIME: f64 = 4.0;
/// Number of photons that a time limit allows, divided by the maximum number of caustic photons.
const PHOTONS_OF_CAUSTIC_PHOTON: usize = 8;
/// Minimum number of gather rays per irradiance record under a time limit, unless the fit has fewer. If the
/// time allows less than this minimum, nothing is interpolated.
const MIN_RAYS_IN_TIME: u32 = 128;
/// Time limit of a picture below which the pilot does less work, CPU seconds. The full pilot takes six in a
/// furnished room.
const SECONDS_FOR_FULL_PILOT: f64 = 60.0;
/// Number of photons that even the shortest time limit allows.
const MIN_PHOTONS_IN_TIME: usize = 50_000;

impl Fit {
    /// Adjusts the fit for a picture that is sampled until its noise, relative to its mean, is `noise`.
    /// Raises the numbers of photons and of gather rays per irradiance record, and limits the error bound of
    /// interpolation, because more samples do not reduce these errors.
    pub fn for_noise(self, noise: f64) -> Self {
        let Measured { gather_ray, million_photons, .. } = self.measured;
        let photons = 1e6 * (million_photons / (SHARE_OF_MAP * noise)).powi(2);
        let rays = WEIGHT_OF_RECORDS * (gather_ray / (SHARE_OF_RECORDS * noise)).powi(2);
        let rays = if self.interpolates { within(rays, &(0..=MAX_RAYS_OF_RECORD), 8) } else { 0 };
        let photons = self.photons.max(rounded(photons, &(0..=MAX_PHOTONS)));
        let gather_rays = self.gather_rays.max(rays);
        let Beyond { photons: more_photons, gather_rays: more_rays, .. } = self.beyond;
        Self {
            photons,
            gather_rays,
            beyond: Beyond {
                photons: more_photons.filter(|&more| more > photons),
                gather_rays: more_rays.filter(|&more| more > gather_rays),
                photons_in_time: None,
            },
            max_irradiance_error: (IRRADIANCE_ERROR_OF_NOISE * noise) as f32,
            ..self
        }
    }

    /// Adjusts the fit for a picture that is sampled until a time limit, with the stated settings of
    /// `integrator`. The photon map takes at most about a quarter of the time, or has 50,000 photons. The
    /// caustic map has at most an eighth of the number of photons that the time allows. Four samples of each
    /// pixel and the denoiser take at most about half of the time. Irradiance records have as many rays as
    /// the time allows. If it allows too few and the number of gather rays is not stated, nothing is
    /// interpolated. Each sample then has the gather rays that the time allows, at least one.
    pub fn for_time(self, time: TimeOfPicture, integrator: &Integrator, stated: Stated) -> Self {
        let paths = self.measured.paths_of_photon;
        let in_room = SHARE_OF_PHOTONS * PHOTONS_IN_A_SECOND * time.cpu_seconds;
        let most = in_room * COST_OF_PHOTON / cost_of_photon(paths);
        let most = rounded(most, &(by_paths(MIN_PHOTONS_IN_TIME, paths)..=MAX_PHOTONS));
        // Caustic photons are aimed by themselves.
        let most_caustic = rounded(in_room, &(MIN_PHOTONS_IN_TIME..=MAX_PHOTONS)) / PHOTONS_OF_CAUSTIC_PHOTON;
        let photons = self.photons.min(most);
        let shadow_rays = if stated.shadow_rays { integrator.shadow_rays } else { self.shadow_rays };
        let cost_of_sample = 1.0 + COST_OF_SHADOW_RAY * f64::from(shadow_rays);
        let rays = (time.cost_of_pixel() - SAMPLES_IN_TIME * cost_of_sample) / COST_OF_GATHER_RAY;
        let of_record = within(rays / self.measured.gather_rays_per_ray, &(1..=self.gather_rays), 1);
        let interpolates = if stated.cache {
            integrator.irradiance_error.is_some()
        } else {
            let fits = of_record >= self.gather_rays.min(MIN_RAYS_IN_TIME);
            self.interpolates && (stated.gather_rays || fits)
        };
        let of_sample = (rays / SAMPLES_IN_TIME).max(1.0) as u32;
        let of_samples = of_sample.saturating_mul(self.samples);
        Self {
            photons,
            max_caustic_photons: self.max_caustic_photons.min(most_caustic),
            interpolates,
            gather_rays: if interpolates { of_record } else { self.gather_rays.min(of_samples) },
            beyond: Beyond {
                photons_in_time: (photons < self.photons).then_some(self.photons),
                // More samples bring more rays than the quality has for a pixel.
                gather_rays: self.beyond.gather_rays.filter(|_| interpolates),
                ..self.beyond
            },
            ..self
        }
    }

    /// Writes the fit into the settings that are not stated. The shadow rays of a pixel and, without an
    /// irradiance cache, its gather rays are divided among its samples, even if the number of samples is
    /// stated.
    pub fn apply(&self, settings: &mut RenderSettings, stated: Stated) {
        let RenderSettings { photons, integrator, .. } = settings;
        if !stated.samples {
            integrator.samples = self.samples;
        }
        if !stated.photons {
            photons.count = self.photons;
        }
        // Without gather rays the map alone has the light of caustics.
        let has_rays = !stated.gather_rays || integrator.gather_rays > 0;
        if !stated.caustic_photons && (has_rays || self.max_caustic_photons > 0) {
            let fewer = |count: usize| count.min(self.max_caustic_photons);
            photons.caustic_photons = photons.caustic_photons.map(fewer);
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

    /// Threshold of adaptive sampling: [`Self::spent_threshold`], scaled to the picture's number of shadow
    /// rays and limited to [`FACTORS_OF_THRESHOLD`] times the cost model's threshold. `None` if all samples
    /// are probes, or noise is too uniform for a gain. The model gives each pixel `n = w s sqrt(1 / c)`
    /// paths, where `w` is the worth of accuracy, `s` the pixel's standard deviation over the square root of
    /// its radiance, and `c` the cost of a path.
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
    /// Chooses the settings of this quality that depend on the scene, by pilot renders with the view, filter
    /// and sampling in `settings`. Returns `None` if no setting depends on the scene. Seed, cards, threads
    /// and crop window have no effect on the result. The pilot does less work for [`Self::Draft`], and if the
    /// time limit of the picture is below 60 CPU seconds.
    ///
    /// # Errors
    /// As [`render`](crate::render).
    pub fn fit(
        self,
        (finish, time_limit): (Finish, Option<f64>),
        (scene, packed): (&Scene, &PackedScene),
        settings: &RenderSettings,
        observer: &dyn Observer,
    ) -> Result<Option<Fit>, RenderError> {
        settings.check()?;
        let Some(level) = self.level(finish) else { return Ok(None) };
        let of = Pictured {
            pixels: f64::from(settings.picture.width) * f64::from(settings.picture.height),
            triangles: scene.stored_triangles().count(),
            is_cached: settings.integrator.irradiance_error.is_some(),
        };
        let is_short = time_limit.is_some_and(|seconds| seconds < SECONDS_FOR_FULL_PILOT);
        let effort = if self == Self::Draft || is_short { Effort::LESS } else { Effort::FULL };
        Ok(Some(level.fit(&measure(effort, (scene, packed), settings, observer)?, &of)))
    }
}

/// Properties of a picture that a fit depends on.
struct Pictured {
    pixels: f64,
    triangles: usize,
    /// True if the irradiance cache may be used.
    is_cached: bool,
}

impl Level {
    /// Chooses the settings that minimise the sum of time and weighted variance in a scene.
    ///
    /// With `n` samples, rays or photons, a pixel takes the time `c n` and has the variance `v / n`. The sum
    /// `c n + w^2 v / n` is least for `n = w sqrt(v / c)`, where `w` is the worth of accuracy.
    fn fit(&self, variances: &Variances, of: &Pictured) -> Fit {
        let Variances {
            place,
            shadow_ray,
            gather_ray,
            lambertian,
            gather_rays_per_ray,
            paths_of_photon,
            has_soft_caustics,
            level,
            photon: of_scene,
            for_camera,
            ..
        } = *variances;
        // The ratio is NaN if no map has errors: there is no gain then.
        let gaining = for_camera.filter(|maps| maps.ratio < MAX_RATIO_FOR_CAMERA);
        let photon = gaining.map_or(of_scene, |maps| maps.photon);
        let number = |variance: f64, cost: f64| self.worth * (variance / cost).sqrt();
        let samples = within(number(place, 1.0), &self.samples, 4);
        let shadow_rays = number(shadow_ray, COST_OF_SHADOW_RAY) / f64::from(samples);
        let interpolates = of.is_cached && lambertian >= FEW_LAMBERTIAN;
        let weight = if interpolates { WEIGHT_OF_RECORDS } else { 1.0 };
        let cost = COST_OF_GATHER_RAY * gather_rays_per_ray.max(MIN_GATHER_RAYS_PER_RAY);
        let gather_rays = number(weight * gather_ray, cost);
        let weight_of_map = if gaining.is_some() { WEIGHT_OF_GUIDED_MAP } else { WEIGHT_OF_MAP };
        let photons = number(weight_of_map * photon, cost_of_photon(paths_of_photon) / of.pixels);
        let for_triangles = of.triangles.saturating_mul(PHOTONS_OF_TRIANGLE).min(MOST_FOR_TRIANGLES);
        let [fewest, most] = [*self.photons.start(), *self.photons.end()];
        let fewest = by_paths(fewest.max(for_triangles).min(most), paths_of_photon);
        Fit {
            samples,
            photons: rounded(photons, &(fewest..=most)),
            max_caustic_photons: if has_soft_caustics { 0 } else { usize::MAX },
            photons_for: if gaining.is_some() { PhotonsFor::Camera } else { PhotonsFor::Scene },
            gather_rays: within(gather_rays, &self.gather_rays, 8),
            beyond: Beyond {
                photons: (photons > most as f64).then(|| rounded(photons, &(0..=MAX_PHOTONS))),
                gather_rays: (gather_rays > f64::from(*self.gather_rays.end()))
                    .then(|| within(gather_rays, &(0..=MAX_RAYS_OF_RECORD), 8)),
                photons_in_time: None,
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
                paths_of_photon,
            },
        }
    }
}

/// Cost of tracing and storing a photon that takes this number of paths, in the unit of
/// [`COST_OF_SHADOW_RAY`].
fn cost_of_photon(paths: f64) -> f64 {
    COST_OF_PHOTON + COST_OF_PATH * (paths - 1.0).max(0.0)
}

/// Number of photons that as many paths store as store `photons` in a room, where each path stores at least
/// one; at least an eighth of `photons`.
fn by_paths(photons: usize, paths_of_photon: f64) -> usize {
    (photons as f64 / paths_of_photon.clamp(1.0, MAX_PATHS_OF_PHOTON)) as usize
}

/// Rounds `number` up to a multiple of `step`, and clamps it to the bounds. Returns the maximum for NaN.
fn within(number: f64, bounds: &RangeInclusive<u32>, step: u32) -> u32 {
    if number.is_nan() {
        return *bounds.end();
    }
    let steps = (number / f64::from(step)).ceil() as u32;
    steps.saturating_mul(step).clamp(*bounds.start(), *bounds.end())
}

/// Rounds a positive number to two significant digits.
fn two_digits(number: f64) -> f32 {
    format!("{number:.1e}").parse().unwrap_or(f32::NAN)
}

/// Clamps a number of photons, and rounds it up to two significant digits; the maximum if it is not finite.
fn rounded(number: f64, bounds: &RangeInclusive<usize>) -> usize {
    let finite = if number.is_finite() { number } else { *bounds.end() as f64 };
    let bounded = finite.clamp(*bounds.start() as f64, *bounds.end() as f64) as usize;
    let digit = 10_usize.pow(bounded.max(10).ilog10() - 1);
    bounded.div_ceil(digit) * digit
}
