//! Output files of a render.

use std::path::Path;

use photoncard_driver::choice::Choice;
use photoncard_driver::render::{RenderSettings, Rendering};
use photoncard_driver::scene::Scene;
use photoncard_driver::tone_mapping::write_png;
use photoncard_driver::{exr, output};
use serde_json::{Value, json};

use crate::arguments::{PictureFormat, PictureOutput, RenderOptions, TextOutput};
use crate::console::{print_json, printable_json};
use crate::environment::EnvironmentOption;
use crate::failure::Failure;
use crate::outputs;

/// Checks that all files can be written, and that none replaces the scene, the environment or another one.
pub(super) fn check(options: &RenderOptions) -> Result<(), Failure> {
    let mut inputs = vec![(options.scene.as_path(), "the scene")];
    if let Some(EnvironmentOption::File(path)) = &options.environment {
        inputs.push((path, "the environment"));
    }
    let mut written: Vec<&Path> = options.outputs.pictures.iter().map(|picture| &*picture.path).collect();
    written.extend(options.outputs.stats.as_ref().and_then(TextOutput::path));
    written.extend(options.cards.trace.as_deref());
    outputs::check(&inputs, &written, &[&options.outputs.partial_path()])
}

/// Writes pictures and statistics.
pub(super) fn write(
    options: &RenderOptions,
    settings: &RenderSettings,
    scene: &Scene,
    rendering: &Rendering,
) -> Result<(), Failure> {
    let provenance = printable_json(&provenance(options, settings, scene, rendering).to_string());
    for picture in &options.outputs.pictures {
        write_picture(picture, options, rendering, &provenance)?;
    }
    let Some(stats) = &options.outputs.stats else { return Ok(()) };
    let text = serde_json::to_string_pretty(&rendering.statistics);
    let text = text.map_err(|error| Failure::work_error(&error))?;
    match stats {
        TextOutput::StandardOutput => print_json(&text),
        TextOutput::File(path) => output::write(path, (printable_json(&text) + "\n").as_bytes())
            .map_err(|error| Failure::work_error(&error)),
    }
}

fn write_picture(
    picture: &PictureOutput,
    options: &RenderOptions,
    rendering: &Rendering,
    provenance: &str,
) -> Result<(), Failure> {
    let PictureOutput { path, format } = picture;
    let film = &rendering.film;
    match format {
        PictureFormat::Exr => {
            exr::write(path, film, &options.picture.layers(), provenance, options.outputs.sample_type())
                .map_err(|error| Failure::work_error(&error))
        }
        PictureFormat::Png => {
            let size = [film.window().width(), film.window().height()];
            let radiance = film.pixels().iter().map(|pixel| pixel.radiance);
            write_png(path, size, radiance, options.outputs.tone.mapping())
                .map_err(|error| Failure::work_error(&error))
        }
    }
}

/// The identity of the render, with the names of its inputs: nothing that differs between cards.
fn provenance(
    options: &RenderOptions,
    settings: &RenderSettings,
    scene: &Scene,
    rendering: &Rendering,
) -> Value {
    let mut provenance = settings.identity(scene);
    let mut add = |name: &str, value| provenance.insert(name.to_owned(), value);
    add("scene", json!(options.scene.file_name().map(|name| name.to_string_lossy())));
    add("variant", json!(options.variant));
    add("light-units", json!(options.lights.light_units.name()));
    add("set", json!(options.assignments));
    add("energy-compensation", json!(options.energy_compensation));
    add("environment", json!(options.environment.as_ref().map(EnvironmentOption::name)));
    // The automatic distance, if none is given.
    add("max-distance", json!(rendering.statistics.max_distance));
    provenance.into()
}
