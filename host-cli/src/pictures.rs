//! Commands `photoncard merge`, `photoncard mix`, `photoncard tonemap` and `photoncard diff`, whose inputs
//! are pictures.

use std::path::Path;
use std::sync::Arc;

use photoncard_driver::difference::compare;
use photoncard_driver::exr::mix::Mix;
use photoncard_driver::exr::{ExrError, Shown, read};
use photoncard_driver::false_color::FalseColor;
use photoncard_driver::film::Film;
use photoncard_driver::output;
use photoncard_driver::parts::{Part, PartError, Parts};
use photoncard_driver::tone_mapping::{PngError, luminance, png_bytes, write_colours, write_png};
use serde_json::Value;

use crate::arguments::{
    DiffOptions, MergeOptions, MixOptions, PictureFormat, PictureOutput, ProgressForm, TonemapOptions,
};
use crate::console::{counted, print_json, printable_json, say, write_bytes};
use crate::failure::Failure;
use crate::outputs;
use crate::picture_files::{
    Form, denoised, denoised_by, denoiser, needless_part, needless_video, write_picture,
};
use crate::render::files::check_standard_output;
use crate::render::part;

/// Maximum number of missing parts whose commands are printed.
const MAX_COMMANDS: usize = 100;

/// Merges the parts of a picture and writes it.
pub(crate) fn merge(options: &MergeOptions) -> Result<(), Failure> {
    let MergeOptions { parts: paths, pictures, sample_type, tone, denoise, progress } = options;
    if pictures.iter().any(|picture| picture.format == PictureFormat::Part) {
        return Err(needless_part());
    }
    if pictures.iter().any(|picture| picture.format == PictureFormat::Video) {
        return Err(needless_video());
    }
    check_standard_output(pictures, false, &[*progress == ProgressForm::Openjd])?;
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
        illuminance: None,
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

/// Mixes the light groups of a picture and writes it.
pub(crate) fn mix(options: &MixOptions) -> Result<(), Failure> {
    let MixOptions { input, gains, pictures, tone, denoise } = options;
    for (others, needless) in
        [(PictureFormat::Part, needless_part as fn() -> Failure), (PictureFormat::Video, needless_video)]
    {
        if pictures.iter().any(|picture| picture.format == others) {
            return Err(needless());
        }
    }
    check_standard_output(pictures, false, &[])?;
    let written: Vec<&Path> = pictures.iter().filter_map(PictureOutput::file).collect();
    outputs::check(&[(input, "the picture to mix")], &written, &[])?;
    let denoiser = denoiser(*denoise)?;
    let mut mix = Mix::read(input).map_err(|error| Failure::input_error(&error))?;
    mix.apply(gains).map_err(|error| Failure::input_error(&error))?;
    let mut shown = mix.radiance();
    if let Some(denoiser) = denoiser {
        let features = mix.features().map_err(|error| Failure::input_error(&error))?;
        shown = denoiser
            .radiance_of(mix.size(), features.into_iter(), None, &|| false)
            .map_err(|error| Failure::work_error(&error))?;
        // As in a render, pixels without a surface stay black.
        let uncovered = shown.iter_mut().zip(mix.alpha().unwrap_or_default());
        uncovered.filter(|(_, alpha)| *alpha == 0.0).for_each(|(radiance, _)| *radiance = [0.0; 3]);
        mix.set_denoised(&shown, denoised_by(denoiser));
    }
    let (size, alpha, provenance) = (mix.size(), mix.alpha(), mix.provenance());
    let bytes = mix.bytes().map_err(|error| Failure::work_error(&error))?;
    for picture in pictures {
        if picture.format == PictureFormat::Exr {
            output::write(&picture.path, &bytes).map_err(|error| Failure::work_error(&error))?;
            continue;
        }
        let radiance = shown.iter().copied();
        let (alpha, provenance) = (alpha.as_deref(), provenance.as_deref());
        let png = png_bytes(&picture.path, size, radiance, alpha, tone.mapping(), provenance);
        let png = png.map_err(|error| Failure::work_error(&error))?;
        match picture.file() {
            Some(path) => output::write(path, &png).map_err(|error| Failure::work_error(&error))?,
            None => write_bytes(&png)?,
        }
    }
    Ok(())
}

/// Tone-maps a picture and writes it.
pub(crate) fn tonemap(options: &TonemapOptions) -> Result<(), Failure> {
    let TonemapOptions { input, output, tone, false_color, .. } = options;
    outputs::check(&[(input, "the picture to read")], &[output], &[])?;
    if let Some(range) = false_color {
        return in_false_color(options, *range);
    }
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

/// Writes illuminance or luminance in false colours.
fn in_false_color(options: &TonemapOptions, [low, high]: [f32; 2]) -> Result<(), Failure> {
    let TonemapOptions { input, output, lumens_per_watt, .. } = options;
    let (picture, unit, scale) = match read(input, Shown::Illuminance) {
        Ok(picture) => (picture, "lx", None),
        Err(ExrError::NoColour { .. }) => {
            let picture = read(input, Shown::Denoised).map_err(|error| Failure::input_error(&error))?;
            let provenance = picture.provenance.as_deref().unwrap_or_default();
            let settings = serde_json::from_str::<Value>(provenance).unwrap_or_default();
            let unit = match (settings["irradiance"] == Value::Bool(true), lumens_per_watt) {
                (true, None) => "W/m2",
                (true, Some(_)) => "lx",
                (false, _) => "cd/m2",
            };
            (picture, unit, Some(lumens_per_watt.unwrap_or(1.0)))
        }
        Err(error) => return Err(Failure::input_error(&error)),
    };
    let value = |[red, green, blue]: [f32; 3]| match scale {
        Some(lumens) => lumens * luminance([red, green, blue]),
        None => red,
    };
    let values: Vec<f32> = picture.pixels.iter().copied().map(value).collect();
    let colours = FalseColor { low, high, unit }.picture(picture.size()[0], &values);
    write_colours(output, &colours, picture.provenance.as_deref())
        .map_err(|error| Failure::work_error(&error))
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
