//! Checks settings against each other, and against the capacities of cards.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_firmware::card::MAX_PICTURE_SIDE;
use photoncard_firmware::chip::least_waiting_lines;
use photoncard_firmware::kind::MIN_RECORDS;
use photoncard_map::pack::CardImage;
use photoncard_map::photon_map::PhotonLayout;
use photoncard_picture::choice::Choice;
use photoncard_picture::film::Film;
use photoncard_scene::Scene;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::{Budget, MAX_BINS, MAX_LIGHT_GROUPS};
use photoncard_shared::message::{FrameParameters, Radiance};

use super::{MIN_IRRADIANCE_ERROR, Picture, RenderSettings};
use crate::address::{CardAddress, check_chips, first_remote, is_one_emulated_chip};
use crate::emulator::EmulatedKind;
use crate::error::RenderError;

/// Minimum number of photons that a gather in the caustic map searches for.
const MIN_CAUSTIC_NEIGHBORS: u32 = 8;

const MAX_PHOTONS: usize = 1 << 27;

impl RenderSettings {
    /// Checks everything that does not depend on a card: each setting by itself, and combinations of
    /// settings.
    ///
    /// # Errors
    /// The first setting that is not possible on any card.
    pub fn check(&self) -> Result<(), RenderError> {
        let Picture { width, height, .. } = self.picture;
        let side = if width < height { "picture.height" } else { "picture.width" };
        within(side, width.max(height) as u64, 1, MAX_PICTURE_SIDE as u64)?;
        Film::check(self.picture.width, self.picture.height, self.window())?;
        within("photons.count", self.photons.count as u64, 1, MAX_PHOTONS as u64)?;
        let caustic_photons = self.photons.caustic_photons.unwrap_or(0) as u64;
        within("photons.caustic_photons", caustic_photons, 0, MAX_PHOTONS as u64)?;
        within("schedule.bins", self.schedule.bins.unwrap_or(1) as u64, 1, MAX_BINS as u64)?;
        self.check_light_groups()?;
        self.check_illuminance()?;
        self.check_irradiance_error()?;
        self.check_max_distance()?;
        self.check_near_distance()?;
        self.check_adaptive_threshold()?;
        check_chips(self.cards.addresses.iter().map(CardAddress::emulated_chips).sum())?;
        self.check_trace()?;
        self.check_memory_model()?;
        self.check_verification()
    }

    /// Checks the settings against the budget of each card.
    ///
    /// # Errors
    /// As [`Self::check_budget`].
    pub(crate) fn check_budgets(&self, budgets: &[Budget]) -> Result<(), RenderError> {
        budgets.iter().try_for_each(|budget| self.check_budget(budget))
    }

    /// Checks the settings against the budget of a card.
    ///
    /// # Errors
    /// The first setting that is not possible on this card.
    pub fn check_budget(&self, budget: &Budget) -> Result<(), RenderError> {
        on_card("photons.neighbors", self.photons.neighbors, 2, budget.neighbors)?;
        if self.photons.caustic_photons != Some(0) {
            let neighbors = self.photons.caustic_neighbors;
            on_card("photons.caustic_neighbors", neighbors, MIN_CAUSTIC_NEIGHBORS, budget.neighbors)?;
        }
        on_card("integrator.gather_rays", self.integrator.gather_rays, 0, budget.gather_rays)?;
        on_card("integrator.shadow_rays", self.integrator.shadow_rays, 0, budget.shadow_rays)?;
        on_card("integrator.samples", self.integrator.samples, 1, budget.samples)?;
        on_card("integrator.planned_samples", self.integrator.planned(), 1, budget.samples)?;
        if self.schedule.queue.is_some() || self.schedule.order.has_queue() {
            on_card("schedule.queue", self.schedule.queue.unwrap_or(1), 1, budget.gather_queue)?;
        }
        if self.schedule.order == GatherOrder::Buckets && budget.waiting_blocks == 0 {
            return Err(RenderError::Setting {
                field: "schedule.order",
                value: self.schedule.order.name().into(),
                reason: "a card's chip has no room for tables of gathers that wait in card memory".into(),
                remedy: "use sort, or a chip with waiting_blocks".into(),
            });
        }
        if let Some(in_flight) = self.schedule.in_flight {
            on_card("schedule.in_flight", in_flight, 1, budget.in_flight)?;
        }
        self.check_records_of_light_groups(budget)?;
        on_card("schedule.tile", self.schedule.tile.unwrap_or(1), 1, budget.pixels_of_tile(1).isqrt())?;
        self.check_tile_with_layers(budget)
    }

