//! Options of the integrator: samples, rays and the irradiance cache.

use clap::{ArgAction, Args};
use photoncard_driver::quality::Stated;
use photoncard_driver::render::{Integrator, MIN_IRRADIANCE_ERROR, Sampling};

use super::choice::{choice, switch};
use super::distance::Distance;

#[derive(Args)]
#[command(next_help_heading = "Rays and samples")]
pub(crate) struct IntegratorOptions {
    /// Seed of all random numbers
    #[arg(long, default_value_t = Integrator::default().seed, allow_negative_numbers = true, hide_short_help = true)]
    pub(super) seed: u32,
    /// Final gather rays per sample; with the irradiance cache, per irradiance record, and per pixel on
    /// surfaces without records [default: by --quality, for the scene]
    #[arg(long, allow_negative_numbers = true)]
    gather_rays: Option<u32>,
    /// Shadow rays per sample [default: by --quality, for the scene]
    #[arg(long, allow_negative_numbers = true, hide_short_help = true)]
    shadow_rays: Option<u32>,
    /// Samples per pixel [default: by --quality, for the scene]
    #[arg(long, allow_negative_numbers = true)]
    spp: Option<u32>,
    /// Samples per pixel of the finished picture: with the irradiance cache, the gather rays of a pixel are
    /// divided among this number of samples [default: --spp]
    ///
    /// With --resume, this number and the numbers of photons and rays that are not stated are those of the
    /// kept samples.
    #[arg(long, value_name = "SPP", allow_negative_numbers = true, hide_short_help = true)]
    pub(super) planned_spp: Option<u32>,
    /// Sampling density of the directions of gather rays; it never changes the picture's expected value.
    /// Points with fewer than eight gather rays always have the density brdf [default: focused, combined for
    /// paper and sweeps]
    #[arg(long, value_parser = choice::<Sampling>(), hide_short_help = true)]
    pub(super) sampling: Option<Sampling>,
    /// Gather the indirect light of Lambertian surfaces at sparse points, and interpolate between them
    /// [default: by --quality]
    #[arg(long, value_parser = switch(), action = ArgAction::Set)]
    irradiance_cache: Option<bool>,
    /// Maximum relative error of interpolated irradiance [default: by --quality, 0.025 for paper]
    #[arg(long, value_name = "ERROR", value_parser = ic_error, allow_negative_numbers = true, hide_short_help = true)]
    pub(super) ic_error: Option<f32>,
    /// Trace up to 16 paths per sample in pixels whose first four samples differ; a smaller threshold gives
    /// more paths [default: by --quality]
    ///
    /// A pixel has s / (THRESHOLD sqrt(L)) paths per sample, where s is the standard deviation and L the mean
    /// of its first four samples. By default a pilot render chooses the threshold for the scene; adaptive
    /// sampling is off if all other settings of samples and rays are stated.
    #[arg(long, value_name = "THRESHOLD|off", value_parser = adaptive, allow_negative_numbers = true, hide_short_help = true)]
    adaptive: Option<Adaptive>,
    /// Length below which a gather ray goes on from its end, metres, or auto: derived from the density of the
    /// photons [default: auto; 0 for paper and in studies]
    ///
    /// In narrow gaps photons from outside would light the end of a short ray. With 0, every gather ray ends
    /// in a photon gather.
    #[arg(long, value_name = "METRES|auto", value_parser = Distance::near, allow_negative_numbers = true, hide_short_help = true)]
    near_distance: Option<Distance>,
}

/// Value of `--adaptive`.
#[derive(Clone, Copy)]
enum Adaptive {
    Off,
    Threshold(f32),
}

/// Maximum error of interpolated irradiance if neither `--ic-error` nor `--quality` sets one.
const DEFAULT_IC_ERROR: f32 = 0.025;

impl IntegratorOptions {
    /// Returns the settings that these options state. Settings that are not stated are those of `base`.
    pub(super) fn settings(&self, base: &Integrator) -> Integrator {
        let gather_rays = self.gather_rays.unwrap_or(base.gather_rays);
        let error = self.ic_error.or(base.irradiance_error).unwrap_or(DEFAULT_IC_ERROR);
        Integrator {
            seed: self.seed,
            samples: self.spp.unwrap_or(base.samples),
            planned_samples: self.planned_spp,
            gather_rays,
            shadow_rays: self.shadow_rays.unwrap_or(base.shadow_rays),
            sampling: self.sampling.unwrap_or(base.sampling),
            irradiance_error: (self.is_cached(base) && gather_rays > 0).then_some(error),
            adaptive_threshold: match self.adaptive {
                None => base.adaptive_threshold,
                Some(Adaptive::Off) => None,
                Some(Adaptive::Threshold(threshold)) => Some(threshold),
            },
            near_distance: self.near_distance.map_or(base.near_distance, Distance::stated),
        }
    }

    /// Returns which settings the options state, among those that `--quality` would choose.
    pub(super) fn stated(&self) -> Stated {
        Stated {
            samples: self.spp.is_some(),
            gather_rays: self.gather_rays.is_some(),
            shadow_rays: self.shadow_rays.is_some(),
            cache: self.irradiance_cache.is_some() || self.ic_error.is_some(),
            photons: false,
            caustic_photons: false,
            neighbors: false,
            adaptive: self.adaptive.is_some(),
        }
    }

    fn is_cached(&self, base: &Integrator) -> bool {
        self.irradiance_cache.unwrap_or(base.irradiance_error.is_some())
    }

    /// Reports useless options: calls `add(is_useless, name, reason)` for each option that other options can
    /// make useless.
    pub(super) fn without_effect(&self, base: &Integrator, add: &mut impl FnMut(bool, &str, &str)) {
        let is_cached = self.is_cached(base);
        let not_cached = "without --irradiance-cache on";
        add(self.planned_spp.is_some() && !is_cached, "--planned-spp", not_cached);
        add(self.ic_error.is_some() && !is_cached, "--ic-error", not_cached);
        let has_no_rays = self.irradiance_cache == Some(true) && self.gather_rays == Some(0);
        add(has_no_rays, "--irradiance-cache on", "with --gather-rays 0");
        let is_unused = self.near_distance.is_some() && self.gather_rays == Some(0);
        add(is_unused, "--near-distance", "with --gather-rays 0");
    }
}

fn adaptive(text: &str) -> Result<Adaptive, String> {
    match text.parse::<f32>() {
        _ if text == "off" => Ok(Adaptive::Off),
        Ok(threshold) if threshold.is_finite() && threshold > 0.0 => Ok(Adaptive::Threshold(threshold)),
        _ => Err("a threshold is a positive number, such as 0.1, or `off`".to_owned()),
    }
}

fn ic_error(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(error) if (MIN_IRRADIANCE_ERROR..=1.0).contains(&error) => Ok(error),
        _ => {
            Err(format!("an error is a share of the irradiance, {MIN_IRRADIANCE_ERROR} to 1, such as 0.025"))
        }
    }
}
