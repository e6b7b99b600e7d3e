//! `photoncard render`.

pub(crate) mod files;
mod frames;
mod messages;

use std::sync::OnceLock;
use std::time::Instant;

use photoncard_driver::choice::Choice;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::quality::Fit;
use photoncard_driver::render::{
    CardAddress, Integrator, Passes, PhotonMaps, RenderError, RenderSettings, Renderer, Rendering,
    render_chosen,
};
use photoncard_driver::scene::{FixedScene, Scene};
use serde_json::json;

use crate::arguments::{OutputOptions, RenderOptions, SceneOptions};
use crate::console::say;
use crate::failure::Failure;
use crate::input;
use crate::progress::Progress;

/// Renders a scene, and writes the pictures and all other requested outputs.
pub(crate) fn run(options: &RenderOptions) -> Result<(), Failure> {
    match options.frames.numbers() {
        Some(numbers) => frames::run(options, numbers),
        None => run_one(options),
    }
}

/// Renders the scene as it stands.
fn run_one(options: &RenderOptions) -> Result<(), Failure> {
    let mut settings = options.settings();
    files::check(options, &options.outputs)?;
    let start = Instant::now();
    let scene = read_scene(options, &mut settings)?;
    let scene_seconds = start.elapsed().as_secs_f64();
    let progress = Progress::start(options.quiet, settings.cards.count())
        .map_err(|error| Failure::work_error(&error))?;
    let found = OnceLock::new();
    let choose = |packed: &PackedScene| {
        let fit = options.fit(&scene, packed, &settings, &progress)?;
        Ok(chosen(options, &settings, found.get_or_init(|| fit).as_ref(), &progress))
    };
    let result = on_threads(options.threads, || {
        let Some(aim) = options.samples.aim() else {
            return Ok((render_chosen(&scene, &settings, &choose, &progress)?, None));
        };
        let scene = FixedScene::from(&scene);
        let passes = Renderer::default().render_until(&scene, &settings, &choose, aim, &progress)?;
        let Passes { rendering, noise, count, ended_by } = passes;
        Ok((rendering, Some(messages::End { noise, passes: count, ended_by })))
    })?;
    progress.finish();
    let (rendering, end) = result.inspect_err(|error| say_kept(error, &progress, &options.outputs))?;
    let fit = found.into_inner().flatten();
    finish(options, &options.outputs, Finished { rendering, scene_seconds, fit, frame: None })?;
    let Some(end) = end else { return Ok(()) };
    if !options.quiet {
        messages::say_end(&end);
    }
    match end.ended_by {
        // The picture that was asked for until then is written.
        None | Some(RenderError::Stopped) => Ok(()),
        Some(error) => Err(error.into()),
    }
}

/// Says where the finished tiles of a render are that was ended by an error.
fn say_kept(error: &RenderError, progress: &Progress, outputs: &OutputOptions) {
    if !error.is_input() && progress.has_kept() {
        let path = outputs.partial_path();
        say(format_args!("photoncard: finished tiles are kept in {}; --resume goes on", path.display()));
    }
}

/// A finished picture, and what it was made by.
struct Finished {
    rendering: Rendering,
    /// Time of reading the scene, seconds.
    scene_seconds: f64,
    /// What the quality has found for the scene, if it was looked for.
    fit: Option<Fit>,
    /// Number of the frame, if it is one.
    frame: Option<u32>,
}

/// Writes the outputs of a finished picture, and says so.
fn finish(options: &RenderOptions, outputs: &OutputOptions, finished: Finished) -> Result<(), Failure> {
    let Finished { mut rendering, scene_seconds, fit, frame } = finished;
    rendering.statistics.time_s.scene = scene_seconds;
    rendering.statistics.time_s.total += scene_seconds;
    let provenance = &mut rendering.statistics.provenance;
    provenance.pixels.extend(input::provenance(&options.scene));
    provenance.pixels.extend(frame.map(|frame| options.frames.provenance(frame)).into_iter().flatten());
    provenance.work.insert("quality".to_owned(), json!(options.quality.name()));
    provenance.work.insert("threads".to_owned(), json!(options.threads));
    provenance.work.insert("pilot".to_owned(), json!(fit.map(|fit| fit.measured)));
    files::write(options, outputs, &rendering)?;
    if let Some(partial) = rendering.partial.take().filter(|_| !options.samples.keep_samples) {
        partial.remove().map_err(Failure::work)?;
    }
    if !options.quiet {
        messages::say_done(outputs, &rendering, frame);
    }
    Ok(())
}

/// Photons and integrator of the options, with what the quality has found for this scene where nothing is stated.
fn chosen(
    options: &RenderOptions,
    settings: &RenderSettings,
    fit: Option<&Fit>,
    progress: &Progress,
) -> (PhotonMaps, Integrator) {
    let chosen = settings.clone().with(|settings| {
        if let Some(fit) = fit {
            fit.apply(settings, options.stated());
        }
    });
    if !options.quiet && fit.is_some() {
        progress.say(format_args!("photoncard: {}", messages::chosen(options.quality, &chosen)));
    }
    (chosen.photons, chosen.integrator)
}

/// Memory of every card, bytes: the image must fit.
fn dram_bytes(settings: &RenderSettings) -> u32 {
    settings.cards.addresses.iter().map(CardAddress::dram_bytes).min().unwrap_or(u32::MAX)
}

fn read_scene(options: &RenderOptions, settings: &mut RenderSettings) -> Result<Scene, Failure> {
    let scene = assigned(&options.scene, input::load(&options.scene, dram_bytes(settings))?)?;
    view(options, settings, &scene)?;
    Ok(scene)
}

/// The scene with the options' assignments; it has light.
fn assigned(options: &SceneOptions, mut scene: Scene) -> Result<Scene, Failure> {
    for assignment in &options.assignments {
        scene.apply(assignment).map_err(Failure::input)?;
    }
    scene.check_light().map_err(Failure::input)?;
    Ok(scene)
}

/// Gives the picture the aspect ratio of the camera, and says what was loaded.
fn view(options: &RenderOptions, settings: &mut RenderSettings, scene: &Scene) -> Result<(), Failure> {
    let camera = settings.camera(scene)?;
    let misfit = options.picture.fit(&camera, &mut settings.picture);
    if !options.quiet {
        messages::say_loaded(options, settings, scene, &camera, misfit);
    }
    Ok(())
}

/// Runs `work` on a pool of `threads` threads.
pub(crate) fn on_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> T + Send,
) -> Result<T, Failure> {
    let Some(threads) = threads else { return Ok(work()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    Ok(pool.map_err(|error| Failure::work_error(&error))?.install(work))
}