    /// Checks that a card's memory has room for gathers that wait there, after the card image, if the order
    /// asks for it.
    ///
    /// # Errors
    /// If a round of one block has no room.
    pub fn check_waiting_room(
        &self,
        frame: &FrameParameters,
        image: &CardImage,
        budget: &Budget,
    ) -> Result<(), RenderError> {
        let needed = least_waiting_lines(frame, budget).saturating_mul(LINE_BYTES as u64);
        let free = budget.dram_bytes.saturating_sub(image.bytes());
        if needed <= free {
            return Ok(());
        }
        Err(RenderError::Setting {
            field: "schedule.order",
            value: self.schedule.order.name().into(),
            reason: format!(
                "gathers wait in {needed} bytes or more of a card's memory, and the card image leaves {free}"
            ),
            remedy: "use sort, lower `photons.count`, or use a card with more memory (an emulated one by \
                     `CardAddress::with_memory`)"
                .into(),
        })
    }

    /// Checks the light groups, and that photons carry them.
    fn check_light_groups(&self) -> Result<(), RenderError> {
        let groups = &self.picture.light_groups;
        let fault = |reason: String, remedy: &str| {
            let (value, remedy) = (groups.join(","), remedy.into());
            Err(RenderError::Setting { field: "picture.light_groups", value, reason, remedy })
        };
        if groups.len() > MAX_LIGHT_GROUPS {
            return fault(format!("there can be {MAX_LIGHT_GROUPS} light groups"), "put sources together");
        }
        if !groups.is_empty() && self.photons.layout != PhotonLayout::Lines {
            return fault("photons of a kd-tree carry no light group".into(), "use `photons.layout` lines");
        }
        if !groups.is_empty() && self.photons.radiance == Radiance::Precomputed {
            return fault(
                "precomputed irradiance is that of all light groups".into(),
                "use `photons.radiance` density",
            );
        }
        Ok(())
    }

    /// Checks that the layer of illuminance, which is a frame of its own, is not asked of a part, and that
    /// its efficacy is a positive number.
    fn check_illuminance(&self) -> Result<(), RenderError> {
        let Picture { layers, lumens_per_watt, .. } = &self.picture;
        if let Some(lumens) = lumens_per_watt.filter(|lumens| !(lumens.is_finite() && *lumens > 0.0)) {
            return Err(RenderError::Setting {
                field: "picture.lumens_per_watt",
                value: lumens.to_string(),
                reason: "an efficacy is a positive number of lumens per watt".into(),
                remedy: "give 683, 179 for radiances of Radiance, or 1 for light in candela and lux".into(),
            });
        }
        if !layers.have_illuminance() || self.schedule.part.is_none() {
            return Ok(());
        }
        Err(RenderError::Setting {
            field: "picture.layers",
            value: layers.to_string(),
            reason: "illuminance is a frame of its own, which a part of a picture does not have".into(),
            remedy:
                "leave illuminance out, and render the parts of a second picture with `picture.irradiance`"
                    .into(),
        })
    }

    /// Checks that a chip has room for the irradiance records of a pixel, one for each light group.
    fn check_records_of_light_groups(&self, budget: &Budget) -> Result<(), RenderError> {
        let groups = &self.picture.light_groups;
        let most = budget.irradiance_records as usize / MIN_RECORDS;
        if self.integrator.irradiance_error.is_none() || groups.len() <= most {
            return Ok(());
        }
        Err(RenderError::Setting {
            field: "picture.light_groups",
            value: groups.join(","),
            reason: format!("this card has room for the irradiance records of {most} light groups"),
            remedy: "use fewer groups, render without `integrator.irradiance_error`, or use another card"
                .into(),
        })
    }

    /// Checks that the light groups are those of the scene.
    ///
    /// # Errors
    /// If [`Scene::set_light_groups`] has set others.
    pub(crate) fn check_groups_of(&self, scene: &Scene) -> Result<(), RenderError> {
        let names = scene.light_groups.names();
        if self.picture.light_groups == names {
            return Ok(());
        }
        Err(RenderError::Setting {
            field: "picture.light_groups",
            value: self.picture.light_groups.join(","),
            reason: format!("the scene has the light groups [{}]", names.join(", ")),
            remedy: "state the names of the scene's light groups, or none of both".into(),
        })
    }

    /// Checks that the error bound of interpolated irradiance is valid, if there is one.
    fn check_irradiance_error(&self) -> Result<(), RenderError> {
        match self.integrator.irradiance_error {
            Some(error) if !(MIN_IRRADIANCE_ERROR..=1.0).contains(&error) => Err(RenderError::Setting {
                field: "integrator.irradiance_error",
                value: error.to_string(),
                reason: format!("an error is a share of the irradiance, {MIN_IRRADIANCE_ERROR} to 1"),
                remedy: "give a number such as 0.025".into(),
            }),
            _ => Ok(()),
        }
    }

