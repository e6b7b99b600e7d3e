//! Estimates the noise of a picture from the differences of its passes.
//!
//! Let `A` and `B` be the means of a pixel over the first `n` and the next `n` samples, and `M` their mean.
//! Let `e_n` and `e_2n` be the root mean square errors of `A` and `M`, and `D_n = E[(A - B)^2]`. `B` has the
//! same error as `A`, so that `e_2n^2 = e_n^2 - D_n / 4`. If `e_2n^2 = r e_n^2`, then
//! `e_2n^2 = D_n / 4 * r / (1 - r)`.
//!
//! Independent samples have `r = 1/2`. A stratified sequence has a lower `r`, down to `1/4` for edges and
//! smooth light (Owen 1997), and lower with few samples than with many. The decrease is uneven: the ratios of
//! successive `D_n` are 0.24 to 0.69, and some numbers of samples happen to be better than others. One ratio
//! for all pictures is more accurate than a ratio measured in each picture.

use photoncard_picture::film::Film;

/// Factor `r` by which the squared noise is multiplied when the number of samples doubles.
const RATIO: f64 = 0.45;

/// Estimate of the noise of a picture from the differences of passes that double the samples.
#[derive(Clone, Debug, Default)]
pub(super) struct NoiseEstimate {
    /// Number of samples after the last pass that doubled them.
    samples: f64,
    /// Squared noise after the last pass that doubled the samples, relative to the squared mean of the
    /// picture; `None` before the first such pass.
    squared: Option<f64>,
    /// Number of samples after the last pass.
    all: f64,
    /// True if the picture after the last pass that doubled the samples is black.
    is_of_black: bool,
}

impl NoiseEstimate {
    /// Adds the difference between the pictures before and after a pass to the estimate. A pass that does not
    /// double the number of samples only updates that number.
    pub(super) fn add(&mut self, before: &Film, after: &Film) {
        let [few, all] = [before, after].map(|film| f64::from(film.format().samples));
        self.all = all;
        if all != 2.0 * few {
            return;
        }
        let [mut squares, mut sum, mut count] = [0.0; 3];
        for (before, after) in before.pixels().zip(after.pixels()) {
            for (before, after) in before.radiance.into_iter().zip(after.radiance) {
                squares += (f64::from(before) - f64::from(after)).powi(2);
                sum += f64::from(after);
                count += 1.0;
            }
        }
        self.is_of_black = sum <= 0.0;
        if self.is_of_black {
            return;
        }
        // `A - M` is `A - B` times the weight of the pass in `M`. The weight is 1/2, or more if `A` contains
        // probes, which count by half.
        let [few, all] = [before, after].map(|film| film.format().count().weight_of_light());
        let halves = 0.5 * all / (all - few);
        let quarter = squares / count / (sum / count).powi(2) * halves * halves;
        self.squared = Some(quarter * RATIO / (1.0 - RATIO));
        self.samples = all;
    }

    /// Returns whether the picture is black, so that its relative noise is undefined.
    pub(super) fn is_of_black(&self) -> bool {
        self.is_of_black
    }

    /// Noise of the last picture, relative to its mean; `None` before a pass has doubled the samples.
    pub(super) fn noise(&self) -> Option<f64> {
        // The squared noise is assumed to fall linearly from one doubling to the next, because the last
        // samples of the sequence are not stratified against the first.
        let doubled = (self.all / self.samples - 1.0).min(1.0);
        Some((self.squared? * (1.0 - doubled * (1.0 - RATIO))).sqrt())
    }

    /// Number of samples to add so that the noise is at most `aim`. `None` before there is an estimate, or if
    /// even twice `Self::samples` do not suffice.
    pub(super) fn samples_to(&self, aim: f64) -> Option<u32> {
        if self.noise()? <= aim {
            return Some(0);
        }
        let doubled = (1.0 - aim * aim / self.squared?) / (1.0 - RATIO);
        (doubled <= 1.0).then(|| (self.samples * (1.0 + doubled) - self.all).ceil().max(1.0) as u32)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::RangeInclusive;

    use photoncard_firmware::sampler::{hash, radical_inverse};
    use photoncard_picture::film::{FilmPixel, PixelValue, SumFormat, Window};

    use super::*;

    const SIDE: u32 = 64;

    /// Film with the means of `value(pixel, sample)` over the first samples.
    fn film(samples: u32, value: impl Fn(u32, u32) -> f64) -> Film {
        let format = SumFormat { samples, ..SumFormat::ONE };
        let mut film = Film::new(SIDE, SIDE, Window::full(SIDE, SIDE), format).unwrap();
        for pixel in 0..SIDE * SIDE {
            let sum: f64 = (0..samples).map(|sample| value(pixel, sample)).sum();
            let radiance = [(sum / f64::from(samples)) as f32; 3];
            let pixel_value = PixelValue { radiance, ..PixelValue::default() };
            let sums = format.sums(&FilmPixel { pixel: pixel_value, ..FilmPixel::default() });
            film.write(pixel % SIDE, pixel / SIDE, &sums).unwrap();
        }
        film
    }

    /// Checks that the estimated noise divided by the true error is in `range`, for pixels with mean 1/2.
    fn check(value: impl Fn(u32, u32) -> f64, range: RangeInclusive<f64>) {
        let mut estimate = NoiseEstimate::default();
        let mut before = film(1, &value);
        assert_eq!(estimate.noise(), None);
        for samples in [2, 4, 8, 16, 32] {
            let after = film(samples, &value);
            estimate.add(&before, &after);
            before = after;
        }
        let error = |radiance: f32| (f64::from(radiance) - 0.5).powi(2);
        let squares: f64 = before.pixels().map(|pixel| error(pixel.radiance[0])).sum();
        let truth = (squares / f64::from(SIDE * SIDE)).sqrt() / 0.5;
        let found = estimate.noise().unwrap();
        assert!(range.contains(&(found / truth)), "{found} {truth}");
        assert_eq!(estimate.samples_to(found), Some(0));
        assert_eq!(estimate.samples_to(found / 2.0), None);
        // A last pass that does not double the samples.
        let more = estimate.samples_to(0.8 * found).unwrap();
        estimate.add(&before, &film(32 + more, &value));
        let noise = estimate.noise().unwrap();
        assert!((0.7 * found..=0.8 * found).contains(&noise), "{noise} of {found}");
        assert_eq!(estimate.samples_to(0.8 * found), Some(0));
    }

    #[test]
    fn noise_of_independent_samples_is_estimated() {
        let random = |pixel: u32, sample: u32| f64::from(hash(hash(pixel) ^ sample)) / f64::from(u32::MAX);
        check(random, 0.85..=1.0);
    }

    #[test]
    fn noise_of_a_stratified_sequence_is_not_underestimated() {
        let shifted = |pixel: u32, sample: u32| {
            let inverse = (f64::from(radical_inverse(sample)) * f64::from(1 << 16)) as u32;
            let scrambled = inverse ^ (hash(pixel) >> 16);
            (f64::from(scrambled) + 0.5) / f64::from(1 << 16)
        };
        check(shifted, 1.0..=1.6);
    }
}
