//! Command `photoncard tonemap`.

use photoncard_driver::exr::read_with_provenance;
use photoncard_driver::tone_mapping::{PngError, write_png};

use crate::arguments::TonemapOptions;
use crate::failure::Failure;
use crate::outputs;

/// Tone-maps a picture and writes it.
pub(crate) fn run(options: &TonemapOptions) -> Result<(), Failure> {
    let TonemapOptions { input, output, tone } = options;
    outputs::check(&[(input, "the picture to read")], &[output], &[])?;
    let (picture, provenance) = read_with_provenance(input).map_err(|error| Failure::input_error(&error))?;
    let radiance = picture.pixels.iter().copied();
    let written = write_png(output, picture.size(), radiance, tone.mapping(), provenance.as_deref());
    written.map_err(|error| match error {
        PngError::NotANumber { .. } => Failure::input_error(&error),
        _ => Failure::work_error(&error),
    })
}
