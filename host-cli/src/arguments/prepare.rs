//! Options of `photoncard prepare`.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::quality::{Finish, Quality, Stated};
use photoncard_driver::render::{Budget, CardAddress, CardSet, RenderSettings};

use super::cards::{ChipOption, MemoryOption};
use super::choice::choice;
use super::files::file;
use super::frames::FrameOptions;
use super::host::HostOptions;
use super::integrator::IntegratorOptions;
use super::photons::PhotonOptions;
use super::picture::PictureOptions;
use super::scene::SceneOptions;

#[derive(Args)]
pub(crate) struct PrepareOptions {
    #[command(flatten)]
    pub(crate) scene: SceneOptions,
    /// The file to write, for photoncard render --prepared
    ///
    /// Frames in which nothing but cameras moves share a file. If meshes or lights move, each frame that
    /// differs from the frame before has a file of its own: the name must then have a run of #, which the
    /// frame's number replaces.
    #[arg(short, long, value_name = "OUT.card", value_parser = file())]
    pub(crate) output: PathBuf,
    /// Quality of the pictures, by which the options that are not stated are chosen
    #[arg(long, default_value = Quality::default().name(), value_parser = choice::<Quality>())]
    pub(crate) quality: Quality,
    /// Prepare for pictures that are denoised, by photoncard render --denoise or photoncard merge --denoise
    ///
    /// With this option --quality chooses fewer samples and rays, and no irradiance cache.
    #[arg(long)]
    denoise: bool,
    #[command(flatten)]
    pub(crate) frames: FrameOptions,
    #[command(flatten)]
    pub(crate) picture: PictureOptions,
    #[command(flatten)]
    photons: PhotonOptions,
    #[command(flatten)]
    integrator: IntegratorOptions,
    // The card image must fit the memory of the cards that will render.
    #[command(flatten)]
    card: ChipOption,
    #[command(flatten)]
    memory: MemoryOption,
    #[command(flatten)]
    pub(crate) host: HostOptions,
}

impl PrepareOptions {
    /// Returns an emulated card with the kind and the memory of the cards that will render.
    fn cards(&self) -> CardAddress {
        self.memory.of(CardAddress::emulated(self.card.model.clone()))
    }

    /// Returns the capacities of the cards that will render.
    pub(crate) fn budget(&self) -> Budget {
        let budget = self.card.model.kind().budget();
        Budget { dram_bytes: self.cards().dram_bytes(), ..budget }
    }

    /// Returns which settings the options state, among those that `--quality` would choose.
    pub(crate) fn stated(&self) -> Stated {
        self.photons.stated(self.integrator.stated())
    }

    /// Returns whether pictures will be denoised.
    pub(crate) fn finish(&self) -> Finish {
        Finish::new(self.denoise)
    }

    /// Returns the settings that these options state. Settings that are not stated are the defaults of
    /// `--quality`; a pilot render may change these later.
    pub(crate) fn settings(&self) -> RenderSettings {
        let base = self.quality.settings_for(self.finish());
        RenderSettings {
            picture: self.picture.settings(&base.picture),
            photons: self.photons.settings(&base.photons),
            integrator: self.integrator.settings(&base.integrator),
            cards: CardSet { addresses: vec![self.cards()], ..CardSet::default() },
            ..RenderSettings::default()
        }
    }
}
