//! Tone mapping of radiance to an sRGB picture in PNG with 8 bits per channel.
//!
//! Radiance is scaled by `2^exposure`. Without an exposure it is scaled so that the log-average luminance of
//! the lit pixels becomes 0.18, middle grey (Reinhard, Stark, Shirley, Ferwerda 2002, *Photographic tone
//! reproduction for digital images*, equations 1 and 2). A [`ToneCurve`] then compresses the scaled radiance,
//! which is clipped to 1 and encoded with the sRGB transfer function. Negative radiance is shown black,
//! infinite radiance white.
//!
//! A picture with alpha has premultiplied radiance. Exposure and curve are applied to the radiance divided by
//! alpha, as in Blender, and the file has these colours and alpha: a PNG is not premultiplied.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::choice::{Choice, choices};
use crate::exr::{PROVENANCE, ascii};
use crate::false_color::ColourPicture;
use crate::foreign;
use crate::intact;
use crate::output::{self, OutputError};

/// Tone curve that compresses scaled radiance to the range of a screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneCurve {
    /// No compression: values above 1 are clipped.
    None,
    /// Reinhard's extended curve of luminance (2002, equation 4), `L (1 + L / w^2) / (1 + L)` with the white
    /// point `w = 4`. The colour is scaled by the same factor as its luminance.
    #[default]
    Reinhard,
    /// Narkowicz' fit of the Academy Color Encoding System's filmic curve, for each channel:
    /// `x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14)` (2016,
    /// <https://knarkowicz.wordpress.com/2016/01/06/aces-filmic-tone-mapping-curve/>). It maps 1 to 0.80. The
    /// Academy's own curve corresponds to this one at 0.6 times the radiance.
    Aces,
}

choices!(ToneCurve {
    None = "none": "No compression: values above 1 are clipped",
    Reinhard = "reinhard": "Reinhard's extended curve of luminance, with the white point 4; it keeps hues",
    Aces = "aces": "Narkowicz' fit of the filmic curve of ACES, for each channel",
});

impl ToneCurve {
    /// Compresses scaled radiance, which must be finite and not negative.
    fn compress(self, scaled: [f32; 3]) -> [f32; 3] {
        match self {
            Self::None => scaled,
            Self::Reinhard => {
                let luminance = luminance(scaled);
                let ratio = (1.0 + luminance / (WHITE * WHITE)) / (1.0 + luminance);
                scaled.map(|value| value * ratio)
            }
            Self::Aces => {
                scaled.map(|value| value * (2.51 * value + 0.03) / (value * (2.43 * value + 0.59) + 0.14))
            }
        }
    }
}

/// Mapping of radiance to a screen: exposure and tone curve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToneMapping {
    /// Exposure in stops: radiance is scaled by `2^exposure`. `None` derives the scale from the log-average
    /// luminance of the picture.
    pub exposure: Option<f32>,
    /// Tone curve.
    pub curve: ToneCurve,
}

impl ToneMapping {
    /// JSON with the exposure in stops, null for the automatic one, and the name of the curve.
    fn to_json(self) -> String {
        serde_json::json!({"exposure": self.exposure, "tonemap": self.curve.name()}).to_string()
    }
}

/// Keyword of the PNG text chunk that contains exposure and tone curve.
pub const TONE_MAPPING: &str = "photoncard-tonemap";

/// White point of Reinhard's curve: the scaled luminance that it maps to 1.
const WHITE: f32 = 4.0;
/// Upper limit to which scaled radiance is clamped. Its square is finite.
const MOST: f32 = 1e18;

/// Log-average luminance after automatic exposure.
const MIDDLE_GREY: f64 = 0.18;

