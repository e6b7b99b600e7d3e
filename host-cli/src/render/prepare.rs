//! Command `photoncard prepare`.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::choice::Choice;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::quality::Finish;
use photoncard_driver::render::{Chosen, Phase, PreparedScene, RenderSettings};
use photoncard_driver::scene::Scene;
use serde_json::{Map, Value, json};

use super::messages;
use super::moments::Moments;
use super::steps::{assigned, on_threads};
use crate::arguments::{PrepareOptions, numbered};
use crate::console::say;
use crate::failure::Failure;
use crate::notices::{self, Uses};
use crate::progress::Progress;
use crate::{input, outputs};

/// Prepares a scene, without animation or for frames, and writes it.
pub(crate) fn run(options: &PrepareOptions) -> Result<(), Failure> {
    match options.frames.numbers() {
        None => prepare_rest(options),
        Some(numbers) => prepare_frames(options, &numbers.collect::<Vec<_>>()),
    }
}

fn prepare_rest(options: &PrepareOptions) -> Result<(), Failure> {
    check(options, &options.output)?;
    let scene = assigned(&options.scene, input::load(&options.scene, options.budget().dram_bytes)?)?;
    let preparation = Preparation::new(options, &scene)?;
    let prepared = preparation.of(&scene, &|packed| preparation.choose(&scene, packed))?;
    preparation.write(&prepared, &options.output)
}

/// Prepares frames. Consecutive frames that differ only by their cameras share a file.
fn prepare_frames(options: &PrepareOptions, numbers: &[u32]) -> Result<(), Failure> {
    let path = |number: u32| numbered(&options.output, number).unwrap_or_else(|| options.output.clone());
    numbers.iter().try_for_each(|&number| check(options, &path(number)))?;
    let dram_bytes = options.budget().dram_bytes;
    let (mut moments, rest) = Moments::open(&options.scene, &options.frames, dram_bytes)?;
    if !moments.is_still() && numbers.len() > 1 && numbered(&options.output, 0).is_none() {
        return Err(one_file(&options.output));
    }
    let preparation = Preparation::new(options, &rest)?;
    let chosen = OnceLock::new();
    let choose = |_: &PackedScene| match chosen.get() {
        Some(chosen) => Ok(Clone::clone(chosen)),
        None => {
            let found = preparation.choose(&rest, &PackedScene::new(&rest)?)?;
            Ok(chosen.get_or_init(|| found).clone())
        }
    };
    let mut last: Option<(PathBuf, PreparedScene)> = None;
    for &number in numbers {
        moments.move_to(number)?;
        if last.as_mut().is_some_and(|(_, prepared)| prepared.add_frame(number, moments.scene())) {
            continue;
        }
        if let Some((path, prepared)) = last.take() {
            preparation.write(&prepared, &path)?;
        }
        let mut prepared = preparation.of(moments.scene(), &choose)?;
        prepared.add_frame(number, moments.scene());
        last = Some((path(number), prepared));
    }
    last.map_or(Ok(()), |(path, prepared)| preparation.write(&prepared, &path))
}

fn check(options: &PrepareOptions, output: &Path) -> Result<(), Failure> {
    outputs::check(&input::files(&options.scene), &[output], &[])
}

fn one_file(output: &Path) -> Failure {
    let text = format!("{} is one file, and meshes or lights move from frame to frame", output.display());
    let help = "put a run of # into its name, such as scene.####.card: frames have files of their own";
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

/// Options, settings and progress that all files of a preparation share.
struct Preparation<'a> {
    options: &'a PrepareOptions,
    settings: RenderSettings,
    progress: Progress,
    /// Message about the settings that the quality has chosen.
    said: OnceLock<String>,
}

impl<'a> Preparation<'a> {
    /// Starts the preparation for pictures of `scene`.
    fn new(options: &'a PrepareOptions, scene: &Scene) -> Result<Self, Failure> {
        let mut settings = options.settings();
        settings.picture.light_groups = scene.light_groups.names().to_vec();
        let camera = settings.camera(scene)?;
        options.picture.fit(&camera, &mut settings.picture);
        let uses = Uses::of(&options.scene, &settings.picture, Some(&options.frames));
        notices::say_ignored(&options.scene, scene, &uses)?;
        if !options.host.quiet {
            notices::say_remarks(&options.scene.path, scene);
        }
        let progress = Progress::start(&options.host, 1, Phase::Photons)?;
        Ok(Self { options, settings, progress, said: OnceLock::new() })
    }

    /// Runs a pilot render of `scene` to choose the settings of photons and integrator that no option states.
    fn choose(&self, scene: &Scene, packed: &PackedScene) -> Chosen {
        let Self { options, settings, progress, said } = self;
        let stated = options.stated();
        let fit = if stated.needs_fit() {
            options.quality.fit((options.finish(), None), (scene, packed), settings, progress)?
        } else {
            None
        };
        let chosen = settings.clone().with(|settings| {
            if let Some(fit) = &fit {
                fit.apply(settings, stated);
            }
        });
        let by = messages::by_quality(options.quality);
        let _ = said.set(format!("{by}: {}", messages::chosen(&chosen, false)));
        Ok((chosen.photons, chosen.integrator))
    }

    fn of(
        &self,
        scene: &Scene,
        choose: &(dyn Fn(&PackedScene) -> Chosen + Sync),
    ) -> Result<PreparedScene, Failure> {
        let Self { options, settings, progress, .. } = self;
        let (budgets, notes) = ([options.budget()], notes(options));
        let prepared = on_threads(options.host.threads, || {
            PreparedScene::new(scene, settings, &budgets, &choose, notes, progress)
        })?;
        progress.finish();
        Ok(prepared?)
    }

    fn write(&self, prepared: &PreparedScene, path: &Path) -> Result<(), Failure> {
        prepared.write(path).map_err(Failure::work)?;
        if !self.options.host.quiet {
            self.said.get().iter().for_each(|chosen| say(format_args!("photoncard: {chosen}")));
            let (path, bytes) = (path.display(), prepared.image_bytes());
            let frames = match prepared.frames().count() {
                0 => String::new(),
                1 => ", of a frame".to_owned(),
                count => format!(", of {count} frames"),
            };
            say(format_args!("photoncard: {path}: a card image of {bytes} bytes{frames}"));
        }
        Ok(())
    }
}

/// Metadata of a prepared scene for later renders: the quality, whether pictures will be denoised, and the
/// inputs with the settings that all frames share.
fn notes(options: &PrepareOptions) -> Map<String, Value> {
    let mut inputs = input::provenance(&options.scene);
    if options.frames.numbers().is_some() {
        inputs.extend(options.frames.shared_provenance());
    }
    let notes = [
        ("quality", json!(options.quality.name())),
        ("denoise", json!(options.finish() == Finish::Denoised)),
        ("inputs", Value::Object(inputs)),
    ];
    notes.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}
