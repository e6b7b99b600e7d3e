//! Steps of a render that are the same for a single picture and for a frame.

use photoncard_driver::choice::Choice;
use photoncard_driver::quality::{Fit, Quality};
use photoncard_driver::render::{
    CardAddress, Integrator, NamedSettings, PhotonMaps, RenderError, RenderSettings, Rendering,
};
use photoncard_driver::scene::Scene;
use serde_json::json;

use super::darkness::{Circumstances, say_dark};
use super::{files, messages};
use crate::arguments::{HostOptions, OutputOptions, RenderOptions, SceneOptions, Unfitted};
use crate::console::say;
use crate::failure::Failure;
use crate::flags::with_flags;
use crate::notices::{self, Uses};
use crate::progress::Progress;

/// Prints where the finished tiles of a failed render are kept, and writes its statistics so far.
pub(super) fn end_early(error: &RenderError, progress: &Progress, outputs: &OutputOptions) {
    if error.is_input() {
        return;
    }
    if progress.has_kept() {
        let path = outputs.partial_path();
        say(format_args!("photoncard: finished tiles are kept in {}; --resume goes on", path.display()));
    }
    let mut statistics = progress.take_failed().unwrap_or_else(|| json!({}));
    statistics["error"] = json!(with_flags(&error.to_string()));
    // The render's own error is returned by the caller: a failure to write is only printed.
    if let Err(failure) = files::write_statistics(outputs, serde_json::to_string_pretty(&statistics)) {
        say(format_args!("photoncard: {}", failure.line()));
    }
}

/// Finished picture, with the facts for its messages and provenance.
pub(super) struct Finished {
    pub(super) rendering: Rendering,
    /// Time of reading the scene, seconds.
    pub(super) scene_seconds: f64,
    /// File names and options that determine the scene, and the frame's number if there is one.
    pub(super) inputs: NamedSettings,
    pub(super) quality: Quality,
    /// Settings that a pilot render has chosen; `None` without a pilot render.
    pub(super) fit: Option<Fit>,
    /// Number of the frame; `None` for a picture without animation.
    pub(super) frame: Option<u32>,
    pub(super) circumstances: Circumstances,
}

/// Writes the outputs of a finished picture, and prints messages about them.
pub(super) fn finish(
    options: &RenderOptions,
    outputs: &OutputOptions,
    finished: Finished,
) -> Result<(), Failure> {
    let Finished { mut rendering, scene_seconds, inputs, quality, fit, frame, circumstances } = finished;
    rendering.statistics.time_s.scene = scene_seconds;
    rendering.statistics.time_s.total += scene_seconds;
    let provenance = &mut rendering.statistics.provenance;
    provenance.pixels.extend(inputs);
    provenance.work.insert("quality".to_owned(), json!(quality.name()));
    provenance.work.insert("threads".to_owned(), json!(options.host.threads));
    provenance.work.insert("pilot".to_owned(), json!(fit.map(|fit| fit.measured)));
    files::write(options, outputs, &mut rendering)?;
    if let Some(partial) = rendering.partial.take().filter(|_| !options.samples.keep_samples) {
        partial.remove().map_err(Failure::work)?;
    }
    if !options.host.quiet {
        messages::say_done(outputs, &rendering, frame);
    }
    messages::say_sparse(&rendering.statistics);
    messages::say_dazzling(&rendering.statistics);
    if options.parts.part.is_none() {
        say_dark(&rendering.film, circumstances);
    }
    Ok(())
}

/// Returns the settings of photons and integrator: those that a pilot has chosen, except where options or
/// kept samples state them. Prints the settings, unless `--quiet` is given.
pub(super) fn chosen(
    options: &RenderOptions,
    unfitted: Unfitted,
    fit: Option<&Fit>,
    progress: &Progress,
) -> (PhotonMaps, Integrator) {
    let Unfitted { mut settings, stated, are_kept } = unfitted;
    if let Some(fit) = fit {
        fit.apply(&mut settings, stated);
    }
    if !options.host.quiet && (fit.is_some() || are_kept) {
        let by = if are_kept { "kept samples".to_owned() } else { messages::by_quality(options.quality) };
        let are_planned = options.samples.aim().is_some();
        progress.say(format_args!("photoncard: {by}: {}", messages::chosen(&settings, are_planned)));
        let notes = fit.map(|fit| messages::fitted(fit, &settings, stated)).unwrap_or_default();
        notes.iter().for_each(|note| progress.say(format_args!("photoncard: {by}: {note}")));
    }
    (settings.photons, settings.integrator)
}

/// Memory of the card with the most memory, bytes. A scene may need all of it: smaller cards are then left
/// out.
pub(crate) fn dram_bytes(settings: &RenderSettings) -> u64 {
    settings.cards.addresses.iter().map(CardAddress::dram_bytes).max().unwrap_or(u64::MAX)
}

/// Applies the assignments (`--set`) and light groups to a scene, and checks that the scene has light.
pub(crate) fn assigned(options: &SceneOptions, mut scene: Scene) -> Result<Scene, Failure> {
    for assignment in &options.assignments {
        scene.apply(assignment).map_err(Failure::input)?;
    }
    scene.set_light_groups(&options.light_groups).map_err(Failure::input)?;
    scene.check_light().map_err(Failure::input)?;
    Ok(scene)
}

/// Prepares a loaded scene and the settings for work without a view: applies the options, and says what is
/// ignored.
pub(crate) fn without_view(
    options: &SceneOptions,
    host: &HostOptions,
    (scene, settings): (Scene, RenderSettings),
) -> Result<(Scene, RenderSettings), Failure> {
    let scene = assigned(options, scene)?;
    let settings = settings.with(|s| s.picture.light_groups = scene.light_groups.names().to_vec());
    notices::say_ignored(options, &scene, &Uses::without_view(options))?;
    if !host.quiet {
        notices::say_remarks(&options.path, &scene);
    }
    Ok((scene, settings))
}

/// Gives a picture the scene's light groups and, without a stated size, the camera's aspect ratio, and prints
/// the loaded contents.
pub(super) fn view(
    options: &RenderOptions,
    settings: &mut RenderSettings,
    scene: &Scene,
) -> Result<(), Failure> {
    settings.picture.light_groups = scene.light_groups.names().to_vec();
    let camera = settings.camera(scene)?;
    let misfit = options.picture.fit(&camera, &mut settings.picture);
    messages::say_loaded(options, settings, scene, &camera, misfit)
}

/// Runs `work` on a pool of `threads` threads; on rayon's global pool if `None`.
pub(crate) fn on_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> T + Send,
) -> Result<T, Failure> {
    let Some(threads) = threads else { return Ok(work()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    Ok(pool.map_err(|error| Failure::work_error(&error))?.install(work))
}
