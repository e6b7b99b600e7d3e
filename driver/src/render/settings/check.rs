//! Check of the settings against a card's budget.

use photoncard_firmware::card::MAX_PICTURE_SIDE;
use photoncard_shared::budget::{Budget, MAX_BINS};

use super::{MIN_IRRADIANCE_ERROR, RenderSettings};
use crate::render::RenderError;

/// Minimum number of photons that a gather of caustics searches for.
const MIN_CAUSTIC_NEIGHBORS: u64 = 8;

/// Maximum number of photons.
const MAX_PHOTONS: usize = 1 << 27;

impl RenderSettings {
    /// Checks the settings against a card's budget.
    ///
    /// # Errors
    /// If a setting is not possible: the first one.
    pub fn check(&self, budget: &Budget) -> Result<(), RenderError> {
        within("--size", self.picture.width.max(self.picture.height) as u64, 1, MAX_PICTURE_SIDE as u64)?;
        within("--photons", self.photons.count as u64, 1, MAX_PHOTONS as u64)?;
        within("--neighbors", self.photons.neighbors as u64, 2, budget.neighbors as u64)?;
        within("--caustic-photons", self.photons.caustic_photons.unwrap_or(0) as u64, 0, MAX_PHOTONS as u64)?;
        if self.photons.caustic_photons != Some(0) {
            let neighbors = self.photons.caustic_neighbors as u64;
            within("--caustic-neighbors", neighbors, MIN_CAUSTIC_NEIGHBORS, budget.neighbors as u64)?;
        }
        within("--gather-rays", self.integrator.gather_rays as u64, 0, budget.gather_rays as u64)?;
        within("--shadow-rays", self.integrator.shadow_rays as u64, 0, budget.shadow_rays as u64)?;
        within("--spp", self.integrator.samples as u64, 1, budget.samples as u64)?;
        within("--bins", self.schedule.bins.unwrap_or(1) as u64, 1, MAX_BINS as u64)?;
        if self.schedule.queue.is_some() || self.schedule.order.has_queue() {
            within("--queue", self.schedule.queue.unwrap_or(1) as u64, 1, budget.gather_queue as u64)?;
        }
        within("--tile", self.schedule.tile as u64, 1, budget.pixels_of_tile(false).isqrt() as u64)?;
        self.check_tile_with_layers(budget)?;
        if let Some(error) = self.integrator.irradiance_error
            && !(MIN_IRRADIANCE_ERROR..=1.0).contains(&error)
        {
            return Err(RenderError::Setting {
                option: "--ic-error",
                value: error.to_string(),
                reason: format!("an error is a share of the irradiance, {MIN_IRRADIANCE_ERROR} to 1"),
                remedy: "give a number such as 0.025".into(),
            });
        }
        match self.photons.max_distance {
            Some(distance) if !(distance.is_finite() && distance > 0.0) => Err(RenderError::Setting {
                option: "--max-distance",
                value: distance.to_string(),
                reason: "a distance is a positive number of metres".into(),
                remedy: "give a positive number, or `auto`".into(),
            }),
            _ => Ok(()),
        }
    }

    /// Checks that a chip has room for a tile with layers, if the picture has layers of chips.
    fn check_tile_with_layers(&self, budget: &Budget) -> Result<(), RenderError> {
        let most = budget.pixels_of_tile(self.picture.layers.are_of_chip()).isqrt();
        if self.schedule.tile <= most {
            return Ok(());
        }
        let leave_out = "leave direct, indirect, caustic and gathers out of --aov: with them a chip keeps four sums a pixel";
        if most == 0 {
            return Err(RenderError::Setting {
                option: "--aov",
                value: self.picture.layers.to_string(),
                reason: "this card has no room for a tile with these layers".into(),
                remedy: format!("render on another card, or {leave_out}"),
            });
        }
        Err(RenderError::Setting {
            option: "--tile",
            value: self.schedule.tile.to_string(),
            reason: format!("with --aov {} it must be 1 to {most} on this card", self.picture.layers),
            remedy: format!("choose {most} or less, or {leave_out}"),
        })
    }
}

/// Checks that a value lies between a card's limits.
fn within(option: &'static str, value: u64, least: u64, most: u64) -> Result<(), RenderError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let (reason, remedy) = if most < least {
        let reason = format!("it must be {least} or more, and this card has room for {most}");
        (reason, "no value will do on this card: render on another; `photoncard card info` prints the limits of a card".into())
    } else {
        let remedy = if value < least {
            format!("choose {least} or more")
        } else {
            format!("choose {most} or less; `photoncard card info` prints the limits of a card")
        };
        (format!("it must be {least} to {most} on this card"), remedy)
    };
    Err(RenderError::Setting { option, value: value.to_string(), reason, remedy })
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::kind::REFERENCE;

    use super::super::{PhotonMaps, Picture, Schedule};
    use super::*;
    use crate::scheduler::GatherOrder;

    fn refusal(settings: &RenderSettings, budget: &Budget) -> (String, String) {
        match settings.check(budget) {
            Err(RenderError::Setting { option, reason, remedy, .. }) => {
                (format!("{option}: {reason}"), remedy)
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_card_without_room_for_any_value_is_to_be_another() {
        let settings = RenderSettings::default();
        settings.check(&REFERENCE).unwrap();
        for (option, budget) in [
            ("--neighbors", Budget { neighbors: 0, ..REFERENCE }),
            ("--neighbors", Budget { neighbors: 1, ..REFERENCE }),
            ("--spp", Budget { samples: 0, ..REFERENCE }),
            ("--queue", Budget { gather_queue: 0, ..REFERENCE }),
            ("--tile", Budget { tile_pixels: 0, ..REFERENCE }),
        ] {
            let (reason, remedy) = refusal(&settings, &budget);
            assert!(reason.starts_with(option) && reason.contains("this card has room for"), "{reason}");
            assert!(remedy.contains("render on another") && !remedy.contains("choose"), "{option}: {remedy}");
        }
        let layers = RenderSettings {
            picture: Picture { layers: "all".parse().unwrap(), ..Picture::default() },
            schedule: Schedule { tile: 1, ..Schedule::default() },
            ..RenderSettings::default()
        };
        let (reason, remedy) = refusal(&layers, &Budget { tile_pixels: 1, ..REFERENCE });
        assert!(
            reason.starts_with("--aov") && remedy.contains("render on another card, or leave"),
            "{reason} {remedy}"
        );
    }

    #[test]
    fn what_is_not_used_needs_no_room() {
        let few = Budget { neighbors: 7, gather_queue: 0, ..REFERENCE };
        let settings = RenderSettings {
            photons: PhotonMaps { neighbors: 7, ..PhotonMaps::default() },
            schedule: Schedule { order: GatherOrder::DirectionBins, ..Schedule::default() },
            ..RenderSettings::default()
        };
        assert!(refusal(&settings, &few).0.starts_with("--caustic-neighbors"));
        settings.with(|s| s.photons.caustic_photons = Some(0)).check(&few).unwrap();
    }
}
