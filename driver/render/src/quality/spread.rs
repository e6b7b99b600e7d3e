//! Relative mean squared differences between renders, without the pixels that differ most.

/// Fraction of the pixels that is omitted: the pixels with the greatest squared differences. Without the
/// omission, a few bright pixels would outweigh all others.
const LEFT_OUT: f64 = 0.02;
/// Radiance by which the difference in each pixel is divided: the radiance of the pixel, but at least the
/// median of the lit pixels, because noise in the dark is less visible.
pub(super) struct Levels {
    levels: Vec<f64>,
    median: Option<f64>,
}

impl Levels {
    /// Creates the levels of pixels with these radiances; all are 1 for a black picture.
    pub(super) fn new(radiances: impl IntoIterator<Item = f64>) -> Self {
        let radiances: Vec<f64> = radiances.into_iter().collect();
        let mut lit: Vec<f64> = radiances.iter().copied().filter(|radiance| *radiance > 0.0).collect();
        let middle = lit.len() / 2;
        let median = (!lit.is_empty()).then(|| *lit.select_nth_unstable_by(middle, f64::total_cmp).1);
        let least = median.unwrap_or(1.0);
        Self { levels: radiances.into_iter().map(|radiance| radiance.max(least)).collect(), median }
    }

    /// Median radiance of the lit pixels; `None` for a black picture.
    pub(super) fn median(&self) -> Option<f64> {
        self.median
    }

    /// Mean of `((a - b) / level)^2` over the pixels, without the fraction `LEFT_OUT` with the greatest
    /// values.
    pub(super) fn mean_square(
        &self,
        a: impl IntoIterator<Item = f64>,
        b: impl IntoIterator<Item = f64>,
    ) -> f64 {
        let pairs = a.into_iter().zip(b).zip(&self.levels);
        let mut squares: Vec<f64> = pairs.map(|((a, b), level)| ((a - b) / level).powi(2)).collect();
        squares.sort_by(f64::total_cmp);
        let kept = squares.len() - (LEFT_OUT * squares.len() as f64) as usize;
        squares.iter().take(kept).sum::<f64>() / kept.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_relative_to_the_radiance_and_in_the_dark_to_the_median() {
        let levels = Levels::new([4.0, 8.0, 4.0, 0.01, 1.0]);
        let square = levels.mean_square([5.0, 8.0, 3.0, 2.01, 1.0], [4.0, 4.0, 4.0, 0.01, 1.0]);
        assert!((square - (0.0625 + 0.25 + 0.0625 + 0.25) / 5.0).abs() < 1e-12, "{square}");
        assert_eq!(Levels::new([0.0, 0.0]).mean_square([0.0, 0.0], [0.0, 0.0]), 0.0);
        assert_eq!(Levels::new([]).mean_square([], []), 0.0);
    }

    #[test]
    fn the_brightest_pixels_are_omitted() {
        let levels = Levels::new([1.0; 100]);
        let mut noisy = [1.1; 100];
        noisy[7] = 1e6;
        let square = levels.mean_square(noisy, [1.0; 100]);
        assert!((square - 0.01 * 97.0 / 98.0).abs() < 1e-3, "{square}");
    }
}
