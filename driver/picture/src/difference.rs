//! Difference of a picture from a reference, as errors of pixels and of block means.
//!
//! Block means average out the noise of both pictures and reveal bias. Everything is computed in double
//! precision over all three channels. The *mean* of a pixel or a block is the mean of its channels R, G and
//! B.

use serde::Serialize;
use thiserror::Error;

use crate::exr::RgbImage;

/// Constant in the denominator of relative squared errors, which keeps errors of black pixels finite.
const RELATIVE_FLOOR: f64 = 0.01;

/// Difference of a picture from a reference. The JSON keys are stable.
///
/// If blocks are excluded, all values refer to the remaining pixels and blocks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Columns of both pictures.
    pub width: usize,
    /// Rows of both pictures.
    pub height: usize,
    /// Number of pixels that were compared.
    pub pixel_count: usize,
    /// Errors over the channels of all pixels.
    pub pixels: Errors,
    /// Errors of block means.
    pub blocks: BlockErrors,
    /// Mean of the reference over pixels and channels.
    pub mean_reference: f64,
    /// Mean of the picture over pixels and channels.
    pub mean_image: f64,
    /// `mean_image / mean_reference`; `None` (JSON `null`) for a black reference.
    pub mean_ratio: Option<f64>,
}

/// Errors of values `a` of the picture against values `b` of the reference: channels of pixels, or their
/// means in blocks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Mean of `(a - b)^2`.
    pub mse: f64,
    /// Square root of the mean of `(a - b)^2`.
    pub rmse: f64,
    /// Mean of `(a - b)^2 / (b^2 + 0.01)`.
    pub relmse: f64,
}

/// Errors of block means. A truncated block at the right or lower border counts like any other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BlockErrors {
    /// Side of a block, pixels.
    pub size: usize,
    /// Number of blocks that were compared.
    pub count: usize,
    /// Number of blocks that were excluded because the reference exceeds the radiance limit in them.
    pub excluded: usize,
    /// Number of compared blocks whose reference is black. They have no relative errors.
    pub black: usize,
    /// Errors of the means of each channel in each block.
    #[serde(flatten)]
    pub errors: Errors,
    /// Median over the blocks of `|a - b| / b`; `None` (JSON `null`) if all blocks are black. Here `a` and
    /// `b` are means over the pixels and channels of a block.
    pub relative_median: Option<f64>,
    /// 95th percentile of `|a - b| / b` over the blocks: the smallest error that 95 % of them do not exceed.
    pub relative_p95: Option<f64>,
    /// Maximum of `|a - b| / b` over the blocks.
    pub relative_max: Option<f64>,
}

/// Error of [`compare`].
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum DifferenceError {
    /// The pictures have different sizes.
    #[error(
        "the reference has {} x {} pixels and the image {} x {}; render the image in the reference's size or crop both \
         alike", reference[0], reference[1], image[0], image[1]
    )]
    Size {
        /// Width and height of the reference.
        reference: [usize; 2],
        /// Width and height of the image.
        image: [usize; 2],
    },
    /// The block size is 0.
    #[error("a block of 0 x 0 pixels is not possible; choose a side of at least 1")]
    EmptyBlock,
    /// A radiance is infinite or not a number.
    #[error("pixel ({x}, {y}) of the {which} is {value:?}, not a finite radiance; render it again")]
    NotFinite {
        /// Name of the picture: `reference` or `image`.
        which: &'static str,
        /// Column of the pixel.
        x: usize,
        /// Row of the pixel.
        y: usize,
        /// Red, green and blue of the pixel.
        value: [f32; 3],
    },
    /// The radiance limit excludes all blocks.
    #[error("every block of the reference exceeds {limit} somewhere; exclude less")]
    AllExcluded {
        /// Radiance limit.
        limit: f32,
    },
    /// The radiance limit is not a number.
    #[error("blocks cannot be excluded by a radiance of {limit}; state a number")]
    BadLimit {
        /// Radiance limit.
        limit: f32,
    },
}

