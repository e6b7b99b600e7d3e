//! Estimate of the noise of a picture from the differences of its passes.
//!
//! Let `A` and `B` be the means of the pixels over the first and the next `n` samples, `M` their mean, `e_n` and `e_2n` the errors of `A`
//! and `M` (root mean squares), and `D_n = E[(A - B)^2]`. `B` has the error of `A`, so that `e_2n^2 = e_n^2 - D_n / 4`, and
//! `e_2n^2 = (D_2n + D_4n + ...) / 4`: the sum of the differences of passes to come. These fall by a factor `r` at each doubling:
//! `e_2n^2 = D_n / 4 * r / (1 - r)`. Independent samples have `r = 1/2`; a stratified sequence does better, down to `1/4` where light is smooth
//! (Owen 1997), but not evenly: some numbers of samples are luckier than others. So `r` and `D_n` are geometric means over the last
//! differences, and `r` is bounded.

use crate::film::Film;

/// Bounds of the ratio of consecutive differences.
const RATIOS: [f64; 2] = [0.38, 0.5];

/// Estimate of the noise of a picture from the differences of its passes, each of which doubles the samples.
#[derive(Clone, Debug, Default)]
pub(super) struct NoiseEstimate {
    /// Samples after the last pass that has doubled them.
    samples: f64,
    /// Mean squared differences of the last passes that have doubled the samples, relative to the mean pixel, the oldest first.
    differences: [Option<f64>; 3],
    /// Samples after the last pass.
    all: f64,
    /// If the picture of the last pass that has doubled the samples is black.
    is_of_black: bool,
}

impl NoiseEstimate {
    /// Adds the picture before a pass and the one after it. A pass that does not double the samples has no part in the estimate.
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
        // `A - B` is twice `A - M`.
        let difference = 4.0 * squares / count / (sum / count).powi(2);
        self.differences = [self.differences[1], self.differences[2], Some(difference)];
        self.samples = all;
    }

    /// Returns whether the picture is black, so that noise has no measure.
    pub(super) fn is_of_black(&self) -> bool {
        self.is_of_black
    }

    /// Squared noise at the last doubling.
    fn squared(&self) -> Option<f64> {
        let [oldest, before, last] = self.differences;
        let last = last?;
        let bounded = |ratio: f64| ratio.clamp(RATIOS[0], RATIOS[1]);
        let ratio = match (oldest, before) {
            (Some(oldest), _) if oldest > 0.0 => bounded((last / oldest).sqrt()),
            (None, Some(before)) if before > 0.0 => bounded(last / before),
            _ => RATIOS[1],
        };
        let difference = before.map_or(last, |before| (last * before * ratio).sqrt());
        Some(difference / 4.0 * ratio / (1.0 - ratio))
    }

    /// Noise of the last picture, relative to its mean; `None` before there is a pass that has doubled the samples. Samples beyond the last
    /// doubling are taken for independent ones.
    pub(super) fn noise(&self) -> Option<f64> {
        Some((self.squared()? * self.samples / self.all).sqrt())
    }

    /// Number of samples to be added so that the noise is at most `aim`; `None` before there is an estimate.
    pub(super) fn samples_to(&self, aim: f64) -> Option<u32> {
        if self.noise()? <= aim {
            return Some(0);
        }
        let samples = self.samples * self.squared()? / (aim * aim);
        Some((samples - self.all).ceil().max(1.0) as u32)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::RangeInclusive;

    use photoncard_firmware::sampler::{hash, radical_inverse};

    use super::*;
    use crate::film::{FilmPixel, PixelValue, SumFormat, Window};

    const SIDE: u32 = 64;

    /// A film of the mean of `value(pixel, sample)` over the first samples.
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

    /// Checks that the estimate for pixels of the mean 1/2, over their true error, is in a range.
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
        assert!(estimate.samples_to(found / 2.0).is_some_and(|more| (90..=97).contains(&more)));
        // A last pass that does not double the samples.
        let more = estimate.samples_to(0.8 * found).unwrap();
        estimate.add(&before, &film(32 + more, &value));
        let noise = estimate.noise().unwrap();
        assert!((0.7 * found..=0.8 * found).contains(&noise), "{noise} of {found}");
        assert_eq!(estimate.samples_to(0.8 * found), Some(0));
    }

    #[test]
    fn noise_of_independent_samples_is_found() {
        let random = |pixel: u32, sample: u32| f64::from(hash(hash(pixel) ^ sample)) / f64::from(u32::MAX);
        check(random, 0.9..=1.1);
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