    /// Checks that the maximum distance of a gather is valid, if it is stated.
    fn check_max_distance(&self) -> Result<(), RenderError> {
        match self.photons.max_distance {
            Some(distance) if !(distance.is_finite() && distance > 0.0) => Err(RenderError::Setting {
                field: "photons.max_distance",
                value: distance.to_string(),
                reason: "a distance is a positive number of metres".into(),
                remedy: "give a positive number, or `auto`".into(),
            }),
            _ => Ok(()),
        }
    }

    /// Checks that the length below which gather rays go on is valid, if it is stated.
    fn check_near_distance(&self) -> Result<(), RenderError> {
        match self.integrator.near_distance {
            Some(distance) if !(distance.is_finite() && distance >= 0.0) => Err(RenderError::Setting {
                field: "integrator.near_distance",
                value: distance.to_string(),
                reason: "a distance is a number of metres, 0 or more".into(),
                remedy: "give 0, a positive number, or `auto`".into(),
            }),
            _ => Ok(()),
        }
    }

    /// Checks that the threshold of adaptive sampling is valid, if there is one.
    fn check_adaptive_threshold(&self) -> Result<(), RenderError> {
        match self.integrator.adaptive_threshold {
            Some(threshold) if !(threshold.is_finite() && threshold > 0.0) => Err(RenderError::Setting {
                field: "integrator.adaptive_threshold",
                value: threshold.to_string(),
                reason: "a threshold is a positive number".into(),
                remedy: "give a number such as 0.1, or `off`".into(),
            }),
            _ => Ok(()),
        }
    }

    /// Checks that the tile fits into the chip with the sums of all layers that chips render.
    fn check_tile_with_layers(&self, budget: &Budget) -> Result<(), RenderError> {
        let most = budget.pixels_of_tile(self.picture.form().sums_of_light()).isqrt();
        let side = self.schedule.tile.unwrap_or(1);
        if side <= most {
            return Ok(());
        }
        let groups = &self.picture.light_groups;
        if !groups.is_empty() && !self.picture.layers.separate_light() {
            return Err(RenderError::Setting {
                field: if most == 0 { "picture.light_groups" } else { "schedule.tile" },
                value: if most == 0 { groups.join(",") } else { side.to_string() },
                reason: format!(
                    "with {} light groups a tile may have {most} pixels a side on this card",
                    groups.len()
                ),
                remedy: "choose a smaller `schedule.tile`, or fewer `picture.light_groups`".into(),
            });
        }
        let leave_out = "leave direct, indirect, caustic and gathers out of `picture.layers`: with them a chip keeps four sums \
                         a pixel";
        if most == 0 {
            return Err(RenderError::Setting {
                field: "picture.layers",
                value: self.picture.layers.to_string(),
                reason: "this card has no room for a tile with these layers".into(),
                remedy: format!("render on another card, or {leave_out}"),
            });
        }
        Err(RenderError::Setting {
            field: "schedule.tile",
            value: side.to_string(),
            reason: format!(
                "with `picture.layers` {} it must be 1 to {most} on this card",
                self.picture.layers
            ),
            remedy: format!("choose {most} or less, or {leave_out}"),
        })
    }

    /// Checks that the reads of the cards can be traced, if a trace is requested.
    ///
    /// # Errors
    /// If the reads have no unique order.
    fn check_trace(&self) -> Result<(), RenderError> {
        let Some(trace) = &self.cards.trace else { return Ok(()) };
        let refuse = |reason: &str, remedy: &str| {
            let value = trace.path.display().to_string();
            Err(RenderError::Setting {
                field: "cards.trace",
                value,
                reason: reason.into(),
                remedy: remedy.into(),
            })
        };
        if trace.has_labels && trace.format.is_below_caches() {
            return refuse(
                "a trace of the DRAM has no labels",
                "leave `cards.trace.has_labels` out, or use `cards.trace.format` dinero",
            );
        }
        if !is_one_emulated_chip(&self.cards.addresses) {
            let one_chip: Vec<_> =
                EmulatedKind::ALL.iter().map(|kind| format!("`cards.addresses` {}:1", kind.name())).collect();
            return refuse(
                "several chips read in no one order, and a chip that is not emulated tells nothing of its reads",
                &format!("use {}", one_chip.join(" or ")),
            );
        }
        Ok(())
    }

