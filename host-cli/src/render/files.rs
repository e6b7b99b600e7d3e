//! Output files of a render.

use std::io::IsTerminal;
use std::path::Path;
use std::time::Instant;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::output;
use photoncard_driver::partial::PartialError;
use photoncard_driver::parts::PartHead;
use photoncard_driver::render::Rendering;

use super::part;
use crate::arguments::{OutputOptions, PictureOutput, ProgressForm, RenderOptions, TextOutput, numbered};
use crate::console::{print_json, printable_json, say};
use crate::failure::Failure;
use crate::input;
use crate::picture_files::{Form, denoised, denoised_by, denoiser, write_picture};

/// Checks that all files can be written, that none is an input or another output, and that no file with
/// finished tiles of an earlier render is overwritten.
pub(super) fn check(options: &RenderOptions, outputs: &OutputOptions) -> Result<(), Failure> {
    part::check(options.parts.part, &outputs.pictures)?;
    let texts =
        [outputs.stats == Some(TextOutput::StandardOutput), options.host.progress == ProgressForm::Openjd];
    check_standard_output(&outputs.pictures, outputs.pipes_tiles(), &texts)?;
    check_kept(options, outputs)?;
    let mut written: Vec<&Path> = outputs.pictures.iter().filter_map(PictureOutput::file).collect();
    written.extend(outputs.stats.as_ref().and_then(TextOutput::path));
    written.extend(options.cards.trace.as_deref());
    // A missing denoiser is an error before the work.
    denoiser(denoises(options, outputs))?;
    crate::outputs::check(&input::files(&options.scene), &written, &[&outputs.partial_path()])?;
    match options.tile_outputs(outputs).partial.map_or(Ok(()), |partial| partial.check_free()) {
        // Other faults of the partial file are reported at its frame, after the frames before are written.
        Err(error @ PartialError::Unfinished { .. }) => Err(Failure::input(error)),
        _ => Ok(()),
    }
}

/// Checks that a picture on standard output, or tiles if `has_tiles`, are the only output there, and that
/// they do not go to a terminal. `texts` says which texts go there.
pub(crate) fn check_standard_output(
    pictures: &[PictureOutput],
    has_tiles: bool,
    texts: &[bool],
) -> Result<(), Failure> {
    let pictures = pictures.iter().filter(|picture| picture.file().is_none()).count();
    let binary = pictures + usize::from(has_tiles);
    let texts = texts.iter().filter(|is_there| **is_there).count();
    let [text, help] = if binary > 0 && binary + texts > 1 {
        ["standard output takes one output alone", "give the other ones files"]
    } else if binary > 0 && std::io::stdout().is_terminal() {
        ["a picture is not written to a terminal", "direct it to a file or a pipe, such as: -o - | feh -"]
    } else {
        return Ok(());
    };
    Err(Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help))))
}

/// Checks that the picture is a file if `--resume` or `--keep-samples` is given: finished tiles are kept
/// beside it.
fn check_kept(options: &RenderOptions, outputs: &OutputOptions) -> Result<(), Failure> {
    let is_piped = outputs.main().is_some_and(|picture| picture.file().is_none());
    if !is_piped || !(outputs.resume || options.samples.keep_samples) {
        return Ok(());
    }
    let text = "finished tiles are kept beside a file, and the picture goes to standard output";
    let help = "name the picture by -o OUT.png or -o OUT.exr, or leave out --resume and --keep-samples";
    Err(Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help))))
}

/// Returns the outputs if no picture is stated: a PNG beside the scene file. `None` if a picture is stated or
/// a part is rendered. An existing file of the PNG's name is an error unless photoncard wrote it.
pub(super) fn beside_scene(options: &RenderOptions) -> Result<Option<OutputOptions>, Failure> {
    let has_frames = options.frames.numbers().is_some();
    let outputs = options.outputs.beside(&options.scene.path, has_frames);
    let Some(outputs) = outputs.filter(|_| options.parts.part.is_none()) else { return Ok(None) };
    let path = outputs.pictures.first().map_or(Path::new(""), |picture| &picture.path);
    let numbers = options.frames.numbers().into_iter().flatten();
    let of_frames = numbers.filter_map(|number| numbered(path, number));
    crate::outputs::check_foreign(of_frames.chain((!has_frames).then(|| path.to_owned())))?;
    if !options.host.quiet {
        say(format_args!("photoncard: without -o the picture is written to {}", path.display()));
    }
    Ok(Some(outputs))
}

/// Writes pictures and statistics. The time of the denoiser is added to the statistics.
pub(super) fn write(
    options: &RenderOptions,
    outputs: &OutputOptions,
    rendering: &mut Rendering,
) -> Result<(), Failure> {
    let denoiser = denoiser(denoises(options, outputs))?;
    let start = Instant::now();
    // If the denoiser fails, the picture is written without the denoised layer.
    let (denoised, failure) =
        match denoised(denoiser, &rendering.film, options.picture.transparent, options.host.threads) {
            Ok(denoised) => (denoised, None),
            Err(failure) => (None, Some(failure)),
        };
    let seconds = denoiser.map_or(0.0, |_| start.elapsed().as_secs_f64());
    rendering.statistics.time_s.denoise = seconds;
    rendering.statistics.time_s.total += seconds;
    let mut settings = rendering.statistics.provenance.pixels.clone();
    settings.extend(denoiser.filter(|_| denoised.is_some()).map(denoised_by));
    let provenance = serde_json::to_string(&settings).map_err(|error| Failure::work_error(&error))?;
    let provenance = printable_json(&provenance);
    let layers = options.picture.layers();
    let head = |part| {
        let settings = rendering.statistics.provenance.pixels.clone();
        let names = rendering.identities.as_deref();
        PartHead::new(part, &rendering.film, settings, &layers, names, part::arguments())
    };
    let form = Form {
        part: options.parts.part.map(head),
        layers: layers.clone(),
        is_transparent: options.picture.transparent,
        identities: rendering.identities.clone(),
        illuminance: rendering.illuminance.take(),
        sample_type: outputs.sample_type(),
        tone: outputs.tone.mapping(),
        denoised,
    };
    for picture in &outputs.pictures {
        write_picture(picture, &rendering.film, &provenance, &form)?;
    }
    write_statistics(outputs, serde_json::to_string_pretty(&rendering.statistics))?;
    failure.map_or(Ok(()), Err)
}

/// Returns whether the render denoises its pictures. Parts are denoised when they are merged.
pub(super) fn denoises(options: &RenderOptions, outputs: &OutputOptions) -> bool {
    outputs.denoise && options.parts.part.is_none()
}

/// Writes statistics if an output for them is stated.
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