/// Error of writing or encoding a PNG.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PngError {
    /// The file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The encoder refused the picture.
    #[error("cannot encode {} as PNG", path.display())]
    Encode {
        /// Path of the output file.
        path: PathBuf,
        /// The encoder's error.
        #[source]
        source: png::EncodingError,
    },
    /// A pixel's radiance is not a number.
    #[error("pixel ({x}, {y}) of the picture for {} is not a number; repair the picture, or render it again", path.display())]
    NotANumber {
        /// Path of the output file.
        path: PathBuf,
        /// Column of the pixel in the PNG.
        x: usize,
        /// Row of the pixel in the PNG.
        y: usize,
    },
    /// The exposure is not a finite number.
    #[error(
        "an exposure of {exposure} is not possible; state a number of stops, or none for an automatic one"
    )]
    Exposure {
        /// Requested exposure.
        exposure: f32,
    },
}

/// Writes a picture of `width` x `height` pixels of linear radiance to `path` as PNG, whole or not at all.
///
/// With `alpha`, the alpha of each pixel, the radiance is premultiplied and the PNG has an alpha channel.
///
/// The JSON of the picture's provenance is stored in the text chunk [`PROVENANCE`], with characters beyond
/// ASCII as `\u` escapes. The JSON of the mapping is stored in the text chunk [`TONE_MAPPING`].
///
/// # Errors
/// If the file cannot be written, the exposure is not finite, a pixel is NaN, or there are not `width` x
/// `height` pixels.
pub fn write_png(
    path: &Path,
    [width, height]: [u32; 2],
    radiance: impl Iterator<Item = [f32; 3]> + Clone,
    alpha: Option<&[f32]>,
    mapping: ToneMapping,
    provenance_json: Option<&str>,
) -> Result<(), PngError> {
    let bytes = png_bytes(path, [width, height], radiance, alpha, mapping, provenance_json)?;
    Ok(output::write(path, &bytes)?)
}

/// Writes colours as a PNG, whole or not at all, with the JSON of the picture's provenance in the text chunk
/// [`PROVENANCE`].
///
/// # Errors
/// If the file cannot be written.
pub fn write_colours(
    path: &Path,
    picture: &ColourPicture,
    provenance_json: Option<&str>,
) -> Result<(), PngError> {
    let texts = provenance_json.map(|json| (PROVENANCE, ascii(json))).into_iter().collect();
    let encoded = encode_png(picture.size, picture.pixels.as_flattened(), png::ColorType::Rgb, texts);
    let bytes = encoded.map_err(|source| PngError::Encode { path: path.to_owned(), source })?;
    Ok(output::write(path, &bytes)?)
}

/// Encodes the file that [`write_png`] writes. `path` is the file's name in errors.
///
/// # Errors
/// As [`write_png`], except for errors of files.
pub fn png_bytes(
    path: &Path,
    [width, height]: [u32; 2],
    radiance: impl Iterator<Item = [f32; 3]> + Clone,
    alpha: Option<&[f32]>,
    mapping: ToneMapping,
    provenance_json: Option<&str>,
) -> Result<Vec<u8>, PngError> {
    let Some(alpha) = alpha else {
        return encoded(path, [width, height], radiance, None, mapping, provenance_json);
    };
    let straight = radiance.zip(alpha).map(|(pixel, &alpha)| unpremultiplied(pixel, alpha));
    encoded(path, [width, height], straight, Some(alpha), mapping, provenance_json)
}

/// Divides premultiplied radiance by alpha; black where nothing is covered.
fn unpremultiplied(radiance: [f32; 3], alpha: f32) -> [f32; 3] {
    if alpha > 0.0 { radiance.map(|value| value / alpha) } else { [0.0; 3] }
}

