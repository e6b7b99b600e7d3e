//! Frames of a scene's animations, one after another on the same cards.

use std::time::Instant;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::quality::Fit;
use photoncard_driver::render::{
    Integrator, Phase, PhotonMaps, RenderError, RenderSettings, Renderer, Rendering,
};
use photoncard_driver::scene::{FixedScene, Scene};

use super::steps::{Finished, assigned, chosen, dram_bytes, finish, on_threads, say_kept, view};
use super::{files, messages};
use crate::arguments::{OutputOptions, RenderOptions};
use crate::failure::Failure;
use crate::input::{self, Input};
use crate::progress::Progress;

/// Renders the frames of these numbers, and writes their pictures and all other requested outputs.
pub(super) fn run(options: &RenderOptions, numbers: impl Iterator<Item = u32>) -> Result<(), Failure> {
    let start = Instant::now();
    let mut settings = options.settings();
    let frames = numbers.map(|number| Ok((number, outputs_of(options, number)?)));
    let frames: Vec<_> = frames.collect::<Result<_, Failure>>()?;
    let mut sequence = Sequence::open(options, &mut settings)?;
    let count = frames.len();
    for (number, outputs) in frames {
        sequence.render(number, &outputs, &mut settings)?;
    }
    sequence.progress.finish();
    if !options.quiet {
        messages::say_frames(count, start.elapsed().as_secs_f64());
    }
    Ok(())
}

/// Outputs of a frame, which can be written.
fn outputs_of(options: &RenderOptions, number: u32) -> Result<OutputOptions, Failure> {
    let outputs = options.outputs.of_frame(number).map_err(|pattern| {
        let text = format!("the output {} has no place for the number of a frame", pattern.display());
        let report = MietteDiagnostic::new(text);
        Failure::Input(Report::new(report.with_help("put a run of # into its name, such as out.####.exr")))
    })?;
    files::check(options, &outputs)?;
    Ok(outputs)
}

/// The frames of a scene, and what they share.
struct Sequence<'a> {
    options: &'a RenderOptions,
    input: Input,
    /// The scene of the last frame; at first that at rest, if nothing but cameras moves.
    scene: FixedScene<'static>,
    /// True if a frame has the geometry and the lights of the others.
    is_still: bool,
    /// The scene as it stands, by which the settings are chosen; `None` once they are.
    rest: Option<Scene>,
    renderer: Renderer,
    progress: Progress,
    /// Time of reading that is not told of yet, seconds.
    scene_seconds: f64,
}

impl<'a> Sequence<'a> {
    fn open(options: &'a RenderOptions, settings: &mut RenderSettings) -> Result<Self, Failure> {
        let start = Instant::now();
        let input = Input::open(&options.scene, dram_bytes(settings))?;
        check_animations(&input)?;
        let is_still = input.file.only_cameras_move(options.frames.animations()).map_err(Failure::input)?;
        let rest = assigned(&options.scene, input.at_rest()?)?;
        view(options, settings, &rest)?;
        let scene = if is_still { rest.clone() } else { Scene::default() };
        let progress = Progress::of_frames(options.quiet, settings.cards.count())
            .map_err(|error| Failure::work_error(&error))?
            .in_form(options.progress, Phase::Tiles);
        Ok(Self {
            options,
            input,
            scene: scene.into(),
            is_still,
            rest: Some(rest),
            renderer: Renderer::default(),
            progress,
            scene_seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Renders a frame, and writes its outputs. The settings become those that are chosen for the scene.
    fn render(
        &mut self,
        number: u32,
        outputs: &OutputOptions,
        settings: &mut RenderSettings,
    ) -> Result<(), Failure> {
        let start = Instant::now();
        self.move_to(number)?;
        settings.outputs = self.options.tile_outputs(outputs);
        self.scene_seconds += start.elapsed().as_secs_f64();
        let result = on_threads(self.options.threads, || self.picture(settings))?;
        self.progress.finish();
        let result = result.inspect_err(|error| say_kept(error, &self.progress, outputs));
        let (rendering, fit) = result.map_err(|error| match error {
            RenderError::Stopped => Failure::Stopped("stopped; the frames before are written"),
            error => error.into(),
        })?;
        let finished = Finished {
            rendering,
            scene_seconds: std::mem::take(&mut self.scene_seconds),
            inputs: input::provenance(&self.options.scene),
            quality: self.options.quality,
            fit,
            frame: Some(number),
        };
        finish(self.options, outputs, finished)
    }

    /// Places the scene as it is in a frame. Where nothing but cameras moves, all else of it stays.
    fn move_to(&mut self, number: u32) -> Result<(), Failure> {
        let moment = self.options.frames.moment(number);
        if !self.is_still {
            self.scene = assigned(&self.options.scene, self.input.at(&moment)?)?.into();
            return Ok(());
        }
        let cameras = self.input.file.cameras_at(&moment).map_err(Failure::input)?;
        // Without cameras in the file the scene is seen as at rest.
        if !cameras.is_empty() {
            self.scene.set_cameras(cameras);
        }
        Ok(())
    }

    /// The picture of the scene. Its settings are chosen with the first one, by the scene as it stands, whichever frame that is.
    fn picture(&mut self, settings: &mut RenderSettings) -> Result<(Rendering, Option<Fit>), RenderError> {
        let Self { options, scene, is_still, rest, renderer, progress, .. } = self;
        progress.begin_frame();
        let Some(rest) = rest.take() else {
            return Ok((renderer.render_fixed(scene, settings, progress)?, None));
        };
        let found = std::cell::RefCell::new(None);
        let choose = |packed: &PackedScene| {
            let unfitted = options.unfitted(settings)?;
            let fit = if *is_still {
                options.fit(&rest, packed, &unfitted, progress)
            } else {
                options.fit(&rest, &PackedScene::new(&rest)?, &unfitted, progress)
            }?;
            let chosen = chosen(options, unfitted, fit.as_ref(), progress);
            *found.borrow_mut() = Some((fit, chosen.clone()));
            Ok(chosen)
        };
        let rendering = renderer.render_chosen_fixed(scene, settings, &choose, progress)?;
        let found: Option<(Option<Fit>, (PhotonMaps, Integrator))> = found.into_inner();
        let Some((fit, (photons, integrator))) = found else { return Ok((rendering, None)) };
        (settings.photons, settings.integrator) = (photons, integrator);
        Ok((rendering, fit))
    }
}

/// Checks that the file has animations.
fn check_animations(input: &Input) -> Result<(), Failure> {
    if input.file.is_animated() {
        return Ok(());
    }
    let report = MietteDiagnostic::new("the scene has no animations, and all of its frames are alike");
    Err(Failure::Input(Report::new(
        report.with_help("leave out --frames, or export the scene with its animations"),
    )))
}
