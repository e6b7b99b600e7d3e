//! Command `photoncard bake`.

mod files;

use std::path::Path;

use glam::Vec3;
use miette::{MietteDiagnostic, Report};
use photoncard_driver::render::bake::part::{self, Light, Whole};
use photoncard_driver::render::bake::{BakeError, Baked, Page, Plan};
use photoncard_driver::render::measure::{Meter, Reading};
use photoncard_driver::render::{Phase, RenderSettings};
use photoncard_driver::scene::Scene;

use self::files::Files;
use crate::arguments::{BakeOptions, Engine};
use crate::console::say;
use crate::failure::Failure;
use crate::farm;
use crate::picture_files::denoiser;
use crate::progress::Progress;
use crate::render::{dram_bytes, on_threads, without_view};
use crate::{input, outputs};

/// Bakes lightmaps, or measures a part of them.
pub(crate) fn run(options: &BakeOptions) -> Result<(), Failure> {
    let settings = options.settings();
    check(options, &settings)?;
    if let Some(engine) = options.job.farm {
        return job(options, engine);
    }
    let scene = input::load_for_lightmaps(&options.scene, dram_bytes(&settings))?;
    let (scene, settings) = without_view(&options.scene, &options.host, (scene, settings))?;
    on_threads(options.host.threads, || bake(options, &scene, &settings))?
        .map_err(|failure| failure.stopped_as("stopped; no lightmap was written"))
}

/// Prints the job that bakes on a farm, in parts.
fn job(options: &BakeOptions, engine: Engine) -> Result<(), Failure> {
    let inputs: Vec<&Path> = input::files(&options.scene).into_iter().map(|(path, _)| path).collect();
    let merge = farm::Merge::Command { not_in_parts: &["exr", "rgbm", "denoise"] };
    let work = farm::Work { command: "bake", inputs: &inputs, output: &options.output, merge };
    farm::print(engine, &work, options.job.parts)
}

fn check(options: &BakeOptions, settings: &RenderSettings) -> Result<(), Failure> {
    let is =
        |ending: &str| options.output.extension().is_some_and(|other| other.eq_ignore_ascii_case(ending));
    let wanted = if options.part.is_some() { "part" } else { "glb" };
    if !is(wanted) {
        let text = format!("{} does not end in .{wanted}", options.output.display());
        let help = match options.part {
            Some(_) => "a bake of a part by --part writes its light: name the file OUT.part",
            None => "name the file OUT.glb; --part K/N writes the light of a part, OUT.part",
        };
        return Err(Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help))));
    }
    // A missing denoiser is an error before the work.
    denoiser(options.files.denoise)?;
    let mut inputs = input::files(&options.scene);
    inputs.extend(options.merge.iter().map(|path| (path.as_path(), "a part")));
    outputs::check(&inputs, &[&options.output], &[])?;
    Ok(settings.check()?)
}

fn bake(options: &BakeOptions, scene: &Scene, settings: &RenderSettings) -> Result<(), Failure> {
    let plan = Plan::new(scene, &options.bake()).map_err(failure)?;
    let whole = plan.whole(scene, settings);
    if !options.host.quiet {
        describe(options, &plan, &whole);
    }
    let files = Files::new(options, plan.atlas().pages)?;
    if let Some(part) = options.part {
        let light = measured(options, &plan, (scene, settings), part.range(whole.sensors.into()))?;
        return part::write(&options.output, part, &whole, &light).map_err(failure);
    }
    let light = if options.merge.is_empty() {
        measured(options, &plan, (scene, settings), [0, whole.sensors.into()])?
    } else {
        part::read(&options.merge, &whole).map_err(failure)?
    };
    let irradiance = denoised(options, Baked::irradiance(&plan, &light))?;
    files.write(&plan, &Baked::of(&plan, irradiance)).map_err(failure)
}

/// Pages of irradiance, without noise if that is asked for.
fn denoised(options: &BakeOptions, mut pages: Vec<Page>) -> Result<Vec<Page>, Failure> {
    let Some(denoiser) = denoiser(options.files.denoise)? else { return Ok(pages) };
    for page in &mut pages {
        let values: Vec<[f32; 3]> = page.values.iter().map(Vec3::to_array).collect();
        let values = denoiser.lightmap([page.size; 2], &values, options.host.threads, &|| false);
        page.values =
            values.map_err(|error| Failure::work_error(&error))?.into_iter().map(Vec3::from).collect();
    }
    Ok(pages)
}

/// Prints density, pages and sensors.
fn describe(options: &BakeOptions, plan: &Plan, whole: &Whole) {
    let atlas = plan.atlas();
    let pages = if atlas.pages == 1 { "page" } else { "pages" };
    let (path, side) = (options.scene.path.display(), atlas.size);
    say(format_args!(
        "photoncard: {path}: {} texels per metre, {} texels on {} {pages} of {side} x {side}, {} sensors; {} objects \
         keep the layout of their file",
        atlas.density,
        plan.texels().len(),
        atlas.pages,
        whole.sensors,
        atlas.stated
    ));
}

/// Measures the sensors of a range.
fn measured(
    options: &BakeOptions,
    plan: &Plan,
    (scene, settings): (&Scene, &RenderSettings),
    [first, end]: [u64; 2],
) -> Result<Vec<Light>, Failure> {
    let progress = Progress::start(&options.host, settings.cards.count(), Phase::Tiles)?;
    let mut meter = Meter::new(scene, settings, [0.0; 3]);
    let points = plan.points();
    let own = points.get(first as usize..end as usize).unwrap_or_default();
    let readings = meter.measure(first as u32, own, &progress)?;
    progress.finish();
    Ok(readings.iter().map(Reading::irradiance).collect())
}

/// Failure of a bake: of the arguments, or of the work.
fn failure(error: BakeError) -> Failure {
    match error {
        BakeError::Render(error) => error.into(),
        BakeError::Encode { .. } | BakeError::Image(_) | BakeError::Output(_) => Failure::work(error),
        error => Failure::input(error),
    }
}
