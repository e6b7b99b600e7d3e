//! Stratified sample of a picture's tiles, and estimates of totals from it.
//!
//! Tiles are sorted along the Z-order curve of their centres and divided into as many strata (*stretches*) as
//! there are tiles to choose. The sizes of strata differ by at most one tile. A hash chooses one tile of each
//! stretch, and this tile represents the stretch. Whatever the shape of the tiles, the sample is spread over
//! the picture, does not alias with regular patterns of the scene, and is reproducible.

use std::fmt;
use std::str::FromStr;

use photoncard_firmware::sampler::hash;
use photoncard_shared::message::Tile;
use serde::{Deserialize, Serialize};

/// Fraction of a picture's tiles that is rendered, such as `1/17`, or `1` for all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleRate {
    numerator: u32,
    denominator: u32,
}

impl SampleRate {
    /// All tiles.
    pub const ALL: Self = Self { numerator: 1, denominator: 1 };

    /// Fraction `numerator / denominator`; `None` unless it is above 0 and at most 1.
    pub const fn new(numerator: u32, denominator: u32) -> Option<Self> {
        if numerator == 0 || numerator > denominator { None } else { Some(Self { numerator, denominator }) }
    }

    /// Number of tiles to render out of `total`: the fraction, rounded up, but at least `least` and at most
    /// `total`.
    pub(crate) fn count(self, total: usize, least: usize) -> usize {
        let share = (total as u64 * u64::from(self.numerator)).div_ceil(u64::from(self.denominator));
        (share as usize).max(least).min(total)
    }
}

impl fmt::Display for SampleRate {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.numerator, self.denominator)
    }
}

impl FromStr for SampleRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (numerator, denominator) = text.split_once('/').unwrap_or((text, "1"));
        let rate = numerator.parse().ok().zip(denominator.parse().ok());
        rate.and_then(|(numerator, denominator)| Self::new(numerator, denominator)).ok_or_else(|| {
            format!("{text:?} is no share of the tiles; use a fraction above 0 and up to 1, such as 1/17")
        })
    }
}

/// A tile chosen for a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Chosen {
    pub(crate) tile: Tile,
    /// Weight of the tile: number of tiles in its stretch, including itself.
    pub(crate) stands_for: usize,
}

/// Chooses `count` of the tiles, spread over the picture, or all tiles if there are fewer. Returns them in
/// the picture's order.
pub(crate) fn choose(tiles: &[Tile], count: usize) -> Vec<Chosen> {
    let count = count.min(tiles.len());
    let mut sorted = tiles.to_vec();
    let middle = |tile: &Tile| (2 * tile.x + tile.width, 2 * tile.y + tile.height);
    sorted.sort_by_key(|tile| {
        let (x, y) = middle(tile);
        (spread_bits(x) | spread_bits(y) << 1, tile.id)
    });
    let bound = |stretch: usize| stretch * sorted.len() / count;
    let mut chosen: Vec<Chosen> = (0..count)
        .map(|stretch| {
            let stretch_tiles = &sorted[bound(stretch)..bound(stretch + 1)];
            let tile = stretch_tiles[hash(stretch as u32) as usize % stretch_tiles.len()];
            Chosen { tile, stands_for: stretch_tiles.len() }
        })
        .collect();
    chosen.sort_by_key(|chosen| chosen.tile.id);
    chosen
}

/// Moves bit `i` of a number to bit `2 i`, with zeros at the odd positions: half of a Morton code.
fn spread_bits(number: u32) -> u64 {
    (0..32).map(|bit| (u64::from(number) >> bit & 1) << (2 * bit)).sum()
}

/// Estimate of a sum over all tiles, with its confidence interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Estimated sum.
    pub value: f64,
    /// Half-width of the 95 % confidence interval; 0 if all tiles were rendered.
    pub half_width: f64,
}

impl Estimate {
    /// Estimates a population's sum from a sample. Each pair is a value and its weight `w`, the number of
    /// members that it represents.
    ///
    /// The estimate is the sum of value times weight, `+- t s sqrt(sum w (w - 1))`, where `s` is the standard
    /// deviation of the `n` values and `t` is Student's t for `n - 1` degrees of freedom. With equal weights
    /// this is the interval of a simple random sample of a finite population. A sample that is spread over
    /// the picture has smaller errors than a random one, so that the interval tends to be too wide. The
    /// half-width is infinite if the only value has a weight above 1.
    pub(crate) fn of_total(sample: &[(f64, usize)]) -> Self {
        let value = sample.iter().map(|&(value, stands_for)| value * stands_for as f64).sum();
        let spread =
            sample.iter().map(|&(_, weight)| (weight * weight.saturating_sub(1)) as f64).sum::<f64>();
        if spread == 0.0 {
            return Self { value, half_width: 0.0 };
        }
        if sample.len() < 2 {
            return Self { value, half_width: f64::INFINITY };
        }
        let count = sample.len() as f64;
        let mean = sample.iter().map(|(value, _)| value).sum::<f64>() / count;
        let squares: f64 = sample.iter().map(|(value, _)| (value - mean).powi(2)).sum();
        let error = (squares / (count - 1.0) * spread).sqrt();
        Self { value, half_width: students_t(sample.len() - 1) * error }
    }