    /// Checks that the memory of every card can be modelled, if a model is requested.
    ///
    /// # Errors
    /// If a card is not emulated in this process.
    fn check_memory_model(&self) -> Result<(), RenderError> {
        match first_remote(&self.cards.addresses).filter(|_| self.modelled_caches().is_some()) {
            None => Ok(()),
            Some(address) => Err(RenderError::Setting {
                field: "cards.caches",
                value: format!("with `cards.addresses` {address}"),
                reason: "only the memory of cards that are emulated in this process is modelled".into(),
                remedy: "use `cards.addresses` emulated:CHIPS, or leave `cards.caches` out".into(),
            }),
        }
    }
}

/// Checks that a value is in a range that all cards share.
fn within(field: &'static str, value: u64, least: u64, most: u64) -> Result<(), RenderError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let reason = format!("it must be {least} to {most}");
    let remedy =
        if value < least { format!("choose {least} or more") } else { format!("choose {most} or less") };
    Err(RenderError::Setting { field, value: value.to_string(), reason, remedy })
}

/// Checks that a value is in the range of one card.
fn on_card(field: &'static str, value: u32, least: u32, most: u32) -> Result<(), RenderError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let info = "`photoncard card info` tells what a card can hold";
    let (reason, remedy) = if most < least {
        let reason = format!("it must be {least} or more, and this card has room for {most}");
        (reason, format!("no value will do on this card: render on another; {info}"))
    } else {
        let remedy = if value < least {
            format!("choose {least} or more")
        } else {
            format!("choose {most} or less; {info}")
        };
        let range = if least == most { least.to_string() } else { format!("{least} to {most}") };
        (format!("it must be {range} on this card"), remedy)
    };
    Err(RenderError::Setting { field, value: value.to_string(), reason, remedy })
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::kind::REFERENCE;

    use super::super::{PhotonMaps, Schedule};
    use super::*;

    fn refusal(settings: &RenderSettings, budget: &Budget) -> (String, String) {
        match settings.check_budget(budget) {
            Err(RenderError::Setting { field, reason, remedy, .. }) => (format!("{field}: {reason}"), remedy),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn another_card_is_suggested_where_no_value_fits() {
        let settings = RenderSettings::default();
        settings.check_budget(&REFERENCE).unwrap();
        for (field, budget) in [
            ("photons.neighbors", Budget { neighbors: 0, ..REFERENCE }),
            ("photons.neighbors", Budget { neighbors: 1, ..REFERENCE }),
            ("integrator.samples", Budget { samples: 0, ..REFERENCE }),
            ("schedule.queue", Budget { gather_queue: 0, ..REFERENCE }),
            ("schedule.tile", Budget { tile_pixels: 0, ..REFERENCE }),
        ] {
            let (reason, remedy) = refusal(&settings, &budget);
            assert!(reason.starts_with(field) && reason.contains("this card has room for"), "{reason}");
            assert!(remedy.contains("render on another") && !remedy.contains("choose"), "{field}: {remedy}");
        }
        let layers = RenderSettings {
            picture: Picture { layers: "all".parse().unwrap(), ..Picture::default() },
            schedule: Schedule { tile: Some(1), ..Schedule::default() },
            ..RenderSettings::default()
        };
        let (reason, remedy) = refusal(&layers, &Budget { tile_pixels: 1, ..REFERENCE });
        assert!(
            reason.starts_with("picture.layers") && remedy.contains("render on another card, or leave"),
            "{reason} {remedy}"
        );
    }

    #[test]
    fn gathers_wait_in_card_memory_only_on_chips_with_tables_for_them() {
        let settings = RenderSettings::default().with(|s| s.schedule.order = GatherOrder::Buckets);
        settings.check_budget(&REFERENCE).unwrap();
        let (reason, remedy) = refusal(&settings, &Budget { waiting_blocks: 0, ..REFERENCE });
        assert!(reason.starts_with("schedule.order") && remedy.contains("sort"), "{reason} {remedy}");
    }

    #[test]
    fn unused_techniques_need_no_capacity() {
        let few = Budget { neighbors: 7, gather_queue: 0, ..REFERENCE };
        let settings = RenderSettings {
            photons: PhotonMaps { neighbors: 7, ..PhotonMaps::default() },
            schedule: Schedule { order: GatherOrder::DirectionBins, ..Schedule::default() },
            ..RenderSettings::default()
        };
        assert!(refusal(&settings, &few).0.starts_with("photons.caustic_neighbors"));
        settings.with(|s| s.photons.caustic_photons = Some(0)).check_budget(&few).unwrap();
    }
}
