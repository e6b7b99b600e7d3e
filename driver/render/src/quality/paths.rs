//! Predicts how many paths adaptive sampling would trace, from the deviations of a pilot render's pixels.

use photoncard_shared::message::MAX_PATHS;

/// Mean number of paths beyond the first, per sample after the probes, that determines the threshold of
/// adaptive sampling. The value nearly minimises time times variance in rooms, halls and single objects. With
/// two to three times this value, the product is 1.2 times as large in halls and Cornell boxes, and a fifth
/// smaller in pictures where few pixels have nearly all noise.
const EXTRA_PATHS: f64 = 0.1;
/// Minimum of [`Deviations::gain`] at which adaptive sampling is on. Deviations estimated from two samples
/// make even uniform noise seem uneven, with a gain of 1.3 to 1.5. The gain is 1.5 to 2.2 in Cornell boxes
/// and halls, where time times variance hardly changes. It is 2.2 to 4 in scenes where that product falls to
/// a half or less.
const MIN_GAIN: f64 = 2.0;
/// Lower and upper bound of the threshold of adaptive sampling, W^(1/2)/(sr^(1/2) m).
const THRESHOLDS: [f64; 2] = [1e-9, 1e9];
/// Number of steps of the bisection that finds the threshold on a logarithmic scale.
const STEPS: u32 = 60;

/// Deviation of the samples of each pixel: standard deviation divided by the square root of the mean
/// radiance, W^(1/2)/(sr^(1/2) m).
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Deviations(Vec<f64>);

impl Deviations {
    #[cfg(test)]
    pub(super) const NONE: Self = Self(Vec::new());

    /// Computes the deviation of each pixel. `pixels` has the light of `N` samples of each pixel, from which
    /// the variance is computed, and the pixel's mean radiance. A deviation that is not finite becomes 0.
    pub(super) fn new<const N: usize>(pixels: impl IntoIterator<Item = ([f64; N], f64)>) -> Self {
        let of_pixel = |(light, radiance): ([f64; N], f64)| {
            let mean = light.iter().sum::<f64>() / N as f64;
            let squares: f64 = light.iter().map(|light| (light - mean).powi(2)).sum();
            let deviation = (squares / (N as f64 - 1.0) / radiance).sqrt();
            if deviation.is_finite() { deviation } else { 0.0 }
        };
        Self(pixels.into_iter().map(of_pixel).collect())
    }

    /// Mean number of paths beyond the first, per sample after the probes, at the given threshold.
    fn extra_paths(&self, threshold: f64) -> f64 {
        let extra = |deviation: &f64| paths(*deviation, threshold) - 1.0;
        self.0.iter().map(extra).sum::<f64>() / self.0.len().max(1) as f64
    }

    /// Factor by which adaptive sampling at this threshold reduces the sum of the variances of all pixels,
    /// compared with one path per sample; 1 without variance.
    fn gain(&self, threshold: f64) -> f64 {
        let by_one: f64 = self.0.iter().map(|deviation| deviation.powi(2)).sum();
        let by_paths: f64 =
            self.0.iter().map(|deviation| deviation.powi(2) / paths(*deviation, threshold)).sum();
        let gain = by_one / by_paths;
        if gain.is_finite() { gain } else { 1.0 }
    }

    /// Threshold of adaptive sampling at which samples after the probes have on average [`EXTRA_PATHS`] paths
    /// beyond the first; `None` if the gain is below [`MIN_GAIN`].
    pub(super) fn worthy_threshold(&self) -> Option<f64> {
        let threshold = self.threshold();
        (self.gain(threshold) >= MIN_GAIN).then_some(threshold)
    }

    /// Threshold as in `Self::worthy_threshold`, whatever the gain, limited to [`THRESHOLDS`].
    fn threshold(&self) -> f64 {
        let [mut low, mut high] = THRESHOLDS;
        for _ in 0..STEPS {
            let middle = (low * high).sqrt();
            if self.extra_paths(middle) > EXTRA_PATHS {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}

/// Number of paths of a sample after the probes, in a pixel with this deviation, at this threshold.
fn paths(deviation: f64, threshold: f64) -> f64 {
    (deviation / threshold).round().clamp(1.0, MAX_PATHS.into())
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;

    use super::*;

    /// Deviations of pixels, one in a hundred of which has 900 times the variance of the others.
    fn spots() -> Deviations {
        let light = |pixel| if pixel % 100 == 0 { [1.0, 7.0] } else { [3.9, 4.1] };
        Deviations::new((0..1000).map(|pixel| (light(pixel), 4.0)))
    }

    #[test]
    fn the_threshold_gives_the_intended_number_of_paths() {
        // Ten of the 1,000 pixels have eleven paths, the others one.
        let threshold = spots().threshold();
        assert!((spots().0[0] / threshold - 11.5).abs() < 0.01, "{threshold}");
        assert!(
            spots().extra_paths(threshold) <= EXTRA_PATHS
                && spots().extra_paths(0.99 * threshold) > EXTRA_PATHS
        );
        assert!(spots().gain(threshold) > 5.0 && spots().worthy_threshold() == Some(threshold));
    }

    #[test]
    fn uniform_noise_measured_by_two_samples_gives_no_gain() {
        let light = |sample: u32| f64::from(hash(sample)) / f64::from(u32::MAX);
        let noisy = Deviations::new((0..1000).map(|pixel| ([light(2 * pixel), light(2 * pixel + 1)], 0.5)));
        let gain = noisy.gain(noisy.threshold());
        assert!(gain > 1.2 && gain < 1.4, "{gain}");
        assert_eq!(noisy.worthy_threshold(), None);
    }

    #[test]
    fn uniform_noise_has_one_path_per_sample() {
        let even = Deviations::new([([1.0, 3.0], 2.0); 10]);
        // Deviation 1: with more than one path every pixel has two.
        assert!((even.threshold() - 2.0 / 3.0).abs() < 1e-6);
        assert_eq!(
            [even.worthy_threshold(), Deviations::new([([1.0; 4], 1.0); 10]).worthy_threshold()],
            [None; 2]
        );
    }

    #[test]
    fn black_pixels_have_no_deviation() {
        assert_eq!(Deviations::new([([0.0; 4], 0.0), ([f64::INFINITY; 4], 1.0)]), Deviations(vec![0.0; 2]));
    }
}
