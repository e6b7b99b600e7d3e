//! A render of a prepared scene.

use std::time::Instant;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::choice::Choice;
use photoncard_driver::quality::Quality;
use photoncard_driver::render::{NamedSettings, Phase, PreparedScene};
use serde_json::Value;

use super::steps::{Finished, finish, on_threads, say_kept};
use super::{files, messages};
use crate::arguments::RenderOptions;
use crate::failure::Failure;
use crate::progress::Progress;

/// Renders a prepared scene, and writes the picture and all other requested outputs.
pub(super) fn run(options: &RenderOptions) -> Result<(), Failure> {
    files::check(options, &options.outputs)?;
    let start = Instant::now();
    let prepared = PreparedScene::open(&options.scene.path).map_err(Failure::input)?;
    let (quality, inputs) = notes(options, &prepared)?;
    let mut settings = prepared.settings(options.settings_of(quality));
    let camera = settings.camera(prepared.scene())?;
    let misfit = options.picture.fit(&camera, &mut settings.picture);
    if !options.quiet {
        messages::say_prepared(options, &settings, &inputs, &camera, misfit.as_ref());
    }
    let scene_seconds = start.elapsed().as_secs_f64();
    let progress = Progress::start(options.quiet, settings.cards.count())
        .map_err(|error| Failure::work_error(&error))?
        .in_form(options.progress, Phase::Tiles);
    let (mut renderer, scene) = prepared.into_renderer();
    let result = on_threads(options.threads, || renderer.render_fixed(&scene, &settings, &progress))?;
    progress.finish();
    let rendering = result.inspect_err(|error| say_kept(error, &progress, &options.outputs))?;
    let finished = Finished { rendering, scene_seconds, inputs, quality, fit: None, frame: None };
    finish(options, &options.outputs, finished)
}

/// Quality and inputs of a prepared scene.
fn notes(options: &RenderOptions, prepared: &PreparedScene) -> Result<(Quality, NamedSettings), Failure> {
    let quality = prepared.notes().get("quality").and_then(|name| Quality::of_name(name.as_str()?).ok());
    let inputs = prepared.notes().get("inputs").and_then(Value::as_object);
    quality.zip(inputs.cloned()).ok_or_else(|| {
        let text = format!("{} was not prepared by this command", options.scene.path.display());
        Failure::Input(Report::new(
            MietteDiagnostic::new(text).with_help("prepare the scene by photoncard prepare"),
        ))
    })
}
