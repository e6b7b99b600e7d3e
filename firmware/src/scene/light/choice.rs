//! Choices by one random number after another's choice has used a part of it.

use photoncard_shared::message::Fault;

use crate::sampler::{hash, unit_interval};
use crate::vector::{max, min};

/// A number in [0, 1) that chooses between shares, and again within the share that it fell in.
///
/// What is left of it after a choice has fewer digits, as many as the share is small. They are filled up with random ones, so
/// that a small share is chosen from as finely as a large one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fraction {
    value: f32,
    dither: u32,
}

/// A step of the numbers that fractions begin as.
const STEP: f32 = 1.0 / 16_777_216.0;
/// The greatest number below 1.
const BELOW_ONE: f32 = 1.0 - STEP;

impl Fraction {
    /// A number in [0, 1), and random bits that belong to it.
    #[inline(always)]
    pub fn new(value: f32, dither: u32) -> Self {
        Self { value, dither }
    }

    /// The number.
    #[inline(always)]
    pub fn value(self) -> f32 {
        self.value
    }

    /// What is left of a number that has fallen in the share of this width from `lower` on.
    #[inline(always)]
    #[must_use]
    pub fn within(self, lower: f32, width: f32) -> Self {
        let dither = hash(self.dither.wrapping_add(0x9e37_79b9));
        let rest = (self.value - lower) + STEP * unit_interval(dither);
        Self { value: min(max(rest / width, 0.0), BELOW_ONE), dither }
    }
}

/// One of several, as cumulated thresholds of 2^32 choose it.
pub(super) struct Chosen {
    pub(super) index: u32,
    pub(super) probability: f32,
    pub(super) rest: Fraction,
}

/// All shares together.
const ALL: f32 = 4_294_967_296.0;

/// The one of `count` in whose share the number falls; `threshold` tells the upper ends.
pub(super) fn choose(
    fraction: Fraction,
    count: u32,
    mut threshold: impl FnMut(u32) -> Result<u32, Fault>,
) -> Result<Chosen, Fault> {
    let target = (fraction.value * ALL) as u32;
    // The first whose threshold is not below the target; the last one's is 2^32 - 1.
    let (mut low, mut high) = (0, count.saturating_sub(1));
    while low < high {
        let middle = low + (high - low) / 2;
        if threshold(middle)? < target {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    let (lower, width) = share(low, &mut threshold)?;
    let rest = fraction.within(lower as f32 * (1.0 / ALL), width);
    Ok(Chosen { index: low, probability: width, rest })
}

/// The probability that [`choose`] chooses this one.
pub(super) fn probability(
    index: u32,
    mut threshold: impl FnMut(u32) -> Result<u32, Fault>,
) -> Result<f32, Fault> {
    share(index, &mut threshold).map(|(_, width)| width)
}

/// The lower end of a share, of 2^32, and its width, of 1.
fn share(index: u32, threshold: &mut impl FnMut(u32) -> Result<u32, Fault>) -> Result<(u32, f32), Fault> {
    let lower = match index.checked_sub(1) {
        Some(before) => threshold(before)?,
        None => 0,
    };
    // An unsound table could hold anything.
    let width = threshold(index)?.saturating_sub(lower).max(1);
    Ok((lower, width as f32 * (1.0 / ALL)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_a_number_is_as_fine_as_it_was() {
        // A share of ten steps: what is left of them takes more than ten values, evenly.
        let (lower, width) = (0.5, 10.0 * STEP);
        let mut sums = [0.0_f64; 2];
        for step in 0..10 {
            for dither in 0..1000 {
                let rest = Fraction::new(0.5 + step as f32 * STEP, dither).within(lower, width).value();
                assert!((0.0..1.0).contains(&rest));
                assert!((rest * 10.0) as u32 == step || rest * 10.0 - step as f32 <= 1.001);
                sums[0] += f64::from(rest) / 1e4;
                sums[1] += f64::from(rest * rest) / 1e4;
            }
        }
        assert!((sums[0] - 0.5).abs() < 2e-3 && (sums[1] - 1.0 / 3.0).abs() < 2e-3, "{sums:?}");
    }

    #[test]
    fn thresholds_choose_each_by_its_share() {
        let thresholds = [1 << 30, (1 << 30) + 4, 3 << 30, u32::MAX];
        let threshold = |index: u32| Ok(thresholds[index as usize]);
        for (value, expected) in [(0.0, 0), (0.2, 0), (0.3, 2), (0.74, 2), (0.76, 3), (BELOW_ONE, 3)] {
            let chosen = choose(Fraction::new(value, 1), 4, threshold).unwrap();
            assert_eq!(chosen.index, expected, "{value}");
            assert_eq!(chosen.probability, probability(expected, threshold).unwrap());
        }
        let sum: f32 = (0..4).map(|index| probability(index, threshold).unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
    }
}
