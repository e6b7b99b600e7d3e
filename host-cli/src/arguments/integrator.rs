//! Options of the estimation of light by rays.

use clap::{ArgAction, Args};
use photoncard_driver::choice::Choice;
use photoncard_driver::render::{Integrator, MIN_IRRADIANCE_ERROR, Sampling};

use super::choice::{choice, switch};

#[derive(Args)]
#[command(next_help_heading = "Rays and samples")]
pub(crate) struct IntegratorOptions {
    /// Seed of all random numbers
    #[arg(long, default_value_t = Integrator::default().seed, allow_negative_numbers = true, hide_short_help = true)]
    pub(super) seed: u32,
    /// Final gather rays per sample
    #[arg(long, default_value_t = Integrator::default().gather_rays, allow_negative_numbers = true)]
    pub(super) gather_rays: u32,
    /// Shadow rays per sample
    #[arg(long, default_value_t = Integrator::default().shadow_rays, allow_negative_numbers = true, hide_short_help = true)]
    pub(super) shadow_rays: u32,
    /// Samples per pixel
    #[arg(long, default_value_t = Integrator::default().samples, allow_negative_numbers = true)]
    pub(super) spp: u32,
    /// Sampling density of the directions of gather rays; it never changes the picture's expected value
    #[arg(long, default_value = Integrator::default().sampling.name(), value_parser = choice::<Sampling>(), hide_short_help = true)]
    pub(super) sampling: Sampling,
    /// Gather the indirect light of Lambertian surfaces at sparse points, and interpolate between them
    #[arg(long, default_value = "off", value_parser = switch(), action = ArgAction::Set)]
    pub(super) irradiance_cache: bool,
    /// Maximum relative error of interpolated irradiance [default: 0.025]
    #[arg(long, value_name = "ERROR", value_parser = ic_error, allow_negative_numbers = true, hide_short_help = true)]
    pub(super) ic_error: Option<f32>,
}

/// Default maximum relative error of interpolated irradiance.
const DEFAULT_IC_ERROR: f32 = 0.025;

impl IntegratorOptions {
    /// Settings of these options.
    pub(super) fn settings(&self) -> Integrator {
        let is_cached = self.irradiance_cache && self.gather_rays > 0;
        Integrator {
            seed: self.seed,
            samples: self.spp,
            gather_rays: self.gather_rays,
            shadow_rays: self.shadow_rays,
            sampling: self.sampling,
            irradiance_error: is_cached.then_some(self.ic_error.unwrap_or(DEFAULT_IC_ERROR)),
        }
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
