//! Renders frames of a scene's animations, one after another on the same cards.

use std::time::Instant;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::quality::Fit;
use photoncard_driver::render::{
    Integrator, Phase, PhotonMaps, RenderError, RenderSettings, Renderer, Rendering,
};
use photoncard_driver::scene::Scene;

use super::darkness::Circumstances;
use super::moments::Moments;
use super::steps::{Finished, chosen, dram_bytes, end_early, finish, on_threads, view};
use super::{files, finished, messages};
use crate::arguments::{OutputOptions, RenderOptions};
use crate::failure::Failure;
use crate::input;
use crate::progress::Progress;

/// Renders the frames with these numbers, and writes their outputs.
pub(super) fn run(options: &RenderOptions, numbers: impl Iterator<Item = u32>) -> Result<(), Failure> {
    let start = Instant::now();
    let mut settings = options.settings();
    let frames = numbers.map(|number| Ok((number, outputs_of(options, number)?)));
    let frames: Vec<_> = frames.collect::<Result<_, Failure>>()?;
    let mut sequence = Sequence::open(options, &mut settings)?;
    let count = frames.len();
    if frames.iter().any(|(_, outputs)| finished::may_be(outputs)) {
        // Settings of kept samples are read from the first frame's partial file, finished or not.
        settings.outputs = frames.first().map(|(_, first)| options.tile_outputs(first)).unwrap_or_default();
        sequence.settle(&mut settings)?;
    }
    for (number, outputs) in frames {
        sequence.render(number, &outputs, &mut settings)?;
    }
    sequence.progress.finish();
    if !options.host.quiet {
        messages::say_frames(count, start.elapsed().as_secs_f64());
    }
    Ok(())
}

/// Outputs of a frame, checked to be writable.
pub(super) fn outputs_of(options: &RenderOptions, number: u32) -> Result<OutputOptions, Failure> {
    if options.cards.trace.is_some() {
        let report = MietteDiagnostic::new("--trace is of one picture, and --frames are several");
        return Err(Failure::Input(Report::new(report.with_help("trace a picture without --frames"))));
    }
    let outputs = options.outputs.of_frame(number).map_err(|pattern| {
        let text = format!("the output {} has no place for the number of a frame", pattern.display());
        let report = MietteDiagnostic::new(text);
        Failure::Input(Report::new(report.with_help("put a run of # into its name, such as out.####.exr")))
    })?;
    files::check(options, &outputs)?;
    Ok(outputs)
}

/// State that the frames of a render share.
struct Sequence<'a> {
    options: &'a RenderOptions,
    moments: Moments<'a>,
    /// Scene without animation, for which the quality chooses the settings; `None` once they are chosen.
    rest: Option<Scene>,
    renderer: Renderer,
    progress: Progress,
    /// Time of reading the scene that is not yet part of a frame's statistics, seconds.
    scene_seconds: f64,
}

impl<'a> Sequence<'a> {
    fn open(options: &'a RenderOptions, settings: &mut RenderSettings) -> Result<Self, Failure> {
        let start = Instant::now();
        let (moments, rest) = Moments::open(&options.scene, &options.frames, dram_bytes(settings))?;
        view(options, settings, &rest)?;
        let progress = Progress::of_frames(&options.host, settings.cards.count(), Phase::Tiles)?;
        Ok(Self {
            options,
            moments,
            rest: Some(rest),
            renderer: Renderer::default(),
            progress,
            scene_seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Renders a frame and writes its outputs. The first call replaces photons and integrator of `settings`
    /// by those that the quality chooses.
    fn render(
        &mut self,
        number: u32,
        outputs: &OutputOptions,
        settings: &mut RenderSettings,
    ) -> Result<(), Failure> {
        let start = Instant::now();
        self.moments.move_to(number)?;
        settings.outputs = self.options.tile_outputs(outputs);
        self.scene_seconds += start.elapsed().as_secs_f64();
        let inputs = input::provenance(&self.options.scene);
        let inputs = inputs.into_iter().chain(self.options.frames.provenance(number)).collect();
        if finished::is_finished(self.options, outputs, settings, self.moments.scene(), &inputs) {
            if !self.options.host.quiet {
                messages::say_finished(outputs, number);
            }
            return Ok(());
        }
        let result = on_threads(self.options.host.threads, || self.picture(settings))?;
        self.progress.finish();
        let result = result.inspect_err(|error| end_early(error, &self.progress, outputs));
        let (rendering, fit) = result.map_err(|error| match error {
            RenderError::Stopped => Failure::Stopped("stopped; the frames before are written"),
            error => error.into(),
        })?;
        let finished = Finished {
            rendering,
            scene_seconds: std::mem::take(&mut self.scene_seconds),
            inputs,
            quality: self.options.quality,
            fit,
            frame: Some(number),
            circumstances: Circumstances::of(self.moments.scene(), &settings.camera(self.moments.scene())?),
        };
        finish(self.options, outputs, finished)
    }

    /// Chooses the settings before the first frame, because finished frames are recognised by their settings.
    fn settle(&mut self, settings: &mut RenderSettings) -> Result<(), Failure> {
        let Self { options, rest, progress, .. } = self;
        let Some(rest) = rest.take() else { return Ok(()) };
        let (photons, integrator) = on_threads(options.host.threads, || {
            let unfitted = options.unfitted(settings)?;
            let fit = options.fit(&rest, &PackedScene::new(&rest)?, &unfitted, progress)?;
            Ok::<_, RenderError>(chosen(options, unfitted, fit.as_ref(), progress))
        })??;
        (settings.photons, settings.integrator) = (photons, integrator);
        Ok(())
    }

    /// Renders the current frame of the scene. The first call chooses the settings, for the scene without
    /// animation.
    fn picture(&mut self, settings: &mut RenderSettings) -> Result<(Rendering, Option<Fit>), RenderError> {
        let Self { options, moments, rest, renderer, progress, .. } = self;
        let scene = moments.scene();
        progress.begin_frame();
        let Some(rest) = rest.take() else {
            return Ok((renderer.render(scene, settings, progress)?, None));
        };
        let found = std::cell::RefCell::new(None);
        let choose = |packed: &PackedScene| {
            let unfitted = options.unfitted(settings)?;
            let fit = if moments.is_still() {
                options.fit(&rest, packed, &unfitted, progress)
            } else {
                options.fit(&rest, &PackedScene::new(&rest)?, &unfitted, progress)
            }?;
            let chosen = chosen(options, unfitted, fit.as_ref(), progress);
            *found.borrow_mut() = Some((fit, chosen.clone()));
            Ok(chosen)
        };
        let rendering = renderer.render_chosen(scene, settings, &choose, progress)?;
        let found: Option<(Option<Fit>, (PhotonMaps, Integrator))> = found.into_inner();
        let Some((fit, (photons, integrator))) = found else { return Ok((rendering, None)) };
        (settings.photons, settings.integrator) = (photons, integrator);
        Ok((rendering, fit))
    }
}
