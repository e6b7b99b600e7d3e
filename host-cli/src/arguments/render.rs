//! Options of `photoncard render`.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::quality::Quality;
use photoncard_driver::render::RenderSettings;

use super::cards::CardOptions;
use super::choice::choice;
use super::integrator::IntegratorOptions;
use super::lights::LightOptions;
use super::outputs::OutputOptions;
use super::photons::PhotonOptions;
use super::picture::PictureOptions;
use super::schedule::ScheduleOptions;
use super::threads::threads;
use crate::environment::EnvironmentOption;

#[derive(Args)]
pub(crate) struct RenderOptions {
    /// A glTF 2.0 file, .gltf or .glb
    pub(crate) scene: PathBuf,
    /// Change a material: MATERIAL.PROPERTY=VALUE; may be repeated
    ///
    /// Properties are diffuse, specular, exponent, metallic, roughness, transmission, ior, thickness, alpha and emission.
    #[arg(long = "set", value_name = "ASSIGNMENT", help_heading = "Scene", hide_short_help = true)]
    pub(crate) assignments: Vec<String>,
    /// Add the light that rough metals and coats reflect several times between their microfacets
    ///
    /// Blender does so by default; glTF's model leaves this light out, and a metal of roughness 1 is less than half as bright.
    #[arg(long, help_heading = "Scene", hide_short_help = true)]
    pub(crate) energy_compensation: bool,
    /// Variant of the scene's materials, by its name [default: the materials that its meshes state]
    #[arg(long, value_name = "NAME", help_heading = "Scene", hide_short_help = true)]
    pub(crate) variant: Option<String>,
    #[command(flatten)]
    pub(crate) lights: LightOptions,
    /// Light from infinitely far: an equirectangular map, .hdr or .exr, or a constant radiance
    ///
    /// The middle of the map is -z and its top is y.
    #[arg(long, value_name = "FILE|R,G,B", allow_hyphen_values = true, help_heading = "Scene")]
    pub(crate) environment: Option<EnvironmentOption>,
    /// Quality of the picture, by which the options that are not stated are chosen
    #[arg(long, default_value = Quality::default().name(), value_parser = choice::<Quality>())]
    pub(crate) quality: Quality,
    #[command(flatten)]
    pub(crate) picture: PictureOptions,
    #[command(flatten)]
    pub(super) photons: PhotonOptions,
    #[command(flatten)]
    pub(super) integrator: IntegratorOptions,
    #[command(flatten)]
    pub(super) schedule: ScheduleOptions,
    #[command(flatten)]
    pub(crate) cards: CardOptions,
    #[command(flatten)]
    pub(crate) outputs: OutputOptions,
    /// Threads for the host's own work [default: one per core]
    #[arg(long, value_parser = threads, allow_negative_numbers = true, help_heading = "Order of the work", hide_short_help = true)]
    pub(crate) threads: Option<usize>,
    /// Show no progress
    #[arg(long)]
    pub(crate) quiet: bool,
}

impl RenderOptions {
    /// Settings of these options, with those of the quality for a scene that is not known.
    pub(crate) fn settings(&self) -> RenderSettings {
        self.settings_over(&self.quality.settings())
    }

    /// Settings of these options; `base` gives those that are not stated.
    pub(crate) fn settings_over(&self, base: &RenderSettings) -> RenderSettings {
        let cards = self.cards.settings();
        RenderSettings {
            picture: self.picture.settings(&base.picture),
            photons: self.photons.settings(&base.photons),
            integrator: self.integrator.settings(&base.integrator),
            schedule: self.schedule.settings(&self.picture.layers(), &cards.addresses),
            cards,
            outputs: self.outputs.settings(),
        }
    }
}
