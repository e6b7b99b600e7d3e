//! Estimate of the noise of a picture from the difference of its passes.
//!
//! Let `A` and `B` be the means of the pixels over `n` samples each, and `M` their mean, with the errors `e_n` and `e_2n` (root mean
//! squares). With `e_2n = 2^-r e_n`, `E[(A - B)^2] = 4 (e_n^2 - e_2n^2)`, as `M` is the mean of both, and
//! `e_2n = |A - B| / (2 sqrt(4^r - 1))`. For independent samples `r = 1/2`; samples of a stratified sequence that add up to its
//! runs have a greater `r`, which is measured from one doubling to the next.

use crate::film::Film;

/// Limits of the measured rate of convergence `r`.
const RATES: (f64, f64) = (0.5, 1.0);

/// Estimate of the noise of a picture from the difference of its passes.
#[derive(Clone, Debug, Default)]
pub(super) struct NoiseEstimate {
    /// Samples, and relative noise of the picture with the rate 1/2, of the last two pictures.
    last: [Option<(u32, f64)>; 2],
}

impl NoiseEstimate {
    /// Adds the picture before a pass and the one after it.
    pub(super) fn add(&mut self, before: &Film, after: &Film) {
        let (few, all) = (f64::from(before.format().samples), f64::from(after.format().samples));
        let [mut squares, mut sum, mut count] = [0.0; 3];
        for (before, after) in before.pixels().zip(after.pixels()) {
            for (before, after) in before.radiance.into_iter().zip(after.radiance) {
                squares += (f64::from(before) - f64::from(after)).powi(2);
                sum += f64::from(after);
                count += 1.0;
            }
        }
        let more = all - few;
        if sum <= 0.0 || more <= 0.0 {
            return;
        }
        // The difference to the mean of all samples, as a share of that between the two parts.
        let between = (squares / count).sqrt() * all / more;
        let noise = between * (few * more).sqrt() / all / (sum / count);
        self.last = [self.last[1], Some((after.format().samples, noise))];
    }

    /// Rate of convergence: noise is in proportion to the number of samples to the power of minus this.
    fn rate(&self) -> f64 {
        let [Some((few, more_noise)), Some((all, noise))] = self.last else { return RATES.0 };
        let rate = (more_noise / noise).ln() / (f64::from(all) / f64::from(few)).ln();
        if rate.is_finite() { rate.clamp(RATES.0, RATES.1) } else { RATES.0 }
    }

    /// Noise of the last picture, relative to its mean; `None` before there are two passes.
    pub(super) fn noise(&self) -> Option<f64> {
        let (_, noise) = self.last[1]?;
        Some(noise / (4.0_f64.powf(self.rate()) - 1.0).sqrt())
    }

    /// Number of samples to be added to `samples` so that the noise is at most `aim`; `None` before there is an estimate.
    pub(super) fn samples_to(&self, aim: f64, samples: u32) -> Option<u32> {
        let factor = (self.noise()? / aim).max(1.0).powf(1.0 / self.rate());
        Some((f64::from(samples) * (factor - 1.0)).ceil() as u32)
    }
}

#[cfg(test)]
mod tests {
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

    /// Checks the estimate for pixels of the mean 1/2 against their true error.
    fn check(value: impl Fn(u32, u32) -> f64, tolerance: f64) {
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
        assert!((found / truth - 1.0).abs() < tolerance, "{found} {truth}");
        assert_eq!(estimate.samples_to(found, 32), Some(0));
        assert!(estimate.samples_to(found / 2.0, 32).is_some_and(|more| (32..=96).contains(&more)));
    }

    #[test]
    fn noise_of_independent_samples_is_found() {
        let random = |pixel: u32, sample: u32| f64::from(hash(hash(pixel) ^ sample)) / f64::from(u32::MAX);
        check(random, 0.1);
    }

    #[test]
    fn noise_of_a_stratified_sequence_is_found() {
        let shifted = |pixel: u32, sample: u32| {
            let inverse = (f64::from(radical_inverse(sample)) * f64::from(1 << 16)) as u32;
            let scrambled = inverse ^ (hash(pixel) >> 16);
            (f64::from(scrambled) + 0.5) / f64::from(1 << 16)
        };
        check(shifted, 0.35);
    }
}