/// Encodes radiance that is not premultiplied.
fn encoded(
    path: &Path,
    [width, height]: [u32; 2],
    radiance: impl Iterator<Item = [f32; 3]> + Clone,
    alpha: Option<&[f32]>,
    mapping: ToneMapping,
    provenance_json: Option<&str>,
) -> Result<Vec<u8>, PngError> {
    if let Some(index) = radiance.clone().position(|pixel| pixel.iter().any(|value| value.is_nan())) {
        let [x, y] = [index % width.max(1) as usize, index / width.max(1) as usize];
        return Err(PngError::NotANumber { path: path.to_owned(), x, y });
    }
    let scale = match mapping.exposure {
        None => automatic_scale(radiance.clone()),
        Some(stops) if stops.is_finite() => libm::exp2f(stops),
        Some(exposure) => return Err(PngError::Exposure { exposure }),
    };
    let colours = radiance.map(|pixel| tone_map(pixel, scale, mapping.curve));
    let (pixels, colour): (Vec<u8>, _) = match alpha {
        None => (colours.flatten().collect(), png::ColorType::Rgb),
        Some(alpha) => {
            let with_alpha = |([red, green, blue], alpha): ([u8; 3], &f32)| {
                [red, green, blue, (255.0 * alpha.clamp(0.0, 1.0) + 0.5) as u8]
            };
            (colours.zip(alpha).flat_map(with_alpha).collect(), png::ColorType::Rgba)
        }
    };
    let mut texts = vec![(TONE_MAPPING, mapping.to_json())];
    texts.extend(provenance_json.map(|json| (PROVENANCE, ascii(json))));
    let encoded = encode_png([width, height], &pixels, colour, texts);
    encoded.map_err(|source| PngError::Encode { path: path.to_owned(), source })
}

/// Returns whether a file is a PNG with a provenance of this program.
pub fn is_of_photoncard(path: &Path) -> bool {
    texts(path).is_some_and(|texts| texts.iter().any(|(keyword, _)| keyword == PROVENANCE))
}

/// Reads the provenance of a PNG that was tone-mapped by `mapping`, without decoding pixels; `None` for any
/// other file.
pub fn read_form(path: &Path, mapping: ToneMapping) -> Option<String> {
    let texts = texts(path)?;
    let text = |name: &str| texts.iter().find(|(keyword, _)| keyword == name).map(|(_, text)| text);
    text(PROVENANCE).filter(|_| text(TONE_MAPPING) == Some(&mapping.to_json())).cloned()
}

/// Keywords and texts of the text chunks before the pixels of a PNG; `None` if the file is not a PNG.
fn texts(path: &Path) -> Option<Vec<(String, String)>> {
    let file = BufReader::new(File::open(path).ok()?);
    let reader = foreign::decode(|| png::Decoder::new(file).read_info().map_err(drop), || ()).ok()?;
    let chunks = &reader.info().uncompressed_latin1_text;
    Some(chunks.iter().map(|chunk| (chunk.keyword.clone(), chunk.text.clone())).collect())
}

/// Returns whether a file is a PNG that is neither truncated nor damaged; false if it cannot be read.
pub fn is_intact(path: &Path) -> bool {
    std::fs::read(path).is_ok_and(|bytes| intact::is_intact_png(&bytes))
}

