//! Beginning of a view: its options are checked, and its scene is read.

use miette::{MietteDiagnostic, Report};
use photoncard_driver::denoise::Denoiser;
use photoncard_driver::render::{CardAddress, Picture, RenderSettings};
use photoncard_driver::scene::Scene;

use super::describe::SceneFacts;
use super::request::{MAX_PIXELS, MAX_SIDE, is_size_of_view};
use super::saving::Folder;
use super::state::{Start, View};
use super::wish::{Sketch, Wish};
use crate::arguments::ViewOptions;
use crate::console::say;
use crate::failure::Failure;
use crate::input;
use crate::notices::{self, Uses};
use crate::picture_files::denoiser;

/// State of a view that begins, and what its painter needs.
pub(super) struct Opening {
    pub(super) view: View,
    /// Folder of saved pictures; `None` if pages may save none.
    pub(super) folder: Option<Folder>,
    pub(super) denoiser: Option<&'static Denoiser>,
    pub(super) scene: Scene,
    /// Memory of the largest card, bytes.
    pub(super) dram_bytes: u64,
}

impl Opening {
    /// Checks the options of a view, and reads its scene.
    pub(super) fn new(options: &ViewOptions) -> Result<Self, Failure> {
        let mut settings = options.settings();
        check(&settings)?;
        let folder = options
            .out
            .as_deref()
            .map(|path| Folder::new(path).map_err(|error| Failure::no_folder(path, &error)));
        let folder = folder.transpose()?;
        let denoiser = denoiser(options.denoise)?;
        let dram_bytes =
            settings.cards.addresses.iter().map(CardAddress::dram_bytes).max().unwrap_or(u64::MAX);
        let scene = load(options, dram_bytes, &mut settings)?;
        let start = Start {
            options: options.scene.clone(),
            quality: options.quality,
            finish: options.finish(),
            wish: Wish::new(settings, options.stated(), options.scene.assignments.clone()),
            sketch: Sketch::new(&scene),
            facts: SceneFacts::new(input::name(&options.scene), &scene),
            is_size_stated: options.picture.states_size(),
            out: folder.as_ref().map(|folder| folder.path().display().to_string()),
        };
        Ok(Self { view: View::new(start)?, folder, denoiser, scene, dram_bytes })
    }
}

/// Checks the settings of a view. A crop window or a trace is an error.
fn check(settings: &RenderSettings) -> Result<(), Failure> {
    let [option, reason] = if settings.picture.crop.is_some() {
        ["--crop", "a view shows the whole picture"]
    } else if settings.cards.trace.is_some() {
        ["--trace", "it is of one render, and a view has many"]
    } else {
        settings.check()?;
        return check_size(&settings.picture);
    };
    let report = MietteDiagnostic::new(format!("photoncard view has no {option}: {reason}"));
    Err(Failure::Input(Report::new(report.with_help("leave it out, or use photoncard render"))))
}

/// Checks that a view supports pictures of this size.
fn check_size(&Picture { width, height, .. }: &Picture) -> Result<(), Failure> {
    if is_size_of_view(width.into(), height.into()) {
        return Ok(());
    }
    let report = MietteDiagnostic::new(format!(
        "photoncard view has no --size {width}x{height}: a view shows up to {MAX_SIDE} pixels a side and {MAX_PIXELS} in all"
    ));
    Err(Failure::Input(Report::new(
        report.with_help("give less, such as --size 1024x768, or use photoncard render"),
    )))
}

/// Loads the scene, and gives the picture the camera's aspect ratio. Assignments (`--set`) are not applied.
fn load(options: &ViewOptions, dram_bytes: u64, settings: &mut RenderSettings) -> Result<Scene, Failure> {
    let scene = input::load_with_groups(&options.scene, dram_bytes)?;
    settings.picture.light_groups = scene.light_groups.names().to_vec();
    let camera = settings.camera(&scene)?;
    notices::say_ignored(&options.scene, &scene, &Uses::of(&options.scene, &settings.picture, None))?;
    let misfit = options.picture.fit(&camera, &mut settings.picture);
    if let Some(notice) = misfit.filter(|_| !options.host.quiet) {
        say(format_args!("photoncard: {notice}"));
    }
    Ok(scene)
}
