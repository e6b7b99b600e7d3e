//! Notices about options that have no effect because an option that they need is missing.

use photoncard_driver::choice::Choice;
use photoncard_driver::render::{CardAddress, Radiance};
use photoncard_driver::scene::{LightUnits, Material, Reflection, Scene};

use super::files::PictureFormat;
use super::render::RenderOptions;

impl RenderOptions {
    /// Sentences about the options without effect on a render of `scene`.
    pub(crate) fn without_effect(&self, scene: &Scene) -> Vec<String> {
        let order = self.schedule.order;
        let name = order.name();
        let settings = self.settings();
        let without_specular =
            "without a caustic map: nothing in the scene is a mirror, glass or glossy".to_owned();
        let without_map = if self.photons.caustic_photons == Some(0) {
            "with --caustic-photons 0".to_owned()
        } else {
            without_specular.clone()
        };
        let has_map = scene.is_specular() && self.photons.caustic_photons != Some(0);
        let has_lobe =
            |material: &Material| matches!(material.reflection, Reflection::MetallicRoughness { .. });
        let is_emulated = |card: &CardAddress| matches!(card, CardAddress::Emulated { .. });
        let cases = [
            (
                self.scene.lights.light_units != LightUnits::Auto && scene.lights.is_empty(),
                "--light-units",
                "without point, spot or directional lights in the file".to_owned(),
            ),
            (
                self.scene.energy_compensation && !scene.materials.iter().any(has_lobe),
                "--energy-compensation",
                "without a metallic-roughness material".to_owned(),
            ),
            (
                self.photons.radiance == Radiance::Precomputed && settings.integrator.gather_rays == 0,
                "--radiance precomputed",
                "with --gather-rays 0".to_owned(),
            ),
            (
                self.photons.caustic_photons.is_some_and(|photons| photons > 0) && !has_map,
                "--caustic-photons",
                without_specular,
            ),
            (self.photons.caustic_neighbors.is_some() && !has_map, "--caustic-neighbors", without_map),
            (
                self.cards.faults.is_some() && order.is_of_whole_frame(),
                "--faults",
                format!("with --order {name}, which sends nothing over links"),
            ),
            (
                self.cards.chip.is_stated() && !settings.cards.addresses.iter().any(is_emulated),
                "--chip",
                "without an emulated card".to_owned(),
            ),
        ];
        let of_rays = self.integrator.without_effect(&self.quality.settings().integrator);
        let said = cases
            .into_iter()
            .chain(of_rays)
            .chain(self.of_order())
            .chain(self.of_pictures())
            .filter(|(is_idle, ..)| *is_idle);
        said.map(|(_, option, why)| format!("{option} has no effect {why}")).collect()
    }

    /// Options that only other gather orders have. Each entry is whether it has no effect, its name, and the
    /// reason.
    fn of_order(&self) -> [(bool, &'static str, String); 4] {
        let order = self.schedule.order;
        let no_bins = format!("with --order {}, which has no direction bins", order.name());
        let no_queue = format!("with --order {}, by which no gathers wait on a chip", order.name());
        let at_once = format!("with --order {}, whose tiles are finished together", order.name());
        [
            (self.samples.keep_samples && order.is_of_whole_frame(), "--keep-samples", at_once),
            (self.schedule.bins.is_some() && !order.has_bins(), "--bins", no_bins),
            (self.schedule.queue.is_some() && !order.has_queue(), "--queue", no_queue.clone()),
            (self.schedule.in_flight.is_some() && !order.has_queue(), "--in-flight", no_queue),
        ]
    }

    /// Options of picture formats that are not written. Each entry is whether it has no effect, its name, and
    /// the reason.
    fn of_pictures(&self) -> [(bool, &'static str, String); 4] {
        let outputs = &self.outputs;
        let [no_exr, no_png] = [PictureFormat::Exr, PictureFormat::Png].map(|format| !outputs.has(format));
        let [of_exr, of_png] = ["without -o OUT.exr", "without -o OUT.png"].map(str::to_owned);
        let has_layers = outputs.display_server.is_some() || outputs.has(PictureFormat::Part);
        [
            (outputs.tone.exposure.is_some() && no_png, "--exposure", of_png.clone()),
            (outputs.tone.curve.is_some() && no_png, "--tonemap", of_png),
            (outputs.sample_type.is_some() && no_exr, "--sample-type", of_exr.clone()),
            (self.picture.aov.is_some() && no_exr && !has_layers, "--aov", of_exr),
        ]
    }
}
