//! Options of the photon map and of the caustic map.

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::photon_map::PhotonLayout;
use photoncard_driver::quality::Stated;
use photoncard_driver::render::{PhotonMaps, Radiance};

use super::choice::choice;
use super::distance::Distance;

#[derive(Args)]
#[command(next_help_heading = "Photon maps")]
pub(crate) struct PhotonOptions {
    /// Photons stored in the photon map [default: by --quality, for the scene]
    #[arg(long, allow_negative_numbers = true)]
    photons: Option<usize>,
    /// Layout of the photon map in card memory; it never changes the picture
    #[arg(long, default_value = PhotonMaps::default().layout.name(), value_parser = choice::<PhotonLayout>(), hide_short_help = true)]
    photon_map: PhotonLayout,
    /// Number of nearest photons that a gather searches for [default: by --quality]
    #[arg(long, allow_negative_numbers = true, hide_short_help = true)]
    neighbors: Option<u32>,
    /// Photons stored in the caustic map, which has the light that mirrors, glass and glossy surfaces focus
    /// [default: by --quality, if the scene has such surfaces]
    ///
    /// With 0, gather rays carry this light, with more noise, and the focused light of punctual lights is
    /// lost.
    #[arg(long, value_name = "N", allow_negative_numbers = true, hide_short_help = true)]
    caustic_photons: Option<usize>,
    /// Number of nearest photons that a gather in the caustic map searches for, at least 8: fewer give
    /// sharper caustics, more give smoother ones [default: 50]
    #[arg(long, value_name = "K", allow_negative_numbers = true, hide_short_help = true)]
    caustic_neighbors: Option<u32>,
    /// Maximum distance of the photons in a gather, metres, or auto: derived from the density of the photons
    #[arg(long, default_value = "auto", value_parser = Distance::greatest, allow_negative_numbers = true, hide_short_help = true)]
    max_distance: Distance,
    /// Estimate of the radiance of a Lambertian surface at the end of a gather ray; a surface with a Phong
    /// lobe always has the estimate density
    #[arg(long, default_value = PhotonMaps::default().radiance.name(), value_parser = choice::<Radiance>(), hide_short_help = true)]
    radiance: Radiance,
}

impl PhotonOptions {
    /// Returns `others`, with flags for the photon settings that these options state.
    pub(super) fn stated(&self, others: Stated) -> Stated {
        // A gather in the caustic map needs the map.
        let caustic_photons = self.caustic_photons.is_some() || self.caustic_neighbors.is_some();
        Stated {
            photons: self.photons.is_some(),
            caustic_photons,
            neighbors: self.neighbors.is_some(),
            ..others
        }
    }

    /// Reports useless options: calls `add(is_useless, name, reason)` for each option that can be useless.
    pub(super) fn without_effect(
        &self,
        is_specular: bool,
        gather_rays: u32,
        add: &mut impl FnMut(bool, &str, &str),
    ) {
        let no_specular = "without a caustic map: nothing in the scene is a mirror, glass or glossy";
        let is_off = self.caustic_photons == Some(0);
        let no_map = if is_off { "with --caustic-photons 0" } else { no_specular };
        let is_precomputed = self.radiance == Radiance::Precomputed;
        add(is_precomputed && gather_rays == 0, "--radiance precomputed", "with --gather-rays 0");
        let is_stated = self.caustic_photons.is_some() && !is_off;
        add(is_stated && !is_specular, "--caustic-photons", no_specular);
        add(self.caustic_neighbors.is_some() && (!is_specular || is_off), "--caustic-neighbors", no_map);
    }

    /// Returns the settings that these options state. Settings that are not stated are those of `base`.
    pub(super) fn settings(&self, base: &PhotonMaps) -> PhotonMaps {
        PhotonMaps {
            count: self.photons.unwrap_or(base.count),
            photons_for: base.photons_for,
            layout: self.photon_map,
            neighbors: self.neighbors.unwrap_or(base.neighbors),
            max_distance: self.max_distance.stated(),
            caustic_photons: self.caustic_photons.or(base.caustic_photons),
            caustic_neighbors: self.caustic_neighbors.unwrap_or(base.caustic_neighbors),
            radiance: self.radiance,
        }
    }
}
