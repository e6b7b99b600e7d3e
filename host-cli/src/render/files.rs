//! Output files of a render.

use std::io::IsTerminal;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::cryptomatte::Identities;
use photoncard_driver::denoise::Denoiser;
use photoncard_driver::exr::{self, Content, SampleFormat};
use photoncard_driver::film::Film;
use photoncard_driver::layer::Layers;
use photoncard_driver::output;
use photoncard_driver::partial::PartialError;
use photoncard_driver::parts::{self, PartHead};
use photoncard_driver::render::Rendering;
use photoncard_driver::tone_mapping::{ToneMapping, png_bytes};
use serde_json::Value;

use super::{part, video};
use crate::arguments::{
    OutputOptions, PictureFormat, PictureOutput, ProgressForm, RenderOptions, TextOutput, numbered,
};
use crate::console::{print_json, printable_json, say, write_bytes};
use crate::failure::Failure;
use crate::input;

/// Checks that all files can be written, that none is an input or another output, and that no file with
/// finished tiles of an earlier render is overwritten.
pub(super) fn check(options: &RenderOptions, outputs: &OutputOptions) -> Result<(), Failure> {
    part::check(options.parts.part, &outputs.pictures)?;
    let texts = [outputs.stats == Some(TextOutput::StandardOutput), options.progress == ProgressForm::Openjd];
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
    if !options.quiet {
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
        match denoised(denoiser, &rendering.film, options.picture.transparent, options.threads) {
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

/// Returns the denoiser if `is_asked`, else `None`. Open Image Denoise is loaded once per process.
pub(crate) fn denoiser(is_asked: bool) -> Result<Option<&'static Denoiser>, Failure> {
    static FOUND: OnceLock<Denoiser> = OnceLock::new();
    if !is_asked {
        return Ok(None);
    }
    if FOUND.get().is_none() {
        let _ = FOUND.set(Denoiser::find().map_err(|error| Failure::input_error(&error))?);
    }
    Ok(FOUND.get())
}

/// Entry of a picture's provenance for the denoiser: the name `denoise` and the denoiser's version.
pub(crate) fn denoised_by(denoiser: &Denoiser) -> (String, Value) {
    ("denoise".to_owned(), Value::from(denoiser.version()))
}

/// Denoised radiance of a film, if there is a denoiser. In a transparent picture, pixels without a surface
/// stay black.
pub(crate) fn denoised(
    denoiser: Option<&Denoiser>,
    film: &Film,
    is_transparent: bool,
    threads: Option<usize>,
) -> Result<Option<Vec<[f32; 3]>>, Failure> {
    let radiance = denoiser.map(|denoiser| denoiser.radiance(film, threads, &|| false)).transpose();
    let mut radiance = radiance.map_err(|error| Failure::work_error(&error))?;
    if is_transparent && let Some(radiance) = &mut radiance {
        let uncovered = film.all().zip(radiance).filter(|(pixel, _)| pixel.alpha == 0.0);
        uncovered.for_each(|(_, radiance)| *radiance = [0.0; 3]);
    }
    Ok(radiance)
}

/// Data that a picture's file has besides the film. Each format uses some of them.
pub(crate) struct Form {
    /// Layers of an EXR.
    pub(crate) layers: Layers,
    /// True if the files have alpha.
    pub(crate) is_transparent: bool,
    /// Names for the mattes of an EXR; `None` without mattes.
    pub(crate) identities: Option<Arc<Identities>>,
    /// Illuminance for an EXR, lx; `None` without that layer.
    pub(crate) illuminance: Option<Vec<f32>>,
    /// Type of an EXR's samples.
    pub(crate) sample_type: SampleFormat,
    /// Tone mapping of a PNG.
    pub(crate) tone: ToneMapping,
    /// Denoised radiance: a layer of an EXR, and what a PNG shows.
    pub(crate) denoised: Option<Vec<[f32; 3]>>,
    /// Header of a file with one part of a picture; `None` for a whole picture.
    pub(crate) part: Option<PartHead>,
}

impl Form {
    /// Contents of an EXR of `film`.
    pub(crate) fn content<'a>(&'a self, film: &'a Film) -> Content<'a> {
        let Self { layers, is_transparent, identities, illuminance, denoised, .. } = self;
        Content {
            film,
            layers,
            denoised: denoised.as_deref(),
            is_transparent: *is_transparent,
            identities: identities.as_deref(),
            illuminance: illuminance.as_deref(),
        }
    }
}

/// Encodes an EXR or a PNG with its provenance. `path` is the file's name in errors.
pub(crate) fn picture_bytes(
    path: &Path,
    format: PictureFormat,
    film: &Film,
    provenance: &str,
    form: &Form,
) -> Result<Vec<u8>, Failure> {
    if format == PictureFormat::Exr {
        let bytes = exr::bytes(path, &form.content(film), provenance, form.sample_type);
        return bytes.map_err(|error| Failure::work_error(&error));
    }
    let size = [film.window().width(), film.window().height()];
    let denoised = form.denoised.as_deref();
    let radiance = film.pixels().enumerate().map(|(index, pixel)| {
        denoised.and_then(|denoised| denoised.get(index)).copied().unwrap_or(pixel.radiance)
    });
    let alpha = form.is_transparent.then(|| film.all().map(|pixel| pixel.alpha).collect::<Vec<_>>());
    let bytes = png_bytes(path, size, radiance, alpha.as_deref(), form.tone, Some(provenance));
    bytes.map_err(|error| Failure::work_error(&error))
}

/// Writes a picture with its provenance. If it fails, an existing file stays unchanged.
pub(crate) fn write_picture(
    picture: &PictureOutput,
    film: &Film,
    provenance: &str,
    form: &Form,
) -> Result<(), Failure> {
    let PictureOutput { path, format } = picture;
    match format {
        PictureFormat::Exr | PictureFormat::Png => {
            let bytes = picture_bytes(path, *format, film, provenance, form)?;
            match picture.file() {
                None => write_bytes(&bytes),
                Some(path) => output::write(path, &bytes).map_err(|error| Failure::work_error(&error)),
            }
        }
        PictureFormat::Video => Err(video::needless()),
        PictureFormat::Part => {
            let head = form.part.as_ref().ok_or_else(part::needless)?;
            parts::write(path, head, film).map_err(Failure::work)
        }
    }
}
