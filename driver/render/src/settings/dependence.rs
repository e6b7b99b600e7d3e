//! Lists of settings by option names: those that pixels depend on, those that only the work depends on, and
//! those of the cards.
//!
//! The lists destructure the groups field by field, so that no new field can be forgotten.

use photoncard_picture::choice::Choice;
use photoncard_scene::Scene;
use photoncard_shared::image::LAYOUT_VERSION;
use serde_json::{Map, Value, json};

use super::RenderSettings;
use super::groups::{CardSet, Integrator, PhotonMaps, Picture, Schedule, TileOutputs};

/// Values by option names.
pub type NamedSettings = Map<String, Value>;

impl RenderSettings {
    /// Settings that pixels depend on.
    pub fn of_pixels(&self) -> NamedSettings {
        let Self { picture, photons, integrator, schedule, cards, outputs } = self;
        let Schedule {
            tile: _,
            order: _,
            bins: _,
            queue: _,
            in_flight: _,
            focus: _,
            part: _,
            keep_records: _,
        } = schedule;
        let CardSet { addresses: _, faults: _, verify: _, caches: _, trace: _ } = cards;
        let TileOutputs { partial: _, display: _ } = outputs;
        let Picture { width, height, crop: _, camera, camera_at, look_at, fov, layers, filter } = picture;
        let PhotonMaps {
            count,
            photons_for,
            layout: _,
            neighbors,
            max_distance,
            caustic_photons,
            caustic_neighbors,
            radiance,
        } = photons;
        let Integrator {
            seed,
            samples,
            planned_samples: _,
            gather_rays,
            shadow_rays,
            sampling,
            irradiance_error,
            adaptive_threshold,
        } = integrator;
        let window = self.window();
        let mut settings = named([
            ("size", json!([width, height])),
            ("crop", json!([window.x0, window.x1, window.y0, window.y1])),
            ("camera", json!(camera)),
            ("camera-at", json!(camera_at)),
            ("look-at", json!(look_at)),
            ("fov", json!(fov)),
            ("filter", json!(filter.name())),
            ("aov", json!(layers.of_chip().to_string())),
            ("photons", json!(count)),
            ("photons-for", json!(photons_for.resolved().name())),
            ("neighbors", json!(neighbors)),
            ("max-distance", json!(max_distance)),
            ("caustic-photons", json!(caustic_photons)),
            ("caustic-neighbors", json!(caustic_neighbors)),
            ("radiance", json!(radiance.name())),
            ("seed", json!(seed)),
            ("spp", json!(samples)),
            ("gather-rays", json!(gather_rays)),
            ("shadow-rays", json!(shadow_rays)),
            ("sampling", json!(sampling.name())),
            ("ic-error", json!(irradiance_error)),
            ("adaptive", json!(adaptive_threshold)),
        ]);
        // Rays are divided among the planned samples with the irradiance cache alone.
        if irradiance_error.is_some() && integrator.planned() != *samples {
            settings.insert("planned-spp".to_owned(), json!(integrator.planned()));
        }
        settings
    }

    /// Settings that a chip's work and memory traffic depend on, but no pixel, without the kind of chip and
    /// its caches. They describe a picture that is not part of a series.
    pub fn of_work(&self) -> NamedSettings {
        let Self { picture: _, photons, integrator: _, schedule, cards: _, outputs: _ } = self;
        let PhotonMaps {
            count: _,
            photons_for: _,
            layout,
            neighbors: _,
            max_distance: _,
            caustic_photons: _,
            caustic_neighbors: _,
            radiance: _,
        } = photons;
        let Schedule { tile, order, bins, queue, in_flight, focus: _, part: _, keep_records: _ } = schedule;
        named([
            ("photon-map", json!(layout.name())),
            ("tile", json!(tile)),
            ("order", json!(order.name())),
            ("bins", json!(bins)),
            ("queue", json!(queue)),
            ("in-flight", json!(in_flight)),
        ])
    }

    /// Settings of cards, their links, and the model of their memory. No pixel depends on them.
    pub fn of_cards(&self) -> NamedSettings {
        let CardSet { addresses, faults, verify, caches: _, trace: _ } = &self.cards;
        let addresses: Vec<_> = addresses.iter().map(ToString::to_string).collect();
        named([
            ("card", json!(addresses)),
            ("faults", json!(faults.map(|faults| faults.to_string()))),
            ("verify", json!(verify)),
            ("cache", json!(self.modelled_caches().map(|caches| caches.to_string()))),
        ])
    }

    /// Everything that the pixels of a scene depend on: program, scene and settings.
    pub fn identity(&self, scene: &Scene) -> NamedSettings {
        let mut identity = self.resolved(scene).of_pixels();
        identity.extend(named([
            ("program", json!(PROGRAM)),
            ("layout", json!(LAYOUT_VERSION)),
            ("scene-checksum", json!(scene.checksum())),
        ]));
        identity
    }
}

/// Name and version of this program.
pub const PROGRAM: &str = concat!("photoncard ", env!("CARGO_PKG_VERSION"));

fn named<const N: usize>(settings: [(&str, Value); N]) -> NamedSettings {
    settings.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}
