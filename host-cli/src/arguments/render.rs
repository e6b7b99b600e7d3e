//! Options of `photoncard render`.

use std::thread::available_parallelism;
use std::time::Duration;

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::partial::{PartialError, PartialSettings};
use photoncard_driver::photon_map::PhotonsFor;
use photoncard_driver::quality::{Fit, Quality, Stated, TimeOfPicture};
use photoncard_driver::render::{
    Aim, Observer, PhotonMaps, RenderError, RenderSettings, Schedule, TileOutputs,
};
use photoncard_driver::scene::Scene;

use super::cards::CardOptions;
use super::choice::choice;
use super::frames::FrameOptions;
use super::host::HostOptions;
use super::integrator::IntegratorOptions;
use super::outputs::OutputOptions;
use super::photons::PhotonOptions;
use super::picture::PictureOptions;
use super::prepared::PreparedOption;
use super::samples::SampleOptions;
use super::scene::SceneOptions;
use super::schedule::{PartOptions, ScheduleOptions};

#[derive(Args)]
pub(crate) struct RenderOptions {
    #[command(flatten)]
    pub(crate) scene: SceneOptions,
    #[command(flatten)]
    pub(crate) prepared: PreparedOption,
    /// Quality of the picture, by which the options that are not stated are chosen
    #[arg(long, default_value = Quality::default().name(), value_parser = choice::<Quality>())]
    pub(crate) quality: Quality,
    #[command(flatten)]
    pub(crate) frames: FrameOptions,
    #[command(flatten)]
    pub(crate) picture: PictureOptions,
    #[command(flatten)]
    pub(super) photons: PhotonOptions,
    /// Distribute photons over the whole scene, or guide them to where this camera uses them
    ///
    /// Photons that are guided to the camera are denser where the picture uses them: the light of a window,
    /// for example, wastes fewer photons on the outside of a house. The picture's expected value stays the
    /// same. With auto a pilot render measures the gain and decides, unless all settings that it would choose
    /// are stated. Frames and prepared scenes, which may have several cameras, always have photons for the
    /// whole scene.
    #[arg(long, value_name = "CAMERAS", default_value = PhotonsFor::Auto.name(), value_parser = choice::<PhotonsFor>(), conflicts_with_all = ["frames", "prepared"], help_heading = "Photon maps", hide_short_help = true)]
    photons_for: PhotonsFor,
    #[command(flatten)]
    pub(super) integrator: IntegratorOptions,
    #[command(flatten)]
    pub(crate) samples: SampleOptions,
    #[command(flatten)]
    pub(super) schedule: ScheduleOptions,
    #[command(flatten)]
    pub(crate) parts: PartOptions,
    #[command(flatten)]
    pub(crate) cards: CardOptions,
    #[command(flatten)]
    pub(crate) outputs: OutputOptions,
    #[command(flatten)]
    pub(crate) host: HostOptions,
}

/// Settings of a render before its pilot render, which chooses the settings that are not stated.
pub(crate) struct Unfitted {
    pub(crate) settings: RenderSettings,
    /// Settings that the pilot must not choose: options state them, or kept samples have them.
    pub(crate) stated: Stated,
    /// True if this render adds to samples that an earlier render has kept.
    pub(crate) are_kept: bool,
}

impl RenderOptions {
    /// Returns which settings the options state, among those that `--quality` would choose.
    pub(crate) fn stated(&self) -> Stated {
        self.photons.stated(self.integrator.stated())
    }

    /// Returns whether `--planned-spp` is stated.
    pub(crate) fn states_planned_samples(&self) -> bool {
        self.integrator.planned_spp.is_some()
    }

    /// Returns the settings before the pilot render. If the render adds to kept samples, the settings that no
    /// option states are taken from their file.
    ///
    /// # Errors
    /// If the file of kept samples cannot be read.
    pub(crate) fn unfitted(&self, settings: &RenderSettings) -> Result<Unfitted, PartialError> {
        let kept = settings.outputs.partial.as_ref().map(PartialSettings::kept).transpose()?.flatten();
        let (mut settings, stated) = (settings.clone(), self.stated());
        let Some(kept) = kept else { return Ok(Unfitted { settings, stated, are_kept: false }) };
        stated.take_over(&mut settings, &kept);
        Ok(Unfitted { settings, stated: Stated { samples: stated.samples, ..Stated::ALL }, are_kept: true })
    }