/// Compares `image` with `reference` in blocks of `block` x `block` pixels.
///
/// With `exclude`, a block is excluded from all results if any channel of any of its reference pixels exceeds
/// that radiance. Such a block shows an emitter, whose radiance would outweigh everything else. Only the
/// sizes of the data windows matter, not their positions.
///
/// # Errors
/// If the sizes differ, a pixel is not finite, `block` is 0, or `exclude` is NaN or excludes every block.
pub fn compare(
    reference: &RgbImage,
    image: &RgbImage,
    block: usize,
    exclude: Option<f32>,
) -> Result<Difference, DifferenceError> {
    let size = [reference.width, reference.height];
    if size != [image.width, image.height] || reference.pixels.len() != image.pixels.len() {
        return Err(DifferenceError::Size { reference: size, image: [image.width, image.height] });
    }
    if block == 0 {
        return Err(DifferenceError::EmptyBlock);
    }
    if let Some(limit) = exclude.filter(|limit| limit.is_nan()) {
        return Err(DifferenceError::BadLimit { limit });
    }
    check_finite(reference, "reference")?;
    check_finite(image, "image")?;
    let mut sums = Sums::default();
    for top in (0..reference.height).step_by(block) {
        for left in (0..reference.width).step_by(block) {
            let rows = top..(top.saturating_add(block)).min(reference.height);
            let columns = left..(left.saturating_add(block)).min(reference.width);
            let indices = rows.flat_map(|y| columns.clone().map(move |x| y * reference.width + x));
            sums.add_block(reference, image, indices, exclude);
        }
    }
    match exclude {
        Some(limit) if sums.blocks.count == 0 => Err(DifferenceError::AllExcluded { limit }),
        _ => Ok(sums.finish(size, block)),
    }
}

fn check_finite(image: &RgbImage, which: &'static str) -> Result<(), DifferenceError> {
    let is_bad = |pixel: &[f32; 3]| !pixel.iter().all(|value| value.is_finite());
    match image.pixels.iter().position(is_bad) {
        None => Ok(()),
        Some(index) => Err(DifferenceError::NotFinite {
            which,
            x: index % image.width,
            y: index / image.width,
            value: image.pixels[index],
        }),
    }
}

/// Sums of errors over pixels or blocks, with three channels each.
#[derive(Default)]
struct ErrorSums {
    count: usize,
    squared: f64,
    relative: f64,
}

impl ErrorSums {
    fn add(&mut self, b: [f64; 3], a: [f64; 3]) {
        self.count += 1;
        for (b, a) in b.into_iter().zip(a) {
            let squared = (a - b) * (a - b);
            self.squared += squared;
            self.relative += squared / (b * b + RELATIVE_FLOOR);
        }
    }

    fn finish(&self) -> Errors {
        let samples = 3.0 * self.count.max(1) as f64;
        let mse = self.squared / samples;
        Errors { mse, rmse: mse.sqrt(), relmse: self.relative / samples }
    }
}

#[derive(Default)]
struct Sums {
    pixels: ErrorSums,
    blocks: ErrorSums,
    excluded: usize,
    black: usize,
    relative: Vec<f64>,
    reference: f64,
    image: f64,
}

impl Sums {
    fn add_block(
        &mut self,
        reference: &RgbImage,
        image: &RgbImage,
        indices: impl Iterator<Item = usize> + Clone,
        exclude: Option<f32>,
    ) {
        let exceeds =
            |limit: f32| indices.clone().any(|index| reference.pixels[index].iter().any(|&b| b > limit));
        if exclude.is_some_and(exceeds) {
            self.excluded += 1;
            return;
        }
        let (mut count, mut b_sum, mut a_sum) = (0.0, [0.0; 3], [0.0; 3]);
        for index in indices {
            let (b, a) = (reference.pixels[index].map(f64::from), image.pixels[index].map(f64::from));
            self.pixels.add(b, a);
            count += 1.0;
            for channel in 0..3 {
                b_sum[channel] += b[channel];
                a_sum[channel] += a[channel];
            }
        }
        let (b, a) = (b_sum.iter().sum::<f64>(), a_sum.iter().sum::<f64>());
        self.reference += b;
        self.image += a;
        self.blocks.add(b_sum.map(|sum| sum / count), a_sum.map(|sum| sum / count));
        if b > 0.0 {
            self.relative.push((a - b).abs() / b);
        } else {
            self.black += 1;
        }
    }

