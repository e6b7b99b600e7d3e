//! A picture to look at: PNG, 8 bits a channel, tone-mapped to sRGB.
//!
//! Radiance is scaled by `2^exposure`, or without an exposure so that the log-average luminance of the lit pixels
//! becomes 0.18, middle grey. Luminance is then compressed by Reinhard's extended curve
//! `L (1 + L / w^2) / (1 + L)` with the white point `w = 4`, the colour scaled along with it and clipped to 1, and
//! encoded with the sRGB transfer curve (Reinhard et al., "Photographic Tone Reproduction for Digital Images", 2002).
//! The picture is the film's crop window alone.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::film::Film;
use crate::output::{self, OutputError};

/// Luminance, once scaled, that becomes white.
const WHITE: f32 = 4.0;

/// What the log-average luminance becomes when no exposure is stated.
const MIDDLE_GREY: f64 = 0.18;

/// Why a preview cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PreviewError {
    /// The file's place cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The encoder refused the picture.
    #[error("cannot encode {} as PNG", path.display())]
    Encode {
        /// The output file.
        path: PathBuf,
        /// What the encoder says.
        #[source]
        source: png::EncodingError,
    },
    /// An exposure that is not a finite number.
    #[error(
        "an exposure of {exposure} is not possible; state a number of stops, or none for an automatic one"
    )]
    Exposure {
        /// The exposure asked for.
        exposure: f32,
    },
}

/// Writes the film's crop window to `path`, whole or not at all. `exposure` is in stops; `None` chooses one.
///
/// # Errors
/// If the file cannot be written, or the exposure is not finite.
pub fn write_png(path: &Path, film: &Film, exposure: Option<f32>) -> Result<(), PreviewError> {
    let scale = match exposure {
        None => automatic_scale(film),
        Some(stops) if stops.is_finite() => stops.exp2(),
        Some(exposure) => return Err(PreviewError::Exposure { exposure }),
    };
    let window = film.window();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, window.width(), window.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let pixels: Vec<u8> = film.pixels().iter().flat_map(|pixel| tone_map(pixel.radiance, scale)).collect();
    let encoded = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(&pixels)?;
        writer.finish()
    });
    encoded.map_err(|source| PreviewError::Encode { path: path.to_owned(), source })?;
    Ok(output::write(path, &bytes)?)
}

/// Rec. 709 luminance.
fn luminance([red, green, blue]: [f32; 3]) -> f32 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// The factor that brings the log-average luminance of the lit pixels to middle grey; 1 for a black picture.
fn automatic_scale(film: &Film) -> f32 {
    let (mut sum, mut count) = (0.0, 0u64);
    for pixel in film.pixels() {
        let luminance = f64::from(luminance(pixel.radiance));
        if luminance > 0.0 && luminance.is_finite() {
            sum += luminance.ln();
            count += 1;
        }
    }
    if count == 0 { 1.0 } else { (MIDDLE_GREY / (sum / count as f64).exp()) as f32 }
}

fn tone_map(radiance: [f32; 3], scale: f32) -> [u8; 3] {
    // Negative and undefined radiance is shown black, infinite radiance white.
    let scaled = radiance.map(|value| (value * scale).clamp(0.0, f32::MAX.sqrt()));
    let luminance = luminance(scaled);
    let compressed = (1.0 + luminance / (WHITE * WHITE)) / (1.0 + luminance);
    scaled.map(|value| encode(value * compressed))
}

/// The sRGB transfer curve, in 8 bits.
fn encode(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    // A conversion from NaN gives 0.
    (255.0 * encoded + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{PixelValue, Window};

    fn film(radiance: impl Fn(u32, u32) -> f32) -> Film {
        let window = Window { x0: 1, x1: 5, y0: 2, y1: 5 };
        let mut film = Film::new(8, 8, window).unwrap();
        for (x, y) in (2..5).flat_map(|y| (1..5).map(move |x| (x, y))) {
            let radiance = [radiance(x, y); 3];
            film.write(x, y, PixelValue { radiance, ..PixelValue::default() }).unwrap();
        }
        film
    }

    fn decode(path: &Path) -> (u32, u32, Vec<u8>) {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info.width, info.height, pixels)
    }

    #[test]
    fn the_preview_is_the_crop_window_and_grows_with_radiance() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("preview.png");
        write_png(&path, &film(|x, y| (4 * (y - 2) + x - 1) as f32 * 0.3), Some(0.0)).unwrap();
        let (width, height, pixels) = decode(&path);
        assert_eq!((width, height), (4, 3));
        let grey: Vec<u8> = pixels.chunks(3).map(|pixel| pixel[0]).collect();
        assert_eq!(grey[0], 0);
        assert!(grey.is_sorted_by(|a, b| a < b), "{grey:?}");
    }

    #[test]
    fn an_automatic_exposure_does_not_depend_on_the_unit_of_radiance() {
        let folder = tempfile::tempdir().unwrap();
        let paths = [folder.path().join("a.png"), folder.path().join("b.png")];
        for (path, unit) in paths.iter().zip([1.0, 1024.0]) {
            write_png(path, &film(|x, y| unit * (x * y) as f32), None).unwrap();
        }
        assert_eq!(decode(&paths[0]), decode(&paths[1]));
    }

    #[test]
    fn white_is_reached_at_the_white_point_and_odd_values_are_shown() {
        assert_eq!(tone_map([WHITE; 3], 1.0), [255; 3]);
        assert_eq!(tone_map([0.0; 3], 1.0), [0; 3]);
        assert_eq!(tone_map([f32::NAN, -1.0, 0.0], 1.0), [0; 3]);
        assert_eq!(tone_map([f32::INFINITY; 3], 1.0), [255; 3]);
        let black = film(|_, _| 0.0);
        assert_eq!(automatic_scale(&black), 1.0);
        let folder = tempfile::tempdir().unwrap();
        let result = write_png(&folder.path().join("x.png"), &black, Some(f32::NAN));
        assert!(matches!(result, Err(PreviewError::Exposure { .. })));
    }
}
