//! Pictures as files: radiance as EXR, tone-mapped as PNG, denoised if requested.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use miette::{MietteDiagnostic, Report};
use photoncard_driver::cryptomatte::Identities;
use photoncard_driver::denoise::Denoiser;
use photoncard_driver::exr::{self, Content, SampleFormat};
use photoncard_driver::film::Film;
use photoncard_driver::layer::Layers;
use photoncard_driver::output;
use photoncard_driver::parts::{self, PartHead};
use photoncard_driver::tone_mapping::{ToneMapping, png_bytes};
use serde_json::Value;

use crate::arguments::{PictureFormat, PictureOutput};
use crate::console::write_bytes;
use crate::failure::Failure;

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
        PictureFormat::Video => Err(needless_video()),
        PictureFormat::Part => {
            let head = form.part.as_ref().ok_or_else(needless_part)?;
            parts::write(path, head, film).map_err(Failure::work)
        }
    }
}

/// Error of a part file as the output of a command that renders no part.
pub(crate) fn needless_part() -> Failure {
    refusal(
        "a file OUT.part is a part of a picture",
        "give --part K/N to photoncard render, or -o a name that ends in .exr or .png",
    )
}

/// Error of a video as the output of a command without frames.
pub(crate) fn needless_video() -> Failure {
    refusal(
        "a video is of frames that photoncard render makes",
        "give photoncard render --frames A-B, or -o a name that ends in .exr or .png",
    )
}

fn refusal(text: &str, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}