    /// Value with the ends of its interval.
    pub(crate) fn with_ends(self) -> Ratio {
        let Self { value, half_width } = self;
        Ratio { value, lower: value - half_width, upper: value + half_width }
    }

    /// Multiplies the estimate by `factor`, for another unit.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self { value: self.value * factor, half_width: self.half_width * factor.abs() }
    }
}

/// Ratio of two estimates, with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ratio {
    pub value: f64,
    pub lower: f64,
    pub upper: f64,
}

impl Ratio {
    /// Ratio of an estimate to itself.
    pub(super) const ONE: Self = Self { value: 1.0, lower: 1.0, upper: 1.0 };

    /// Ratio of two independent estimates. If `n` and `d` are the relative half-widths of numerator and
    /// denominator, the interval is `ratio * exp(+-sqrt(n^2 + d^2 + further^2))`. `further` is the half-width
    /// of a third, independent error of the ratio's logarithm.
    pub(super) fn new(numerator: Estimate, denominator: Estimate, further: f64) -> Self {
        let relative = |estimate: Estimate| estimate.half_width / estimate.value;
        let spread = relative(numerator).hypot(relative(denominator)).hypot(further).exp();
        let value = numerator.value / denominator.value;
        Self { value, lower: value / spread, upper: value * spread }
    }
}

/// Ratio of the sums of two quantities of the same members. Each element has both quantities of a member and
/// its weight. The interval is that of the residuals `n - ratio d` (Cochran 1977, *Sampling Techniques*,
/// chapter 6), so that what varies alike in both cancels.
pub(super) fn ratio_of_sums(sample: &[(f64, f64, usize)]) -> Ratio {
    let sum = |of: fn(&(f64, f64, usize)) -> f64| -> f64 {
        sample.iter().map(|member| of(member) * member.2 as f64).sum()
    };
    let denominator = sum(|&(_, denominator, _)| denominator);
    let value = sum(|&(numerator, ..)| numerator) / denominator;
    let residuals: Vec<_> = sample
        .iter()
        .map(|&(numerator, denominator, weight)| (numerator - value * denominator, weight))
        .collect();
    let half_width = Estimate::of_total(&residuals).half_width / denominator.abs();
    Ratio { value, lower: value - half_width, upper: value + half_width }
}

/// Product of the ratios `a / b` and `c / d` of sums over the same members. Each element has `[a, b, c, d]`
/// of a member and its weight. The interval is that of the first-order change of the product's logarithm by
/// each member, so that what varies alike in several sums cancels.
pub(super) fn product_of_ratios(sample: &[([f64; 4], usize)]) -> Ratio {
    let sum = |index: usize| sample.iter().map(|(values, weight)| values[index] * *weight as f64).sum();
    let sums: [f64; 4] = [0, 1, 2, 3].map(sum);
    let value = sums[0] / sums[1] * sums[2] / sums[3];
    let change = |values: &[f64; 4]| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|index| values[index] / sums[index]);
        a - b + c - d
    };
    let changes: Vec<_> = sample.iter().map(|(values, weight)| (change(values), *weight)).collect();
    let spread = Estimate::of_total(&changes).half_width.exp();
    Ratio { value, lower: value / spread, upper: value * spread }
}

/// Greatest of several numbers, each with its interval. The interval reaches from the greatest lower end to
/// the greatest upper end. Its upper end is exact; the lower one is too high, if several numbers are about as
/// great.
pub(super) fn greatest(numbers: impl IntoIterator<Item = Ratio>) -> Ratio {
    let none = Ratio { value: 0.0, lower: 0.0, upper: 0.0 };
    numbers.into_iter().fold(none, |greatest, number| Ratio {
        value: greatest.value.max(number.value),
        lower: greatest.lower.max(number.lower),
        upper: greatest.upper.max(number.upper),
    })
}

/// Half-width of the 95 % confidence interval of a statistic, by the jackknife (Tukey 1958). Element `i` of
/// `without_one` is the statistic of all observations except observation `i`. The half-width is infinite for
/// fewer than two observations.
pub(super) fn jackknife_half_width(without_one: &[f64]) -> f64 {
    if without_one.len() < 2 {
        return f64::INFINITY;
    }
    let count = without_one.len() as f64;
    let mean = without_one.iter().sum::<f64>() / count;
    let squares: f64 = without_one.iter().map(|value| (value - mean).powi(2)).sum();
    students_t(without_one.len() - 1) * (squares * (count - 1.0) / count).sqrt()
}