fn encode_png(
    [width, height]: [u32; 2],
    pixels: &[u8],
    colour: png::ColorType,
    texts: Vec<(&str, String)>,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    for (keyword, text) in texts {
        encoder.add_text_chunk(keyword.to_owned(), text)?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

/// Luminance of linear RGB by the weights of Rec. 709.
pub fn luminance([red, green, blue]: [f32; 3]) -> f32 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// Factor that brings the log-average luminance of the lit pixels to middle grey; 1 for a black picture.
fn automatic_scale(radiance: impl Iterator<Item = [f32; 3]>) -> f32 {
    let (mut sum, mut count) = (0.0, 0u64);
    for luminance in radiance.map(|pixel| f64::from(luminance(pixel))) {
        if luminance > 0.0 && luminance.is_finite() {
            sum += libm::log(luminance);
            count += 1;
        }
    }
    if count == 0 { 1.0 } else { (MIDDLE_GREY / libm::exp(sum / count as f64)) as f32 }
}

/// 8-bit sRGB code of a pixel, which must not be NaN.
fn tone_map(radiance: [f32; 3], scale: f32, curve: ToneCurve) -> [u8; 3] {
    let scaled = radiance.map(|value| (value * scale).clamp(0.0, MOST));
    curve.compress(scaled).map(encode)
}

/// Applies the sRGB transfer function, rounded to 8 bits.
fn encode(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded =
        if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::powf(linear, 1.0 / 2.4) - 0.055 };
    (255.0 * encoded + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey radiance of 4 x 3 pixels, row by row.
    fn grey(radiance: impl Fn(u32, u32) -> f32) -> Vec<[f32; 3]> {
        (0..3).flat_map(|y| (0..4).map(move |x| (x, y))).map(|(x, y)| [radiance(x, y); 3]).collect()
    }

    fn decode(path: &Path) -> (u32, u32, Vec<u8>) {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info.width, info.height, pixels)
    }

    fn written(radiance: &[[f32; 3]], exposure: Option<f32>, curve: ToneCurve) -> (u32, u32, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        write_png(&path, [4, 3], radiance.iter().copied(), None, ToneMapping { exposure, curve }, None)
            .unwrap();
        decode(&path)
    }

    #[test]
    fn pixels_are_in_rows_and_grow_with_radiance() {
        let picture = grey(|x, y| (4 * y + x) as f32 * 0.08);
        for curve in [ToneCurve::None, ToneCurve::Reinhard, ToneCurve::Aces] {
            let (width, height, pixels) = written(&picture, Some(0.0), curve);
            assert_eq!((width, height), (4, 3));
            let codes: Vec<u8> = pixels.chunks(3).map(|pixel| pixel[0]).collect();
            assert_eq!(codes[0], 0);
            assert!(codes.is_sorted_by(|a, b| a < b), "{curve:?} {codes:?}");
        }
    }

    #[test]
    fn a_truncated_or_damaged_png_is_not_intact() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let picture = grey(|x, y| (x * y) as f32);
        write_png(&path, [4, 3], picture.iter().copied(), None, ToneMapping::default(), Some("{}")).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert!(is_intact(&path));
        let is_kept = |changed: &[u8]| {
            std::fs::write(&path, changed).unwrap();
            is_intact(&path)
        };
        for place in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 1 << (place % 8);
            assert!(!is_kept(&changed), "byte {place}");
            assert!(!is_kept(&bytes[..place]), "the first {place} bytes");
        }
        assert!(!is_kept(&[&bytes[..], &[0]].concat()));
        assert!(is_kept(&bytes));
    }

    #[test]
    fn an_automatic_exposure_does_not_depend_on_the_unit_of_radiance() {
        let of_unit =
            |unit| written(&grey(|x, y| unit * ((x + 1) * (y + 2)) as f32), None, ToneCurve::Reinhard);
        assert_eq!(of_unit(1.0), of_unit(1024.0));
    }

    #[test]
    fn a_stop_doubles_radiance() {
        let [once, twice] = [1.0, 2.0].map(|unit| grey(move |x, y| unit * (x * y) as f32 * 0.02));
        for curve in [ToneCurve::None, ToneCurve::Reinhard, ToneCurve::Aces] {
            let brighter = written(&once, Some(1.0), curve);
            assert_eq!(brighter, written(&twice, Some(0.0), curve));
            assert_ne!(brighter, written(&once, Some(0.0), curve));
        }
    }

    /// Compares with values computed by hand from the curves' formulas.
    #[test]
    fn curves_have_their_known_values() {
        let grey = |curve: ToneCurve, value: f32| curve.compress([value; 3])[1];
        for (curve, value, expected) in [
            (ToneCurve::None, 3.0, 3.0),
            (ToneCurve::Reinhard, 0.18, 0.154_258_5),
            (ToneCurve::Reinhard, 1.0, 0.531_25),
            (ToneCurve::Reinhard, WHITE, 1.0),
            (ToneCurve::Aces, 0.18, 0.266_898_9),
            (ToneCurve::Aces, 1.0, 0.803_797_5),
            // The curve's limit is 2.51 / 2.43: it is clipped.
            (ToneCurve::Aces, 1e6, 1.032_921_5),
        ] {
            let found = grey(curve, value);
            assert!((found - expected).abs() < 2e-6 * expected, "{curve:?} {value}: {found}");
        }
        // Reinhard's curve keeps the hue, the filmic curve desaturates.
        let [red, green, _] = ToneCurve::Reinhard.compress([2.0, 0.5, 0.1]);
        assert!((red / green - 4.0).abs() < 1e-5);
        let [red, green, _] = ToneCurve::Aces.compress([2.0, 0.5, 0.1]);
        assert!(red / green < 2.0);
    }

    /// By IEC 61966-2-1, half of full intensity has the code 188 of 255.
    #[test]
    fn the_screen_curve_has_its_known_values() {
        for (linear, code) in [(0.0, 0), (0.003, 10), (0.18, 118), (0.5, 188), (1.0, 255), (7.0, 255)] {
            assert_eq!(tone_map([linear; 3], 1.0, ToneCurve::None), [code; 3]);
        }
    }

    /// A PNG has the colour of the surface, however much of a pixel the surface covers.
    #[test]
    fn a_png_with_alpha_is_not_premultiplied() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let alpha: Vec<f32> = (0..12).map(|index| index as f32 / 11.0).collect();
        let premultiplied: Vec<[f32; 3]> = alpha.iter().map(|alpha| [0.18 * alpha; 3]).collect();
        for exposure in [Some(0.0), None] {
            let mapping = ToneMapping { exposure, curve: ToneCurve::None };
            write_png(&path, [4, 3], premultiplied.iter().copied(), Some(&alpha), mapping, None).unwrap();
            let (width, height, pixels) = decode(&path);
            assert_eq!((width, height, pixels.len()), (4, 3, 48));
            assert_eq!(pixels[..4], [0; 4]);
            for (index, pixel) in pixels.chunks(4).enumerate().skip(1) {
                assert_eq!(pixel[..3], [118; 3], "{index}");
                assert_eq!(pixel[3], (index as f32 * 255.0 / 11.0).round() as u8);
            }
        }
    }

    #[test]
    fn negative_and_infinite_radiance_is_shown() {
        for curve in [ToneCurve::None, ToneCurve::Reinhard, ToneCurve::Aces] {
            assert_eq!(tone_map([-1.0, f32::NEG_INFINITY, 0.0], 1.0, curve), [0; 3]);
            assert_eq!(tone_map([f32::INFINITY; 3], 1.0, curve), [255; 3]);
            assert_eq!(tone_map([f32::MAX; 3], 1.0, curve), [255; 3]);
        }
        assert_eq!(automatic_scale(std::iter::repeat_n([0.0; 3], 9)), 1.0);
    }

    #[test]
    fn pictures_that_cannot_be_shown_are_refused_before_anything_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        let refused = |size, picture: &[[f32; 3]], exposure| {
            let mapping = ToneMapping { exposure, curve: ToneCurve::default() };
            let result = write_png(&path, size, picture.iter().copied(), None, mapping, None);
            assert!(!path.exists());
            result.unwrap_err()
        };
        let mut picture = grey(|_, _| 1.0);
        for exposure in [f32::NAN, f32::INFINITY] {
            assert!(matches!(refused([4, 3], &picture, Some(exposure)), PngError::Exposure { .. }));
        }
        for size in [[4, 4], [0, 3], [4, 2]] {
            assert!(matches!(refused(size, &picture, None), PngError::Encode { .. }), "{size:?}");
        }
        picture[6][1] = f32::NAN;
        assert!(matches!(refused([4, 3], &picture, None), PngError::NotANumber { x: 2, y: 1, .. }));
    }
}
