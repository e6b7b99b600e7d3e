//! Adaptive sampling: if the first samples of a pixel differ, its later samples have several paths each.
//!
//! The first [`PROBES`] samples of a pixel are its probes. Each later sample is the mean of `k` paths,
//!
//! ```text
//! k = s / (t sqrt(L)), rounded, 1 to 16
//! ```
//!
//! where `L` is the mean of the probes' light over samples and channels, `s^2` is the variance of that light
//! over samples, averaged over channels, and `t` is the frame's threshold. `k` is proportional to `s`, and to
//! the visibility of noise under a tone curve, which is about `1 / sqrt(L)`.
//!
//! An estimate whose number of samples depends on these samples is biased (Kirk, Arvo 1991, *Unbiased
//! sampling techniques for image synthesis*). Probes therefore have a fixed weight, half of a sample's, and
//! later paths have patterns of their own
//! ([`PixelSample::stratified`](crate::render::PixelSample::stratified)): the expectation of later paths
//! depends neither on `k` nor on the probes.
//!
//! The samples of a picture can be divided among several frames, with or without adaptive sampling: a path is
//! a function of pixel, sample and `k`, and `k` is a function of the pixel's probes. A frame of later samples
//! traces the probes again.

use glam::Vec3;
use photoncard_shared::message::{FrameParameters, MAX_PATHS, PROBES, WEIGHT_OF_PROBE};

use crate::vector::sqrt;

/// Returns true if the frame has samples whose number of paths depends on the probes.
pub(super) fn needs_probes(frame: &FrameParameters) -> bool {
    frame.adaptive_threshold.is_some() && frame.first_sample.saturating_add(frame.samples) > PROBES
}

/// Number of paths per sample of a pixel, for samples after the probes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Paths(u8);

impl Paths {
    pub(super) const ONE: Self = Self(1);

    /// Number of paths per sample.
    pub(super) fn number(self) -> u8 {
        self.0
    }

    /// Paths with this number per sample, at least 1.
    pub(super) fn of_number(number: u8) -> Self {
        Self(number.max(1))
    }

    /// Number of paths of sample number `sample`: 1 for a probe.
    pub(super) fn of_sample(self, sample: u32) -> u32 {
        if sample < PROBES { 1 } else { self.0.into() }
    }

    /// Index of path `path` of sample `sample` among all paths of the pixel.
    pub(super) fn index(self, sample: u32, path: u32) -> u32 {
        let later = sample.saturating_sub(PROBES).wrapping_mul(self.0.into());
        sample.min(PROBES).wrapping_add(later).wrapping_add(path)
    }

    /// Weight of each path of sample `sample` in the pixel's sum.
    pub(super) fn weight(self, frame: &FrameParameters, sample: u32) -> f32 {
        match frame.adaptive_threshold {
            None => 1.0,
            Some(_) if sample < PROBES => WEIGHT_OF_PROBE,
            Some(_) => 1.0 / f32::from(self.0),
        }
    }
}

/// Sums of the light, W/(sr m^2), and of the squared light of a pixel's probes, for each channel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probes {
    sum: Vec3,
    squares: Vec3,
}

impl Probes {
    pub(super) const NONE: Self = Self { sum: Vec3::ZERO, squares: Vec3::ZERO };

    /// Adds the light of a probe, W/(sr m^2).
    pub(super) fn add(&mut self, light: Vec3) {
        self.sum += light;
        self.squares += light * light;
    }

