//! Renders of a prepared scene.

use std::path::{Path, PathBuf};
use std::time::Instant;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::choice::Choice;
use photoncard_driver::quality::{Finish, Quality};
use photoncard_driver::render::{NamedSettings, Phase, PreparedScene, RenderError, Renderer};
use serde_json::{Value, json};

use super::darkness::Circumstances;
use super::finished::is_finished;
use super::frames::outputs_of;
use super::steps::{Finished, end_early, finish, on_threads};
use super::{files, messages};
use crate::arguments::{OutputOptions, RenderOptions, last_numbered};
use crate::console::say;
use crate::failure::Failure;
use crate::progress::Progress;

/// Renders a prepared scene or frames of one, and writes all requested outputs.
pub(super) fn run(options: &RenderOptions) -> Result<(), Failure> {
    let outputs: Vec<(Option<u32>, OutputOptions)> = match options.frames.numbers() {
        Some(numbers) => {
            let outputs = numbers.map(|number| Ok((Some(number), outputs_of(options, number)?)));
            outputs.collect::<Result<_, Failure>>()?
        }
        None => {
            files::check(options, &options.outputs)?;
            vec![(None, options.outputs.clone())]
        }
    };
    let count = options.settings().cards.count();
    let progress = if outputs.len() > 1 { Progress::of_frames } else { Progress::start }(
        &options.host,
        count,
        Phase::Tiles,
    )?;
    let (start, pictures) = (Instant::now(), outputs.len());
    let mut last: Option<OpenScene> = None;
    for (frame, outputs) in outputs {
        let path = path_of(&options.scene.path, frame)?;
        let scene = match last.take().filter(|scene| scene.path == path) {
            Some(scene) => last.insert(scene),
            None => last.insert(OpenScene::open(options, path, frame.is_none())?),
        };
        scene.render(options, frame, &outputs, &progress)?;
    }
    if pictures > 1 && !options.host.quiet {
        messages::say_frames(pictures, start.elapsed().as_secs_f64());
    }
    Ok(())
}

/// Path of the prepared scene that contains a frame.
fn path_of(pattern: &Path, frame: Option<u32>) -> Result<PathBuf, Failure> {
    let Some(frame) = frame else { return Ok(pattern.to_owned()) };
    last_numbered(pattern, frame).ok_or_else(|| without_frame(pattern, frame))
}

fn without_frame(path: &Path, frame: u32) -> Failure {
    let text = format!("{} has no frame {frame}", path.display());
    refusal(text, "prepare it: photoncard prepare SCENE --frames RANGES")
}

fn refusal(text: String, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

/// Open file of a prepared scene, with a renderer.
struct OpenScene {
    path: PathBuf,
    prepared: PreparedScene,
    renderer: Renderer,
    quality: Quality,
    prepared_for: Finish,
    inputs: NamedSettings,
    /// Time of opening the file, seconds; 0 once a picture's statistics contain it.
    seconds: f64,
}

impl OpenScene {
    /// Opens a prepared scene. `is_rest` is true if no frame is requested; a file of frames is then an error.
    fn open(options: &RenderOptions, path: PathBuf, is_rest: bool) -> Result<Self, Failure> {
        let start = Instant::now();
        let prepared = PreparedScene::open(&path).map_err(Failure::input)?;
        if is_rest && prepared.frames().next().is_some() {
            let text = format!("{} is a scene of frames", path.display());
            return Err(refusal(text, "state those to render: --frames RANGES"));
        }
        let quality = prepared.notes().get("quality").and_then(|name| Quality::of_name(name.as_str()?).ok());
        let inputs = prepared.notes().get("inputs").and_then(Value::as_object);
        let (quality, inputs) = quality.zip(inputs.cloned()).ok_or_else(|| {
            let text = format!("{} was not prepared by this command", options.scene.path.display());
            refusal(text, "prepare the scene by photoncard prepare")
        })?;
        let prepared_for = Finish::new(prepared.notes().get("denoise") == Some(&Value::Bool(true)));
        let (renderer, seconds) = (prepared.renderer(), start.elapsed().as_secs_f64());
        Ok(Self { path, prepared, renderer, quality, prepared_for, inputs, seconds })
    }

    fn render(
        &mut self,
        options: &RenderOptions,
        frame: Option<u32>,
        outputs: &OutputOptions,
        progress: &Progress,
    ) -> Result<(), Failure> {
        let Self { path, prepared, renderer, quality, prepared_for, inputs, seconds } = self;
        let own;
        let scene = match frame {
            None => prepared.scene(),
            Some(frame) => {
                own = prepared.frame(frame).ok_or_else(|| without_frame(path, frame))?;
                &own
            }
        };
        let mut settings = prepared.settings(options.settings_of(*quality));
        settings.outputs = options.tile_outputs(outputs);
        settings.picture.light_groups = scene.light_groups.names().to_vec();
        let camera = settings.camera(scene)?;
        let misfit = options.picture.fit(&camera, &mut settings.picture);
        let mut inputs = inputs.clone();
        if !options.host.quiet && *seconds > 0.0 {
            messages::say_prepared(path, &settings, &inputs, &camera);
            misfit.iter().for_each(|notice| say(format_args!("photoncard: {notice}")));
            if options.parts.part.is_none() {
                messages::say_other_finish(path, *quality, *prepared_for, outputs.finish());
            }
        }
        inputs.extend(frame.map(|frame| ("frame".to_owned(), json!(frame))));
        if let Some(frame) = frame.filter(|_| is_finished(options, outputs, &settings, scene, &inputs)) {
            if !options.host.quiet {
                messages::say_finished(outputs, frame);
            }
            return Ok(());
        }
        progress.begin_frame();
        let result = on_threads(options.host.threads, || renderer.render(scene, &settings, progress))?;
        progress.finish();
        let result = result.inspect_err(|error| end_early(error, progress, outputs));
        let rendering = result.map_err(|error| match (frame, error) {
            (Some(_), RenderError::Stopped) => Failure::Stopped("stopped; the frames before are written"),
            (_, error) => error.into(),
        })?;
        let (scene_seconds, quality) = (std::mem::take(seconds), *quality);
        let circumstances = Circumstances::default();
        let finished =
            Finished { rendering, scene_seconds, inputs, quality, fit: None, frame, circumstances };
        finish(options, outputs, finished)
    }
}
