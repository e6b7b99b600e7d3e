//! Options of photons, rays and samples of sensors.

use clap::Args;
use photoncard_driver::render::{Integrator, PhotonMaps, RenderSettings};

use super::cards::CardOptions;
use super::distance::Distance;
use super::schedule::ScheduleOptions;

#[derive(Args)]
#[command(next_help_heading = "Rays and samples")]
pub(crate) struct SensorOptions {
    /// Photons stored in the photon map
    #[arg(long, default_value_t = PhotonMaps::default().count, allow_negative_numbers = true)]
    photons: usize,
    /// Number of nearest photons that a gather searches for
    #[arg(long, default_value_t = PhotonMaps::default().neighbors, allow_negative_numbers = true, hide_short_help = true)]
    neighbors: u32,
    /// Photons stored in the caustic map, for points on surfaces
    ///
    /// Without the map, gather rays carry the light that mirrors and glass focus; that of point, spot and
    /// directional lights is lost. Points in the air see nothing of the map.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true,
        hide_short_help = true
    )]
    caustic_photons: usize,
    /// Samples per point, or per texel of a bake; with multiples of 16 the error of a point is known best
    #[arg(long, default_value_t = 16, allow_negative_numbers = true)]
    spp: u32,
    /// Final gather rays per sample
    #[arg(long, default_value_t = 64, allow_negative_numbers = true)]
    gather_rays: u32,
    /// Shadow rays per sample
    #[arg(long, default_value_t = 32, allow_negative_numbers = true)]
    shadow_rays: u32,
    /// Length below which a gather ray goes on from its end, metres, or auto: derived from the density of the
    /// photons
    ///
    /// With 0, every gather ray ends in a photon gather: photons from outside light narrow gaps.
    #[arg(
        long,
        value_name = "METRES|auto",
        default_value = "auto",
        value_parser = Distance::near,
        allow_negative_numbers = true,
        hide_short_help = true
    )]
    near_distance: Distance,
    /// Seed of all random numbers
    #[arg(long, default_value_t = Integrator::default().seed, allow_negative_numbers = true, hide_short_help = true)]
    seed: u32,
}

impl SensorOptions {
    /// Settings of a measurement.
    pub(super) fn settings(&self, schedule: &ScheduleOptions, cards: &CardOptions) -> RenderSettings {
        let Self { photons, neighbors, caustic_photons, spp, gather_rays, shadow_rays, near_distance, seed } =
            *self;
        RenderSettings {
            photons: PhotonMaps {
                count: photons,
                neighbors,
                caustic_photons: Some(caustic_photons),
                ..PhotonMaps::default()
            },
            integrator: Integrator {
                seed,
                samples: spp,
                gather_rays,
                shadow_rays,
                near_distance: near_distance.stated(),
                ..Integrator::default()
            },
            schedule: schedule.settings(),
            cards: cards.settings(),
            ..RenderSettings::default()
        }
    }
}
