//! `photoncard render`.

pub(crate) mod files;
mod messages;
pub(crate) mod part;
pub(crate) mod prepare;
mod prepared;

use std::sync::OnceLock;
use std::time::Instant;

use photoncard_driver::choice::Choice;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::quality::{Fit, Measured, Quality, Stated};
use photoncard_driver::render::{
    CardAddress, Integrator, NamedSettings, Passes, Phase, PhotonMaps, RenderError, RenderSettings, Renderer,
    Rendering, render_chosen,
};
use photoncard_driver::scene::{FixedScene, Scene};
use serde_json::json;

use crate::arguments::{RenderOptions, SceneOptions};
use crate::console::say;
use crate::failure::Failure;
use crate::input;
use crate::progress::Progress;

/// Renders a scene, and writes the picture and all other requested outputs.
pub(crate) fn run(options: &RenderOptions) -> Result<(), Failure> {
    if options.prepared.prepared {
        return prepared::run(options);
    }
    let mut settings = options.settings();
    files::check(options)?;
    let start = Instant::now();
    let scene = read_scene(options, &mut settings)?;
    let scene_seconds = start.elapsed().as_secs_f64();
    let progress = Progress::start(options.quiet, settings.cards.count())
        .map_err(|error| Failure::work_error(&error))?
        .in_form(options.progress, Phase::Tiles);
    let found = OnceLock::new();
    let choose = |packed: &PackedScene| {
        let stated = options.stated();
        let fit = if stated == Stated::ALL {
            None
        } else {
            options.quality.fit(&scene, packed, &settings, &progress)?
        };
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
    let (rendering, end) = result.inspect_err(|error| say_kept(options, error, &progress))?;
    let (inputs, quality) = (input::provenance(&options.scene), options.quality);
    let pilot = found.into_inner().flatten().map(|fit| fit.measured);
    finish(options, Finished { rendering, scene_seconds, inputs, quality, pilot })?;
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

/// A finished render, and what its provenance says beside.
struct Finished {
    rendering: Rendering,
    /// Time of reading, seconds.
    scene_seconds: f64,
    /// Inputs by their names.
    inputs: NamedSettings,
    quality: Quality,
    pilot: Option<Measured>,
}

/// Writes the outputs of a finished render.
fn finish(options: &RenderOptions, finished: Finished) -> Result<(), Failure> {
    let Finished { mut rendering, scene_seconds, inputs, quality, pilot } = finished;
    rendering.statistics.time_s.scene = scene_seconds;
    rendering.statistics.time_s.total += scene_seconds;
    let provenance = &mut rendering.statistics.provenance;
    provenance.pixels.extend(inputs);
    provenance.work.insert("quality".to_owned(), json!(quality.name()));
    provenance.work.insert("threads".to_owned(), json!(options.threads));
    provenance.work.insert("pilot".to_owned(), json!(pilot));
    files::write(options, &rendering)?;
    if let Some(partial) = rendering.partial.take().filter(|_| !options.samples.keep_samples) {
        partial.remove().map_err(Failure::work)?;
    }
    if !options.quiet {
        messages::say_done(options, &rendering);
    }
    Ok(())
}

/// Says where the finished tiles of a render are that has failed or was stopped.
fn say_kept(options: &RenderOptions, error: &RenderError, progress: &Progress) {
    if !error.is_input() && progress.has_kept() {
        let path = options.outputs.partial_path();
        say(format_args!("photoncard: finished tiles are kept in {}; --resume goes on", path.display()));
    }
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

fn read_scene(options: &RenderOptions, settings: &mut RenderSettings) -> Result<Scene, Failure> {
    // The image must fit every card.
    let dram_bytes = settings.cards.addresses.iter().map(CardAddress::dram_bytes).min().unwrap_or(u32::MAX);
    let scene = scene_of(&options.scene, dram_bytes)?;
    let camera = settings.camera(&scene)?;
    let misfit = options.picture.fit(&camera, &mut settings.picture);
    if !options.quiet {
        messages::say_loaded(options, settings, &scene, &camera, misfit);
    }
    Ok(scene)
}

/// The scene of the options, with its assignments, for cards of `dram_bytes`.
fn scene_of(options: &SceneOptions, dram_bytes: u32) -> Result<Scene, Failure> {
    let mut scene = input::load(options, dram_bytes)?;
    for assignment in &options.assignments {
        scene.apply(assignment).map_err(Failure::input)?;
    }
    scene.check_light().map_err(Failure::input)?;
    Ok(scene)
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