    fn finish(mut self, [width, height]: [usize; 2], block: usize) -> Difference {
        self.relative.sort_by(f64::total_cmp);
        let samples = 3.0 * self.pixels.count.max(1) as f64;
        let ratio = self.image / self.reference;
        Difference {
            width,
            height,
            pixel_count: self.pixels.count,
            pixels: self.pixels.finish(),
            blocks: BlockErrors {
                size: block,
                count: self.blocks.count,
                excluded: self.excluded,
                black: self.black,
                errors: self.blocks.finish(),
                relative_median: median(&self.relative),
                relative_p95: percentile_95(&self.relative),
                relative_max: self.relative.last().copied(),
            },
            mean_reference: self.reference / samples,
            mean_image: self.image / samples,
            mean_ratio: ratio.is_finite().then_some(ratio),
        }
    }
}

fn median(sorted: &[f64]) -> Option<f64> {
    let middle = sorted.len() / 2;
    let upper = *sorted.get(middle)?;
    Some(if sorted.len() % 2 == 1 { upper } else { 0.5 * (sorted[middle - 1] + upper) })
}

fn percentile_95(sorted: &[f64]) -> Option<f64> {
    let rank = (sorted.len() * 95).div_ceil(100);
    rank.checked_sub(1).map(|index| sorted[index])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize, value: impl Fn(usize, usize) -> [f32; 3]) -> RgbImage {
        let pixels =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect();
        RgbImage { width, height, data_window_origin: [0, 0], pixels, alpha: None, provenance: None }
    }

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-6 * b.abs().max(1e-6)
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        let reference = picture(33, 17, |x, y| [x as f32, y as f32, 1.0]);
        let difference = compare(&reference, &reference, 16, None).unwrap();
        let none = Errors { mse: 0.0, rmse: 0.0, relmse: 0.0 };
        assert_eq!((difference.pixels, difference.blocks.errors), (none, none));
        assert_eq!(difference.mean_ratio, Some(1.0));
        assert_eq!(difference.blocks.count, 6);
        assert_eq!(difference.pixel_count, 33 * 17);
        assert_eq!(difference.blocks.relative_max, Some(0.0));
    }

    #[test]
    fn errors_of_a_scaled_picture_follow_from_the_scale() {
        let reference = picture(40, 40, |_, _| [2.0, 4.0, 6.0]);
        let image = picture(40, 40, |_, _| [2.2, 4.4, 6.6]);
        let difference = compare(&reference, &image, 16, None).unwrap();
        let squares = [0.04, 0.16, 0.36];
        assert!(near(difference.pixels.mse, squares.iter().sum::<f64>() / 3.0));
        assert!(near(difference.pixels.rmse, difference.pixels.mse.sqrt()));
        let relative =
            squares.iter().zip([4.0, 16.0, 36.0]).map(|(square, b)| square / (b + 0.01)).sum::<f64>();
        assert!(near(difference.pixels.relmse, relative / 3.0));
        assert!(near(difference.blocks.errors.mse, difference.pixels.mse));
        assert!(near(difference.mean_ratio.unwrap(), 1.1));
        assert!(near(difference.mean_reference, 4.0));
        for relative in [difference.blocks.relative_median, difference.blocks.relative_p95] {
            assert!(near(relative.unwrap(), 0.1));
        }
    }

    /// Noise whose mean over each block is zero must appear in the errors of pixels, but not in those of
    /// blocks.
    #[test]
    fn block_means_average_noise_out() {
        let reference = picture(8, 8, |_, _| [1.0; 3]);
        let image = picture(8, 8, |x, y| [if (x + y) % 2 == 0 { 1.5 } else { 0.5 }; 3]);
        let difference = compare(&reference, &image, 4, None).unwrap();
        assert_eq!(difference.pixels.mse, 0.25);
        assert_eq!(difference.blocks.errors.mse, 0.0);
    }

    #[test]
    fn percentiles_are_taken_over_blocks() {
        let reference = picture(100, 1, |_, _| [1.0; 3]);
        let image = picture(100, 1, |x, _| [1.0 + (x + 1) as f32; 3]);
        let blocks = compare(&reference, &image, 1, None).unwrap().blocks;
        assert_eq!(blocks.relative_median, Some(50.5));
        assert_eq!(blocks.relative_p95, Some(95.0));
        assert_eq!(blocks.relative_max, Some(100.0));
    }

    #[test]
    fn blocks_that_see_an_emitter_are_excluded_from_all_values() {
        let reference = picture(8, 4, |x, y| if (x, y) == (5, 1) { [0.0, 10.0, 0.0] } else { [1.0; 3] });
        let image = picture(8, 4, |x, _| if x >= 4 { [100.0; 3] } else { [2.0; 3] });
        let difference = compare(&reference, &image, 4, Some(5.0)).unwrap();
        assert_eq!((difference.blocks.count, difference.blocks.excluded, difference.pixel_count), (1, 1, 16));
        assert_eq!((difference.pixels.mse, difference.mean_image), (1.0, 2.0));
        // A block whose radiance equals the limit is not excluded.
        assert_eq!(compare(&reference, &image, 4, Some(10.0)).unwrap().blocks.excluded, 0);
        let all = compare(&reference, &image, 4, Some(0.5));
        assert_eq!(all, Err(DifferenceError::AllExcluded { limit: 0.5 }));
    }

    #[test]
    fn black_blocks_have_no_relative_error() {
        let reference = picture(4, 2, |x, _| if x < 2 { [0.0; 3] } else { [1.0; 3] });
        let image = picture(4, 2, |_, _| [1.0; 3]);
        let difference = compare(&reference, &image, 2, None).unwrap();
        assert_eq!((difference.blocks.black, difference.blocks.relative_max), (1, Some(0.0)));
        let black = picture(4, 2, |_, _| [0.0; 3]);
        let difference = compare(&black, &image, 2, None).unwrap();
        assert_eq!((difference.mean_ratio, difference.blocks.relative_median), (None, None));
    }

    #[test]
    fn pictures_that_cannot_be_compared_are_refused() {
        let a = picture(4, 2, |_, _| [1.0; 3]);
        let b = picture(2, 4, |_, _| [1.0; 3]);
        let error = compare(&a, &b, 2, None).unwrap_err();
        assert!(error.to_string().contains("4 x 2") && error.to_string().contains("2 x 4"), "{error}");
        assert_eq!(compare(&a, &a, 0, None), Err(DifferenceError::EmptyBlock));
        assert!(matches!(compare(&a, &a, 2, Some(f32::NAN)), Err(DifferenceError::BadLimit { .. })));
        let bad = picture(4, 2, |x, y| if (x, y) == (3, 1) { [0.0, f32::NAN, 0.0] } else { [1.0; 3] });
        let error = compare(&a, &bad, 2, None).unwrap_err();
        assert!(matches!(error, DifferenceError::NotFinite { which: "image", x: 3, y: 1, .. }), "{error}");
        assert_eq!(compare(&a, &a, usize::MAX, None).unwrap().blocks.count, 1);
    }

    #[test]
    fn keys_of_the_json_are_stable() {
        let a = picture(4, 2, |_, _| [1.0; 3]);
        let json = serde_json::to_value(compare(&a, &a, 2, None).unwrap()).unwrap();
        let keys = |value: &serde_json::Value| {
            value.as_object().unwrap().keys().cloned().collect::<Vec<_>>().join(" ")
        };
        assert_eq!(
            keys(&json),
            "blocks height mean_image mean_ratio mean_reference pixel_count pixels width"
        );
        assert_eq!(keys(&json["pixels"]), "mse relmse rmse");
        assert_eq!(
            keys(&json["blocks"]),
            "black count excluded mse relative_max relative_median relative_p95 relmse rmse size"
        );
    }
}