    /// Runs a pilot render of the scene to choose the settings that are not stated. Returns `None` if there
    /// is no setting to choose.
    ///
    /// # Errors
    /// As [`Quality::fit`].
    pub(crate) fn fit(
        &self,
        scene: &Scene,
        packed: &PackedScene,
        unfitted: &Unfitted,
        observer: &dyn Observer,
    ) -> Result<Option<Fit>, RenderError> {
        if !unfitted.stated.needs_fit() {
            return Ok(None);
        }
        let settings = &unfitted.settings;
        let Aim { time, noise } = self.samples.aim().unwrap_or_default();
        let time = time.map(|time| self.time_of_picture(time, settings));
        let wanted = (self.outputs.finish(), time.map(|time| time.cpu_seconds));
        let fit = self.quality.fit(wanted, (scene, packed), settings, observer)?;
        let by_noise = |fit: Fit| noise.map_or(fit, |noise| fit.for_noise(noise));
        let Unfitted { settings: RenderSettings { integrator, .. }, stated, .. } = unfitted;
        let by_time = |fit: Fit| time.map_or(fit, |time| fit.for_time(time, integrator, *stated));
        Ok(fit.map(by_noise).map(by_time))
    }

    /// Returns the aim of a picture's passes: the noise of `aim`, and its time minus the expected time of a
    /// denoiser and minus `elapsed`, the time spent before the passes.
    pub(crate) fn aim_of_passes(&self, aim: Aim, settings: &RenderSettings, elapsed: Duration) -> Aim {
        let left = |time: Duration| {
            let picture = self.time_of_picture(time, settings);
            let share = picture.cpu_seconds_of_denoiser() / picture.cpu_seconds.max(f64::MIN_POSITIVE);
            time.mul_f64((1.0 - share).max(0.0)).saturating_sub(elapsed)
        };
        Aim { time: aim.time.map(left), ..aim }
    }

    fn time_of_picture(&self, time: Duration, settings: &RenderSettings) -> TimeOfPicture {
        let cores = available_parallelism().map_or(1, usize::from);
        let threads = rayon::current_num_threads().min(cores) as f64;
        let window = settings.window();
        TimeOfPicture {
            cpu_seconds: time.as_secs_f64() * threads,
            pixels: f64::from(window.width()) * f64::from(window.height()),
            finish: self.outputs.finish(),
        }
    }

    /// Returns the settings that these options state. Settings that are not stated are the defaults of
    /// `--quality`; a pilot render may change these later.
    pub(crate) fn settings(&self) -> RenderSettings {
        self.settings_of(self.quality)
    }

    /// Returns [`Self::settings`] with `quality` in place of the quality that the options state.
    pub(crate) fn settings_of(&self, quality: Quality) -> RenderSettings {
        let cards = self.cards.settings();
        let base = quality.settings_for(self.outputs.finish());
        RenderSettings {
            picture: self.picture.settings(&base.picture),
            photons: PhotonMaps { photons_for: self.photons_for(), ..self.photons.settings(&base.photons) },
            integrator: self.integrator.settings(&base.integrator),
            schedule: Schedule { part: self.parts.part, ..self.schedule.settings() },
            cards,
            outputs: self.tile_outputs(&self.outputs),
        }
    }

    /// Returns whether a pilot render decides between photons for the whole scene and photons guided to the
    /// camera.
    pub(crate) fn leaves_cameras_open(&self) -> bool {
        self.photons_for() == PhotonsFor::Auto
    }

    /// Value of `--photons-for`, but [`PhotonsFor::Scene`] for frames and prepared scenes: their pictures
    /// share photons.
    fn photons_for(&self) -> PhotonsFor {
        let is_shared = self.frames.numbers().is_some() || self.prepared.prepared;
        if is_shared { PhotonsFor::Scene } else { self.photons_for }
    }

    /// Settings of the partial file and of the display server, which receive each finished tile during a
    /// render.
    pub(crate) fn tile_outputs(&self, outputs: &OutputOptions) -> TileOutputs {
        TileOutputs {
            // With `--time` or `--noise` a stopped render writes its picture, and no partial file.
            partial: outputs.partial().filter(|_| self.samples.aim().is_none()),
            display: outputs.display(),
        }
    }
}