    /// Number of paths per sample after the probes: `s / (threshold sqrt(L))`, rounded and limited to 1 to
    /// 16. `L` is the mean of the light of all probes, `s` its standard deviation. The threshold is in
    /// W^(1/2)/(sr^(1/2) m).
    pub(super) fn paths(&self, threshold: f32) -> Paths {
        let probes = PROBES as f32;
        let mean = self.sum.element_sum() / (3.0 * probes);
        let variance = (self.squares - self.sum * self.sum / probes).element_sum() / (3.0 * (probes - 1.0));
        if !(mean > 0.0 && variance > 0.0) {
            return Paths::ONE;
        }
        // The conversion saturates.
        let paths = sqrt(variance / mean) / threshold + 0.5;
        Paths((paths as u32).clamp(1, MAX_PATHS) as u8)
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::chip::test_frame::frame;
    use crate::render::PixelSample;
    use crate::sampler::Dimension;

    #[test]
    fn path_indices_of_all_samples_are_consecutive_from_zero() {
        for paths in 1..=16 {
            let paths = Paths(paths);
            let indices = (0..20)
                .flat_map(|sample| (0..paths.of_sample(sample)).map(move |path| paths.index(sample, path)));
            let indices: Vec<u32> = indices.collect();
            assert!(indices.iter().copied().eq(0..indices.len() as u32), "{paths:?} {indices:?}");
        }
    }

    /// Estimates the lit fraction of a pixel whose left part, up to the abscissa `coverage` in [0, 1], is
    /// lit. Returns the estimate and the number of paths.
    fn lit_share(frame: &FrameParameters, pixel: u32, coverage: f32) -> (f64, u32) {
        let mut probes = Probes::NONE;
        let [mut sum, mut weights] = [0.0, 0.0];
        let mut count = 0;
        let mut paths = Paths::ONE;
        for sample in 0..frame.samples {
            for path in 0..paths.of_sample(sample) {
                let at = PixelSample { x: pixel, y: 0, sample: paths.index(sample, path) };
                let (pattern, index) = at.stratified(frame, Dimension::Pixel);
                let light = if pattern.point(index)[0] < coverage { 1.0 } else { 0.0 };
                let weight = paths.weight(frame, sample);
                sum += f64::from(light * weight);
                weights += f64::from(weight);
                count += 1;
                if sample < PROBES {
                    probes.add(Vec3::splat(light));
                }
            }
            if sample + 1 == PROBES {
                paths = probes.paths(frame.adaptive_threshold.unwrap());
            }
        }
        (sum / weights, count)
    }

    /// If probes and later samples shared one stratified pattern, later points would lie in the strata that
    /// the probes left free: a pixel that is lit up to an eighth of its width would be a third too bright.
    #[test]
    fn the_choice_of_the_number_of_paths_has_no_bias() {
        const PIXELS: u32 = 20_000;
        for samples in [5, 8, 12, 24] {
            let frame = FrameParameters { samples, adaptive_threshold: Some(0.05), ..frame() };
            for coverage in [0.0625, 0.125, 0.3, 0.5, 0.875] {
                let shares: Vec<(f64, u32)> =
                    (0..PIXELS).map(|pixel| lit_share(&frame, pixel, coverage)).collect();
                let number = f64::from(PIXELS);
                let mean = shares.iter().map(|(share, _)| share).sum::<f64>() / number;
                let variance = shares.iter().map(|(share, _)| (share - mean).powi(2)).sum::<f64>() / number;
                let error = (variance / number).sqrt();
                assert!(
                    (mean - f64::from(coverage)).abs() <= 4.0 * error,
                    "{samples} {coverage}: {mean} {error}"
                );
                assert!(shares.iter().any(|&(_, count)| count > samples), "{samples} {coverage}");
            }
        }
    }

    #[test]
    fn paths_are_in_proportion_to_the_deviation() {
        let paths = |lights: [f32; 4], threshold: f32| {
            let mut probes = Probes::NONE;
            lights.into_iter().for_each(|light| probes.add(Vec3::splat(light)));
            probes.paths(threshold)
        };
        // Mean 4, variance 16 / 3.
        let lights = [2.0, 2.0, 6.0, 6.0];
        let ratio = (4.0_f32 / 3.0).sqrt();
        assert_eq!([1.0, 4.0, 9.0, 99.0].map(|k| paths(lights, ratio / k).0), [1, 4, 9, 16]);
        assert_eq!(paths(lights, 10.0), Paths::ONE);
        assert_eq!(paths([0.0; 4], 1e-3), Paths::ONE);
        assert_eq!(paths([1.0; 4], 1e-3), Paths::ONE);
        assert_eq!(paths([0.0, 0.0, 0.0, f32::INFINITY], 1.0), Paths::ONE);
    }
}
