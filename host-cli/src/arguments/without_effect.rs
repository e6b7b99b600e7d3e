//! Notices about options that have no effect because an option that they need is missing.

use photoncard_driver::choice::Choice;
use photoncard_driver::scene::Scene;

use super::outputs::WITHOUT_EXR;
use super::render::RenderOptions;

impl RenderOptions {
    /// Sentences about the options without effect on a render of `scene`.
    pub(crate) fn without_effect(&self, scene: &Scene) -> Vec<String> {
        let Self { schedule, cards, samples, picture, outputs, .. } = self;
        let order = schedule.order;
        let with_order = |why: &str| format!("with --order {}, {why}", order.name());
        let gather_rays = self.settings().integrator.gather_rays;
        let faults = (
            cards.faults.is_some() && order.is_of_whole_frame(),
            "--faults",
            with_order("which sends nothing over links"),
        );
        let keep_samples = (
            samples.keep_samples && order.is_of_whole_frame(),
            "--keep-samples",
            with_order("whose tiles are finished together"),
        );
        let aov = (picture.aov.is_some() && !outputs.have_layers(), "--aov", WITHOUT_EXR.to_owned());
        let cases = (self.scene.without_effect(scene).into_iter())
            .chain(self.photons.without_effect(scene.is_specular(), gather_rays))
            .chain([faults])
            .chain(self.integrator.without_effect(&self.quality.settings().integrator))
            .chain([keep_samples])
            .chain(schedule.without_effect())
            .chain(outputs.without_effect())
            .chain([aov]);
        let said = cases.filter(|(is_idle, ..)| *is_idle);
        said.map(|(_, option, why)| format!("{option} has no effect {why}")).collect()
    }
}