/// 97.5 % quantiles of Student's t-distribution with one to ten degrees of freedom.
const FEW: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];

/// 97.5 % quantile of Student's t-distribution. Above ten degrees of freedom it is computed by the
/// Cornish-Fisher expansion.
fn students_t(degrees: usize) -> f64 {
    const Z: f64 = 1.959_964;
    FEW.get(degrees.wrapping_sub(1)).copied().unwrap_or_else(|| {
        let degrees = degrees as f64;
        let first = (Z.powi(3) + Z) / (4.0 * degrees);
        let second = (5.0 * Z.powi(5) + 16.0 * Z.powi(3) + 3.0 * Z) / (96.0 * degrees * degrees);
        let third =
            (3.0 * Z.powi(7) + 19.0 * Z.powi(5) + 17.0 * Z.powi(3) - 15.0 * Z) / (384.0 * degrees.powi(3));
        Z + first + second + third
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use photoncard_cards::scheduler::{GatherOrder, tiles};
    use photoncard_picture::film::Window;

    #[test]
    fn a_sample_rate_is_parsed_and_counts_tiles() {
        for (text, written) in [("1/17", "1/17"), ("1", "1/1"), ("3/4", "3/4"), ("5/5", "5/5")] {
            assert_eq!(text.parse::<SampleRate>().unwrap().to_string(), written);
        }
        for text in ["0/5", "3/2", "1/0", "0", "2", "", "/", "1/", "a/b", "-1/2", "0.5", "1/2/3"] {
            let error = text.parse::<SampleRate>().unwrap_err();
            assert!(error.contains("1/17") && error.contains(&format!("{text:?}")), "{error}");
        }
        let rate = SampleRate::new(1, 17).unwrap();
        assert_eq!([rate.count(1024, 15), rate.count(64, 15), rate.count(4, 15)], [61, 15, 4]);
    }

    #[test]
    fn a_sample_is_spread_over_the_picture_whatever_the_shape_of_the_tiles() {
        let window = Window::full(512, 512);
        for order in [GatherOrder::Naive, GatherOrder::Sort] {
            let tiles = tiles(window, 16, order);
            let chosen = choose(&tiles, 64);
            assert_eq!(chosen.len(), 64);
            assert!(chosen.windows(2).all(|pair| pair[0].tile.id < pair[1].tile.id));
            for quarter in 0..4 {
                let is_inside = |Chosen { tile, .. }: &&Chosen| tile.x / 256 + tile.y / 256 * 2 == quarter;
                assert_eq!(chosen.iter().filter(is_inside).count(), 16, "{order:?}");
            }
            let all = tiles.iter().map(|&tile| Chosen { tile, stands_for: 1 });
            assert_eq!(choose(&tiles, tiles.len() + 1), all.collect::<Vec<_>>());
        }
    }

    #[test]
    fn weights_of_a_sample_sum_to_all_tiles_and_none_exceeds_its_stretch() {
        let tiles = tiles(Window::full(100, 70), 16, GatherOrder::Sort);
        for count in 1..=tiles.len() {
            let stands_for: Vec<usize> = choose(&tiles, count).iter().map(|tile| tile.stands_for).collect();
            assert_eq!(stands_for.len(), count);
            assert_eq!(stands_for.iter().sum::<usize>(), tiles.len());
            assert!(stands_for.iter().all(|&stands_for| stands_for.abs_diff(tiles.len() / count) <= 1));
        }
        let estimate = Estimate::of_total(&[(1.0, 2), (3.0, 1)]);
        assert_eq!(estimate.value, 5.0);
    }

    /// Totals of uniform, skewed and two-valued populations are estimated repeatedly from stretches of a
    /// shuffled order.
    #[test]
    fn the_interval_covers_the_total_of_a_population_at_its_confidence_level() {
        let uniform = |index: u32| (f64::from(hash(index)) + 0.5) / 4_294_967_296.0;
        let shapes: [fn(f64) -> f64; 3] = [|u| 5.0 + u, |u| -u.ln(), |u| if u < 0.3 { 0.0 } else { 1.0 }];
        for (shape, (total, count)) in
            shapes.into_iter().flat_map(|shape| [(200, 40), (60, 40)].map(|sizes| (shape, sizes)))
        {
            let population: Vec<f64> = (0..total as u32).map(|index| shape(uniform(index + 7000))).collect();
            let sum: f64 = population.iter().sum();
            let covered = (0..1000_u32).filter(|draw| {
                let mut order: Vec<usize> = (0..total).collect();
                order.sort_by_key(|&index| hash(hash(*draw + 1) ^ index as u32));
                let bound = |stretch: usize| stretch * total / count;
                let one_of =
                    |stretch: usize| (population[order[bound(stretch)]], bound(stretch + 1) - bound(stretch));
                let estimate = Estimate::of_total(&(0..count).map(one_of).collect::<Vec<_>>());
                (estimate.value - sum).abs() <= estimate.half_width
            });
            let share = covered.count() as f64 / 1000.0;
            assert!((0.91..0.985).contains(&share), "{count} of {total}: {share}");
        }
    }

    #[test]
    fn the_jackknife_interval_of_a_mean_is_its_students_t_interval() {
        let values: [f64; 5] = [1.0, 4.0, 2.0, 8.0, 5.0];
        let sum: f64 = values.iter().sum();
        let without: Vec<f64> = values.iter().map(|value| (sum - value) / 4.0).collect();
        let squares: f64 = values.iter().map(|value| (value - sum / 5.0).powi(2)).sum();
        let expected = 2.776 * (squares / 4.0 / 5.0).sqrt();
        assert!((jackknife_half_width(&without) - expected).abs() < 1e-12);
        assert_eq!(jackknife_half_width(&without[..1]), f64::INFINITY);
    }

    #[test]
    fn a_ratio_combines_the_uncertainties_of_its_estimates() {
        let estimate = |value, relative: f64| Estimate { value, half_width: relative * value };
        let ratio = Ratio::new(estimate(6.0, 0.3), estimate(2.0, 0.4), 1.2);
        assert_eq!(ratio.value, 3.0);
        assert!(((ratio.upper / 3.0).ln() - 1.3).abs() < 1e-12);
        assert!(((ratio.lower / 3.0).ln() + 1.3).abs() < 1e-12);
        let exact = Ratio::new(estimate(6.0, 0.0), estimate(2.0, 0.0), 0.0);
        assert_eq!([exact.lower, exact.upper], [3.0, 3.0]);
    }

    #[test]
    fn what_varies_alike_cancels_in_a_ratio_of_the_same_members() {
        let members = |noise: f64| -> Vec<_> {
            let member = |index: u32| {
                let size = f64::from(hash(index) % 100 + 1);
                (3.0 * size + noise * f64::from(index % 2), size, 17)
            };
            (0..40).map(member).collect()
        };
        let proportional = ratio_of_sums(&members(0.0));
        assert!((proportional.value - 3.0).abs() < 1e-12 && proportional.upper - proportional.lower < 1e-9);
        let noisy = ratio_of_sums(&members(10.0));
        assert!(noisy.lower < noisy.value && noisy.value < noisy.upper && noisy.upper < 1.1 * noisy.value);
        let all: Vec<_> = members(10.0).into_iter().map(|(n, d, _)| (n, d, 1)).collect();
        assert_eq!(ratio_of_sums(&all).lower, ratio_of_sums(&all).upper);
    }

    #[test]
    fn the_interval_of_a_product_is_that_of_a_ratio_if_the_other_ratio_is_one() {
        let member = |index: u32| (f64::from(hash(index) % 100 + 50), f64::from(hash(index + 40) % 100 + 50));
        let pairs: Vec<_> = (0..40).map(member).collect();
        let ratios: Vec<_> = pairs.iter().map(|&(a, b)| (a, b, 17)).collect();
        let products: Vec<_> = pairs.iter().map(|&(a, b)| ([a, b, b, b], 17)).collect();
        let (ratio, product) = (ratio_of_sums(&ratios), product_of_ratios(&products));
        assert!((product.value - ratio.value).abs() < 1e-12);
        let width = (ratio.upper - ratio.lower) / (2.0 * ratio.value);
        assert!(((product.upper / product.value).ln() - width).abs() < 1e-12);
        let changing: Vec<_> = pairs.iter().map(|&(a, b)| ([a, b, b, a], 17)).collect();
        let one = product_of_ratios(&changing);
        assert!((one.value - 1.0).abs() < 1e-12 && one.upper - one.lower < 1e-9);
    }

    #[test]
    fn the_greatest_number_has_the_greatest_ends() {
        let ends = |value, lower, upper| Ratio { value, lower, upper };
        let of = greatest([ends(2.0, 1.0, 4.0), ends(3.0, 2.5, 3.5), ends(1.0, 0.5, 1.5)]);
        assert_eq!([of.value, of.lower, of.upper], [3.0, 2.5, 4.0]);
    }

    #[test]
    fn all_tiles_give_a_zero_interval_and_one_tile_an_infinite_one() {
        assert_eq!(
            Estimate::of_total(&[(1.0, 1), (2.0, 1), (4.0, 1)]),
            Estimate { value: 7.0, half_width: 0.0 }
        );
        assert_eq!(Estimate::of_total(&[(2.0, 3)]), Estimate { value: 6.0, half_width: f64::INFINITY });
        assert!((students_t(30) - 2.0423).abs() < 1e-3 && (students_t(11) - 2.201).abs() < 1e-3);
    }
}
