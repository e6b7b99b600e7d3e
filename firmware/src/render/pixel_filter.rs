//! Pixel filters. Positions of samples in a pixel are drawn from the filter, by its inverse cumulative
//! distribution function.

use photoncard_shared::message::Filter;

use crate::vector::min;

/// Number of intervals of a table of [`Quantiles`].
const STEPS: usize = 32;

/// Quantiles of a filter on one axis: entry `i` is the distance from the centre, pixels, within which the
/// fraction `i / STEPS` of the filter lies.
type Quantiles = [f32; STEPS + 1];

const GAUSSIAN: Quantiles = [
    0.0, 0.019535, 0.0391, 0.058725, 0.078441, 0.09828, 0.118275, 0.138461, 0.158875, 0.179557, 0.200552,
    0.221906, 0.243674, 0.265913, 0.288691, 0.312085, 0.336184, 0.36109, 0.386926, 0.413839, 0.442008,
    0.471656, 0.503062, 0.53659, 0.572723, 0.612123, 0.655743, 0.70502, 0.762293, 0.831789, 0.922522,
    1.060835, 1.5,
];

const BLACKMAN_HARRIS: Quantiles = [
    0.0, 0.00841, 0.016833, 0.025279, 0.033763, 0.042296, 0.050893, 0.059566, 0.068333, 0.077207, 0.086208,
    0.095354, 0.104667, 0.114169, 0.123889, 0.133856, 0.144105, 0.154677, 0.165621, 0.176995, 0.188868,
    0.201328, 0.214483, 0.228475, 0.24349, 0.259784, 0.277721, 0.297852, 0.321065, 0.348963, 0.384961,
    0.439136, 0.75,
];

/// Position of a sample along one axis, pixels from the left or upper border of its pixel. `number` is a
/// random number in [0, 1).
#[inline(always)]
pub(super) fn place(filter: Filter, number: f32) -> f32 {
    match filter {
        Filter::Box => number,
        Filter::Gaussian => 0.5 + offset(&GAUSSIAN, number),
        Filter::BlackmanHarris => 0.5 + offset(&BLACKMAN_HARRIS, number),
    }
}

/// Offset from the pixel's centre, pixels, interpolated linearly between the quantiles.
fn offset(quantiles: &Quantiles, number: f32) -> f32 {
    let signed = 2.0 * number - 1.0;
    let at = min(signed.abs() * STEPS as f32, STEPS as f32);
    let step = (at as usize).min(STEPS - 1);
    let [from, to] = [step, step + 1].map(|step| quantiles.get(step).copied().unwrap_or(0.0));
    libm::copysignf(from + (to - from) * (at - step as f32), signed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the distribution of positions with the integral of a filter. `value` is the filter as a
    /// function of the distance from the centre, `radius` its support.
    fn check(filter: Filter, radius: f64, value: impl Fn(f64) -> f64) {
        const CELLS: i32 = 3200;
        let integral = |cells: i32| -> f64 {
            (0..cells).map(|cell| value((f64::from(cell) + 0.5) / f64::from(CELLS) * radius)).sum()
        };
        let all = integral(CELLS);
        for cells in (0..=CELLS).step_by(CELLS as usize / 40) {
            let distance = f64::from(cells) / f64::from(CELLS) * radius;
            let expected = integral(cells) / all;
            let count = 20_000;
            let number = |i: i32| (i as f32 + 0.5) / count as f32;
            let is_within = |i: &i32| f64::from((place(filter, number(*i)) - 0.5).abs()) <= distance;
            let found = (0..count).filter(is_within).count() as f64 / f64::from(count);
            // Half of an interval, as positions are uniform between quantiles.
            assert!(
                (found - expected).abs() < 0.5 / STEPS as f64,
                "{filter:?} {distance}: {found} {expected}"
            );
        }
    }

    #[test]
    fn places_are_distributed_by_the_filter() {
        check(Filter::Box, 0.5, |_| 1.0);
        check(Filter::Gaussian, 1.5, |x| (-2.0 * x * x).exp());
        check(Filter::BlackmanHarris, 0.75, |x| {
            let wave = |k: f64| (std::f64::consts::TAU * k * x / 1.5).cos();
            0.35875 + 0.48829 * wave(1.0) + 0.14128 * wave(2.0) + 0.01168 * wave(3.0)
        });
    }

    #[test]
    fn filters_are_symmetric_and_bounded() {
        for (filter, radius) in [(Filter::Box, 0.5), (Filter::Gaussian, 1.5), (Filter::BlackmanHarris, 0.75)]
        {
            for i in 0..=256 {
                let number = i as f32 / 256.0;
                let [place, mirrored] = [number, 1.0 - number].map(|number| place(filter, number) - 0.5);
                assert!(
                    (place + mirrored).abs() < 1e-6 && place.abs() <= radius,
                    "{filter:?} {number}: {place}"
                );
            }
        }
    }
}
