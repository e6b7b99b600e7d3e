//! Discrete probability distributions in integers: cumulative probabilities in units of 2^-32.

/// Number of units in the probability 1: 2^32.
pub(super) const ALL: f64 = 4_294_967_296.0;

/// Computes cumulative probabilities in proportion to weights, in units of 2^-32. Each probability is at
/// least one unit, so that every index can be chosen. The last threshold is 2^32 - 1. If all weights are 0,
/// the probabilities are equal.
pub(crate) fn thresholds(weights: &[f64]) -> Vec<u32> {
    let total: f64 = weights.iter().sum();
    let spare = ALL - 1.0 - weights.len() as f64;
    let mut sum = 0.0;
    let mut thresholds: Vec<u32> = weights
        .iter()
        .zip(1_u32..)
        .map(|(weight, index)| {
            sum += weight;
            let share = if total > 0.0 { sum / total } else { f64::from(index) / weights.len() as f64 };
            ((share * spare) as u32).saturating_add(index)
        })
        .collect();
    if let Some(last) = thresholds.last_mut() {
        *last = u32::MAX;
    }
    thresholds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_weights_and_none_is_empty() {
        let thresholds = thresholds(&[1.0, 1e-30, 3.0]);
        assert!((thresholds[0] as f64 / ALL - 0.25).abs() < 1e-8);
        assert!(thresholds[1] > thresholds[0]);
        assert_eq!(thresholds[2], u32::MAX);
    }

    #[test]
    fn shares_without_weights_are_equal() {
        let shares = thresholds(&[0.0; 4]);
        assert_eq!(shares.iter().map(|share| (share >> 24) + 1).collect::<Vec<_>>(), [64, 128, 192, 256]);
    }
}
