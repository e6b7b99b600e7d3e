//! Settings as values by option names: those that pixels depend on, those that only the work depends on, and
//! those of the cards.

use photoncard_scene::Scene;
use photoncard_shared::image::LAYOUT_VERSION;
use serde_json::{Map, Value, json};

use super::RenderSettings;
use super::setting::{Changes, Setting};

/// Values of settings by names of command-line options.
pub type NamedSettings = Map<String, Value>;

impl RenderSettings {
    /// All settings that command-line options can state, in the order of the groups.
    pub fn options(&self) -> Vec<Setting> {
        let Self { picture, photons, integrator, schedule, cards, outputs } = self;
        [
            picture.options(),
            photons.options(),
            integrator.options(),
            schedule.options(),
            cards.options(),
            outputs.options(),
        ]
        .concat()
    }

    /// Settings that pixels depend on.
    pub fn of_pixels(&self) -> NamedSettings {
        self.that_change(Changes::Pixels)
    }

    /// Settings that the work and memory traffic of a chip depend on, but no pixel. They exclude the kind of
    /// chip, its caches and [`Schedule::keep_records`](super::Schedule::keep_records).
    pub fn of_work(&self) -> NamedSettings {
        self.that_change(Changes::Work)
    }

    /// Settings of cards, their links, and the model of their memory. No pixel depends on them.
    pub fn of_cards(&self) -> NamedSettings {
        self.that_change(Changes::Cards)
    }

    fn that_change(&self, changes: Changes) -> NamedSettings {
        let changing = self.options().into_iter().filter(|setting| setting.changes == changes);
        changing.filter_map(|Setting { option, value, .. }| Some((option.to_owned(), value?))).collect()
    }

    /// Everything that the pixels of a scene depend on: program, scene and settings.
    pub fn identity(&self, scene: &Scene) -> NamedSettings {
        let mut identity = self.resolved(scene).of_pixels();
        identity.extend(named([
            ("program", json!(PROGRAM)),
            ("layout", json!(LAYOUT_VERSION)),
            ("scene-checksum", json!(scene.checksum())),
        ]));
        if self.picture.layers.have_mattes() {
            identity.insert("objects-checksum".to_owned(), json!(scene.checksum_of_objects()));
        }
        identity
    }
}

/// Name and version of this program.
pub const PROGRAM: &str = concat!("photoncard ", env!("CARGO_PKG_VERSION"));

fn named<const N: usize>(settings: [(&str, Value); N]) -> NamedSettings {
    settings.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}
