//! Command `photoncard render`.

mod darkness;
mod end;
pub(crate) mod files;
mod finished;
mod frames;
mod messages;
mod moments;
pub(crate) mod part;
pub(crate) mod prepare;
mod prepared;
mod steps;
pub(crate) mod video;

use std::sync::OnceLock;
use std::time::Instant;

use photoncard_driver::pack::PackedScene;
use photoncard_driver::render::{
    Ending, Passes, Phase, RenderError, RenderSettings, Renderer, render_chosen,
};
use photoncard_driver::scene::Scene;

use self::darkness::Circumstances;
use self::end::{End, at_once};
use self::steps::{Finished, assigned, chosen, end_early, finish, view};
pub(crate) use self::steps::{dram_bytes, on_threads, without_view};
use crate::arguments::RenderOptions;
use crate::failure::Failure;
use crate::input;
use crate::progress::Progress;

/// Renders a picture, or frames, and writes all requested outputs.
pub(crate) fn run(options: &mut RenderOptions) -> Result<(), Failure> {
    if let Some(outputs) = files::beside_scene(options)? {
        options.outputs = outputs;
    }
    let videos = video::take(options)?;
    let options = &*options;
    match options.frames.numbers() {
        _ if options.prepared.prepared => prepared::run(options)?,
        Some(numbers) => frames::run(options, numbers)?,
        None => run_one(options)?,
    }
    videos.iter().try_for_each(|video| video.write(options))
}

/// Renders one picture of the scene, without animation.
fn run_one(options: &RenderOptions) -> Result<(), Failure> {
    let mut settings = options.settings();
    files::check(options, &options.outputs)?;
    let start = Instant::now();
    let scene = read_scene(options, &mut settings)?;
    let circumstances = Circumstances::of(&scene, &settings.camera(&scene)?);
    let scene_seconds = start.elapsed().as_secs_f64();
    let progress = Progress::start(&options.host, settings.cards.count(), Phase::Tiles)?;
    let found = OnceLock::new();
    let choose = |packed: &PackedScene| {
        let unfitted = options.unfitted(&settings)?;
        let fit = options.fit(&scene, packed, &unfitted, &progress)?;
        Ok(chosen(options, unfitted, found.get_or_init(|| fit).as_ref(), &progress))
    };
    let result = on_threads(options.host.threads, || {
        let Some(aim) = options.samples.aim() else {
            return Ok((render_chosen(&scene, &settings, &choose, &progress)?, None));
        };
        let of_passes = options.aim_of_passes(aim, &settings, start.elapsed());
        let passes = Renderer::default().render_until(&scene, &settings, &choose, of_passes, &progress)?;
        let Passes { rendering, noise, count, ending } = passes;
        let samples = rendering.statistics.samples;
        Ok((rendering, Some(End { aim, noise, passes: count, samples, ending })))
    })?;
    progress.finish();
    let (rendering, end) = result.inspect_err(|error| end_early(error, &progress, &options.outputs))?;
    let fit = found.into_inner().flatten();
    let (inputs, quality) = (input::provenance(&options.scene), options.quality);
    let at_once = at_once(options, &rendering.statistics, fit.as_ref());
    let finished = Finished { rendering, scene_seconds, inputs, quality, fit, frame: None, circumstances };
    finish(options, &options.outputs, finished)?;
    let Some(end) = end else { return Ok(()) };
    if !options.host.quiet {
        end.say(&at_once);
    }
    match end.ending {
        // An interrupt ends passes successfully: the picture of the complete passes is written.
        Ending::Failed(RenderError::Stopped) => Ok(()),
        Ending::Failed(error) => Err(error.into()),
        Ending::Reached | Ending::MaxSamples | Ending::Black => Ok(()),
    }
}

fn read_scene(options: &RenderOptions, settings: &mut RenderSettings) -> Result<Scene, Failure> {
    let scene = assigned(&options.scene, input::load(&options.scene, dram_bytes(settings))?)?;
    view(options, settings, &scene)?;
    Ok(scene)
}
