//! Successive discrete choices by a single random number. Each choice rescales the number for the next.

use photoncard_shared::message::Fault;

use crate::sampler::{hash, unit_interval};
use crate::vector::{max, min};

/// Random number in [0, 1) that makes several choices one after another.
///
/// A choice of probability p uses up -log2(p) random bits of the number. Bits from `dither` replace them, so
/// that later choices have full resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fraction {
    value: f32,
    dither: u32,
}

/// Resolution of a random number before the first choice: 2^-24.
const STEP: f32 = 1.0 / 16_777_216.0;
/// Maximum value of a `Fraction`.
const BELOW_ONE: f32 = 1.0 - STEP;

impl Fraction {
    /// Creates a fraction from a random number `value` in [0, 1) and 32 further random bits.
    #[inline(always)]
    pub fn new(value: f32, dither: u32) -> Self {
        Self { value, dither }
    }

    /// Value in [0, 1).
    #[inline(always)]
    pub fn value(self) -> f32 {
        self.value
    }

    /// Maps the interval `lower..lower + width` linearly to [0, 1). The interval must contain the value.
    #[inline(always)]
    #[must_use]
    pub fn within(self, lower: f32, width: f32) -> Self {
        let dither = hash(self.dither.wrapping_add(0x9e37_79b9));
        let rest = (self.value - lower) + STEP * unit_interval(dither);
        Self { value: min(max(rest / width, 0.0), BELOW_ONE), dither }
    }
}

/// Result of [`choose`]: the item's index and probability, and the rescaled fraction.
pub(super) struct Chosen {
    pub(super) index: u32,
    pub(super) probability: f32,
    pub(super) rest: Fraction,
}

/// Value of a threshold that means a probability of 1: 2^32.
const ALL: f32 = 4_294_967_296.0;

/// Chooses one of `count` items by a cumulative distribution function. `threshold(i)` must return the
/// function's value for item `i`, the sum of the probabilities of items 0 to `i`, in units of 2^-32.
pub(super) fn choose(
    fraction: Fraction,
    count: u32,
    mut threshold: impl FnMut(u32) -> Result<u32, Fault>,
) -> Result<Chosen, Fault> {
    let target = (fraction.value * ALL) as u32;
    // Binary search of the first threshold that is not below the target; the last threshold is 2^32 - 1.
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

/// Probability with which [`choose`] chooses item `index`.
pub(super) fn probability(
    index: u32,
    mut threshold: impl FnMut(u32) -> Result<u32, Fault>,
) -> Result<f32, Fault> {
    share(index, &mut threshold).map(|(_, width)| width)
}

/// Interval of item `index` in the cumulative distribution function: its lower end, in units of 2^-32, and
/// its width, 0 to 1.
fn share(index: u32, threshold: &mut impl FnMut(u32) -> Result<u32, Fault>) -> Result<(u32, f32), Fault> {
    let lower = match index.checked_sub(1) {
        Some(before) => threshold(before)?,
        None => 0,
    };
    // An unsound card image may hold a descending table.
    let width = threshold(index)?.saturating_sub(lower).max(1);
    Ok((lower, width as f32 * (1.0 / ALL)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remainder_of_a_fraction_keeps_its_resolution() {
        // The interval has ten steps of the initial number, but the rescaled fraction takes more than ten
        // values, uniformly.
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
    fn thresholds_choose_each_item_by_its_share() {
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
