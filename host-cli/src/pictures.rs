//! Commands `photoncard merge`, `photoncard tonemap` and `photoncard diff`, whose inputs are pictures.

use std::path::Path;
use std::sync::Arc;

use photoncard_driver::difference::compare;
use photoncard_driver::exr::{Shown, read};
use photoncard_driver::film::Film;
use photoncard_driver::parts::{Part, PartError, Parts};
use photoncard_driver::tone_mapping::{PngError, write_png};

use crate::arguments::{DiffOptions, MergeOptions, PictureFormat, PictureOutput, TonemapOptions};
use crate::console::{counted, print_json, printable_json, say};
use crate::failure::Failure;
use crate::outputs;
use crate::render::files::{Form, check_standard_output, denoised, denoised_by, denoiser, write_picture};
use crate::render::{part, video};

/// Maximum number of missing parts whose commands are printed.
const MAX_COMMANDS: usize = 100;

/// Merges the parts of a picture and writes it.
pub(crate) fn merge(options: &MergeOptions) -> Result<(), Failure> {
    let MergeOptions { parts: paths, pictures, sample_type, tone, denoise, progress } = options;
    if pictures.iter().any(|picture| picture.format == PictureFormat::Part) {
        return Err(part::needless());
    }
    if pictures.iter().any(|picture| picture.format == PictureFormat::Video) {
        return Err(video::needless());
    }
    check_standard_output(pictures, None, *progress)?;
    let inputs: Vec<(&Path, &str)> = paths.iter().map(|path| (path.as_path(), "a part")).collect();
    let written: Vec<&Path> = pictures.iter().filter_map(PictureOutput::file).collect();
    outputs::check(&inputs, &written, &[])?;
    let denoiser = denoiser(*denoise)?;
    let parts = Parts::open(paths).map_err(Failure::input)?;
    say_missing(&parts);
    let mut merged = parts.merge().map_err(merge_failure)?;
    merged.provenance.extend(denoiser.map(denoised_by));
    say_dazzling(&merged.film);
    let provenance =
        serde_json::to_string(&merged.provenance).map_err(|error| Failure::work_error(&error))?;
    let form = Form {
        layers: merged.layers,
        is_transparent: merged.is_transparent,
        identities: merged.identities.map(Arc::new),
        sample_type: *sample_type,
        tone: tone.mapping(),
        denoised: denoised(denoiser, &merged.film, merged.is_transparent, None)?,
        part: None,
    };
    for picture in pictures {
        write_picture(picture, &merged.film, &printable_json(&provenance), &form)?;
    }
    Ok(())
}

/// Prints the commands that render the missing parts.
fn say_missing(parts: &Parts) {
    let missing = parts.missing();
    let Some(head) = parts.any() else { return };
    let command = |part: &Part| part::command(head, *part);
    missing.iter().take(MAX_COMMANDS).for_each(|part| say(format_args!("{}", command(part))));
}

/// Prints a warning about pixels far brighter than any surface, which a faulty card may have caused.
fn say_dazzling(film: &Film) {
    let pixels = film.dazzling_pixels();
    if pixels > 0 {
        say(format_args!(
            "photoncard: the light of {} is far beyond that of the surfaces: a lamp without extent that nearly touches a surface makes \
             such light, and so does a faulty card (verified if each part is rendered with a second --card)",
            counted(pixels, "pixel")
        ));
    }
}

/// Failure of a merge: `Work` if memory is short or two files of one part differ, otherwise `Input`.
fn merge_failure(error: PartError) -> Failure {
    match error {
        PartError::Film(_) | PartError::Unequal { .. } => Failure::work(error),
        error => Failure::input(error),
    }
}

/// Tone-maps a picture and writes it.
pub(crate) fn tonemap(options: &TonemapOptions) -> Result<(), Failure> {
    let TonemapOptions { input, output, tone } = options;
    outputs::check(&[(input, "the picture to read")], &[output], &[])?;
    let picture = read(input, Shown::Denoised).map_err(|error| Failure::input_error(&error))?;
    let radiance = picture.pixels.iter().copied();
    let provenance = picture.provenance.as_deref();
    let alpha = picture.alpha.as_deref();
    let written = write_png(output, picture.size(), radiance, alpha, tone.mapping(), provenance);
    written.map_err(|error| match error {
        PngError::NotANumber { .. } => Failure::input_error(&error),
        _ => Failure::work_error(&error),
    })
}

/// Prints the difference between two pictures as JSON.
pub(crate) fn diff(options: &DiffOptions) -> Result<(), Failure> {
    let read = |path| read(path, Shown::Rendered).map_err(|error| Failure::input_error(&error));
    let reference = read(&options.reference)?;
    let image = read(&options.image)?;
    let difference = compare(&reference, &image, options.block, options.exclude_above)
        .map_err(|error| Failure::input_error(&error))?;
    let text = serde_json::to_string_pretty(&difference).map_err(|error| Failure::work_error(&error))?;
    print_json(&text)
}
