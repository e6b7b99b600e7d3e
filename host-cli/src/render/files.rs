//! Output files of a render.

use std::path::Path;

use photoncard_driver::exr::{self, SampleFormat};
use photoncard_driver::film::Film;
use photoncard_driver::layer::Layers;
use photoncard_driver::output;
use photoncard_driver::partial::PartialError;
use photoncard_driver::parts::{self, PartHead};
use photoncard_driver::render::Rendering;
use photoncard_driver::tone_mapping::{ToneMapping, write_png};

use super::part;
use crate::arguments::{OutputOptions, PictureFormat, PictureOutput, RenderOptions, TextOutput};
use crate::console::{print_json, printable_json};
use crate::failure::Failure;
use crate::input;

/// Checks that all files can be written, that none replaces the scene, the environment or another one, and
/// that no finished tiles are lost.
pub(super) fn check(options: &RenderOptions, outputs: &OutputOptions) -> Result<(), Failure> {
    part::check(options.parts.part, &outputs.pictures)?;
    let mut written: Vec<&Path> = outputs.pictures.iter().map(|picture| &*picture.path).collect();
    written.extend(outputs.stats.as_ref().and_then(TextOutput::path));
    written.extend(options.cards.trace.as_deref());
    crate::outputs::check(&input::files(&options.scene), &written, &[&outputs.partial_path()])?;
    match options.tile_outputs(outputs).partial.map_or(Ok(()), |partial| partial.check_free()) {
        // Any other fault of the file of a frame is told when it is rendered: the frames before are written.
        Err(error @ PartialError::Unfinished { .. }) => Err(Failure::input(error)),
        _ => Ok(()),
    }
}

/// Writes pictures and statistics.
pub(super) fn write(
    options: &RenderOptions,
    outputs: &OutputOptions,
    rendering: &Rendering,
) -> Result<(), Failure> {
    let provenance = serde_json::to_string(&rendering.statistics.provenance.pixels);
    let provenance = printable_json(&provenance.map_err(|error| Failure::work_error(&error))?);
    let layers = options.picture.layers();
    let head = |part| {
        let settings = rendering.statistics.provenance.pixels.clone();
        PartHead::new(part, &rendering.film, settings, &layers, part::arguments())
    };
    let form = Form {
        part: options.parts.part.map(head),
        layers: layers.clone(),
        sample_type: outputs.sample_type(),
        tone: outputs.tone.mapping(),
    };
    for picture in &outputs.pictures {
        write_picture(picture, &rendering.film, &provenance, &form)?;
    }
    write_statistics(outputs, serde_json::to_string_pretty(&rendering.statistics))
}

/// Writes statistics, if the outputs have a place for them.
pub(super) fn write_statistics(
    outputs: &OutputOptions,
    text: serde_json::Result<String>,
) -> Result<(), Failure> {
    let Some(stats) = &outputs.stats else { return Ok(()) };
    let text = text.map_err(|error| Failure::work_error(&error))?;
    match stats {
        TextOutput::StandardOutput => print_json(&text),
        TextOutput::File(path) => output::write(path, (printable_json(&text) + "\n").as_bytes())
            .map_err(|error| Failure::work_error(&error)),
    }
}

/// Form of pictures, beside the format of their files.
pub(crate) struct Form {
    /// Layers of an EXR.
    pub(crate) layers: Layers,
    /// Type of an EXR's samples.
    pub(crate) sample_type: SampleFormat,
    /// Tone mapping of a PNG.
    pub(crate) tone: ToneMapping,
    /// Head of a part; `None` for a whole picture.
    pub(crate) part: Option<PartHead>,
}

/// Writes a picture with its provenance, whole or not at all.
pub(crate) fn write_picture(
    picture: &PictureOutput,
    film: &Film,
    provenance: &str,
    form: &Form,
) -> Result<(), Failure> {
    let PictureOutput { path, format } = picture;
    match format {
        PictureFormat::Exr => exr::write(path, film, &form.layers, provenance, form.sample_type)
            .map_err(|error| Failure::work_error(&error)),
        PictureFormat::Png => {
            let size = [film.window().width(), film.window().height()];
            let radiance = film.pixels().map(|pixel| pixel.radiance);
            write_png(path, size, radiance, form.tone, Some(provenance))
                .map_err(|error| Failure::work_error(&error))
        }
        PictureFormat::Part => {
            let head = form.part.as_ref().ok_or_else(part::needless)?;
            parts::write(path, head, film).map_err(Failure::work)
        }
    }
}
