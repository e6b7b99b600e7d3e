//! Notices about options that have no effect because of other options or of the scene's contents.

use photoncard_driver::render::CardAddress;
use photoncard_driver::scene::Scene;

use super::render::RenderOptions;

impl RenderOptions {
    /// Returns a sentence for each option that has no effect on a render of `scene`.
    pub(crate) fn without_effect(&self, scene: &Scene) -> Vec<String> {
        let Self { picture, outputs, .. } = self;
        let base = self.quality.settings_for(outputs.finish()).integrator;
        let integrator = self.settings().integrator;
        let mut said = Vec::new();
        let mut add = |is_idle: bool, option: &str, why: &str| {
            said.extend(is_idle.then(|| format!("{option} has no effect {why}")));
        };
        self.scene.without_effect(scene, &mut add);
        self.photons.without_effect(scene.is_specular(), integrator.gather_rays, &mut add);
        self.integrator.without_effect(&base, &mut add);
        self.schedule.without_effect(&mut add);
        let is_emulated = |card: &CardAddress| matches!(card, CardAddress::Emulated { .. });
        let has_emulated = self.settings().cards.addresses.iter().any(is_emulated);
        add(self.cards.memory.is_stated() && !has_emulated, "--card-memory", "without an emulated card");
        outputs.without_effect(&mut add);
        let has_lumens = picture.lumens_per_watt.is_some() && !picture.layers().have_illuminance();
        add(has_lumens, "--lumens-per-watt", "without --aov illuminance");
        add(picture.aov.is_some() && !outputs.have_layers(), "--aov", "without -o OUT.exr");
        let has_groups = !self.scene.light_groups.is_empty();
        add(has_groups && !outputs.have_layers(), "--light-groups", "without -o OUT.exr");
        said
    }
}
