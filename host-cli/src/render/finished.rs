//! Recognises frames that need not be rendered: their files are complete, with the provenance that a render
//! would write.

use std::path::Path;

use photoncard_driver::parts::Parts;
use photoncard_driver::render::{NamedSettings, RenderSettings};
use photoncard_driver::scene::Scene;
use photoncard_driver::{exr, tone_mapping};
use serde_json::Value;

use super::{files, messages};
use crate::arguments::{OutputOptions, PictureFormat, PictureOutput, RenderOptions, TextOutput};
use crate::picture_files::{denoised_by, denoiser};

/// Setting that a render computes, and then writes into the provenance.
const FOUND: &str = "view";

/// Returns whether `--resume` is given and all files of this frame exist.
pub(super) fn may_be(outputs: &OutputOptions) -> bool {
    let stats = outputs.stats.as_ref().and_then(TextOutput::path);
    let mut files = outputs.pictures.iter().map(|picture| &*picture.path).chain(stats);
    outputs.resumes() && files.all(Path::is_file)
}

/// Returns whether all files of a frame are complete, and its pictures have these settings and `inputs` in
/// their provenance. Prints the name of a damaged file.
pub(super) fn is_finished(
    options: &RenderOptions,
    outputs: &OutputOptions,
    settings: &RenderSettings,
    scene: &Scene,
    inputs: &NamedSettings,
) -> bool {
    if !may_be(outputs) {
        return false;
    }
    let mut stated = settings.identity(scene);
    stated.extend(settings.picture.of_layers());
    stated.extend(inputs.clone());
    match denoiser(files::denoises(options, outputs)) {
        Ok(denoiser) => stated.extend(denoiser.map(denoised_by)),
        Err(_) => return false,
    }
    let without_found = |mut settings: NamedSettings| {
        settings.remove(FOUND);
        // A distance that is not stated is null, and `auto` with the value in use in the provenance.
        for value in settings.values_mut().filter(|value| value.get("auto").is_some()) {
            *value = Value::Null;
        }
        // Settings are compared as text, in which a number has the form that it has in a file.
        serde_json::to_string(&settings).ok()
    };
    let expected = without_found(stated);
    let of_picture = |picture| without_found(provenance(options, outputs, picture)?);
    if expected.is_none() || outputs.pictures.iter().any(|picture| of_picture(picture) != expected) {
        return false;
    }
    damaged(outputs).inspect(|path| messages::say_damaged(path)).is_none()
}

/// First file of a frame that is damaged; `None` if all are complete.
fn damaged(outputs: &OutputOptions) -> Option<&Path> {
    let is_intact = |PictureOutput { path, format }: &PictureOutput| match format {
        PictureFormat::Exr => exr::is_intact(path),
        PictureFormat::Png => tone_mapping::is_intact(path),
        // A video has many frames: it is no file of this one.
        PictureFormat::Video => false,
        PictureFormat::Part => {
            Parts::open(std::slice::from_ref(path)).is_ok_and(|part| part.check_pixels().is_ok())
        }
    };
    let is_json =
        |path: &Path| std::fs::read(path).is_ok_and(|text| serde_json::from_slice::<Value>(&text).is_ok());
    let stats = outputs.stats.as_ref().and_then(TextOutput::path).filter(|path| !is_json(path));
    outputs.pictures.iter().find(|picture| !is_intact(picture)).map(|picture| &*picture.path).or(stats)
}

/// Provenance of an existing picture; `None` if its sample type, tone mapping or part differs from that of
/// `outputs` and `options`.
fn provenance(
    options: &RenderOptions,
    outputs: &OutputOptions,
    picture: &PictureOutput,
) -> Option<NamedSettings> {
    let PictureOutput { path, format } = picture;
    let text = match format {
        PictureFormat::Exr => {
            let (text, samples) = exr::read_form(path)?;
            (samples == outputs.sample_type()).then_some(text)?
        }
        PictureFormat::Png => tone_mapping::read_form(path, outputs.tone.mapping())?,
        PictureFormat::Video => return None,
        PictureFormat::Part => {
            let parts = Parts::open(std::slice::from_ref(path)).ok()?;
            let head = parts.any().filter(|head| Some(head.part) == options.parts.part)?;
            return Some(head.settings.clone());
        }
    };
    serde_json::from_str(&text).ok()
}
