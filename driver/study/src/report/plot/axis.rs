//! Axes: positions of values, and ticks with their labels.

use super::super::number;

/// Maximum number of intervals between the ticks of a linear axis, before its ends are rounded outwards.
const INTERVALS: f64 = 10.0;
/// Maximum number of tick labels of an axis.
const MAX_TICKS: usize = 12;
/// Maximum length of a logarithmic axis whose ends are at 1, 2 or 5 times a power of ten, counted in steps
/// between such values. A longer axis ends at powers of ten.
const MAX_STEPS: i32 = 9;
/// A linear axis whose values are all below this magnitude extends from 0 to 1.
const SMALLEST: f64 = 1e-290;
/// Tolerance for the rounding of logarithms that should be integers.
const WHOLE: f64 = 1e-9;

/// Mapping of values to positions from 0 to 1 along an axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    kind: Kind,
    /// Lower end of the axis: a value, its logarithm to base 2 or 10, or the index of a category, depending
    /// on `kind`. `high` is the upper end.
    low: f64,
    high: f64,
}

#[derive(Clone, Debug)]
enum Kind {
    /// Linear axis with ticks at multiples of `step`.
    Linear {
        step: Step,
    },
    Log2,
    Log10,
    Categories(Vec<String>),
}

/// A labelled position on an axis.
#[derive(Clone, Debug)]
pub(super) struct Tick {
    /// Position along the axis, 0 to 1.
    pub(super) place: f64,
    pub(super) label: String,
}

/// The number `digit * 10^exponent`, where the digit is 1, 2 or 5. It is stored as `3 * exponent + i`, where
/// `i` is the index of the digit.
#[derive(Clone, Copy, Debug)]
struct Step(i32);

impl Step {
    /// Smallest step that is at least `value`, which must be positive.
    fn at_least(value: f64) -> Self {
        let mut step = Self(3 * value.log10().floor() as i32);
        while step.value() < value * (1.0 - WHOLE) {
            step.0 += 1;
        }
        step
    }

    fn exponent(self) -> i32 {
        self.0.div_euclid(3)
    }

    fn digit(self) -> u8 {
        [1, 2, 5][self.0.rem_euclid(3) as usize]
    }

    fn value(self) -> f64 {
        f64::from(self.digit()) * 10_f64.powi(self.exponent())
    }
}

impl Axis {
    /// Linear axis over the values from `low` to `high`, extended to multiples of the distance between ticks.
    pub(super) fn linear(low: f64, high: f64) -> Self {
        let size = low.abs().max(high.abs());
        let (low, high) = match high - low > size * 1e-9 {
            _ if size < SMALLEST => (0.0, 1.0),
            true => (low, high),
            false => (low - 0.1 * size, high + 0.1 * size),
        };
        let step = Step::at_least((high - low) / INTERVALS);
        let outward = |value: f64, round: fn(f64) -> f64| {
            let steps = value / step.value();
            let whole = steps.round();
            step.value() * if (steps - whole).abs() < 1e-6 { whole } else { round(steps) }
        };
        Self { kind: Kind::Linear { step }, low: outward(low, f64::floor), high: outward(high, f64::ceil) }
    }

    /// Logarithmic axis over the positive values from `low` to `high`, extended to whole powers of two.
    pub(super) fn log2(low: f64, high: f64) -> Self {
        let (low, high) = ((low.log2() + WHOLE).floor(), (high.log2() - WHOLE).ceil());
        let widen = if low < high { 0.0 } else { 1.0 };
        Self { kind: Kind::Log2, low: low - widen, high: high + widen }
    }

    /// Logarithmic axis over the positive values from `low` to `high`, extended to 1, 2 or 5 times a power of
    /// ten.
    pub(super) fn log10(low: f64, high: f64) -> Self {
        let (mut low_step, mut high_step) = (Step::at_least(low), Step::at_least(high));
        if low_step.value() > low * (1.0 + WHOLE) || low_step.0 == high_step.0 {
            low_step.0 -= 1;
        }
        if low_step.0 + 1 == high_step.0 && high_step.value() <= high * (1.0 + WHOLE) {
            high_step.0 += 1;
        }
        if high_step.0 - low_step.0 > MAX_STEPS {
            low_step.0 = 3 * low_step.0.div_euclid(3);
            high_step.0 = -3 * (-high_step.0).div_euclid(3);
        }
        Self { kind: Kind::Log10, low: low_step.value().log10(), high: high_step.value().log10() }
    }

    /// Axis of names. The values are their indices.
    pub(super) fn categories(names: Vec<String>) -> Self {
        let high = names.len().max(1) as f64 - 0.5;
        Self { kind: Kind::Categories(names), low: -0.5, high }
    }

    /// Position of `value` along the axis, clamped to 0 to 1.
    pub(super) fn place(&self, value: f64) -> f64 {
        let measure = match self.kind {
            Kind::Linear { .. } | Kind::Categories(_) => value,
            Kind::Log2 => value.max(f64::MIN_POSITIVE).log2(),
            Kind::Log10 => value.max(f64::MIN_POSITIVE).log10(),
        };
        self.place_of_measure(measure)
    }

    /// Returns whether `value` is at or above the lower end of the axis.
    pub(super) fn holds(&self, value: f64) -> bool {
        match self.kind {
            Kind::Log2 => value > 0.0 && value.log2() > self.low - WHOLE,
            Kind::Log10 => value > 0.0 && value.log10() > self.low - WHOLE,
            _ => value >= self.low,
        }
    }

    /// Exponent of the power of ten that the labels omit. It is 0 unless the axis is linear and its greatest
    /// magnitude is below 10^-3 or at least 10^7.
    pub(super) fn omitted_exponent(&self) -> i32 {
        let size = self.low.abs().max(self.high.abs());
        match self.kind {
            Kind::Linear { .. } if !(1e-3..1e7).contains(&size) => 3 * (size.log10() / 3.0).floor() as i32,
            _ => 0,
        }
    }

    /// Ticks in ascending order, as dense as `fits` allows.
    pub(super) fn ticks(&self, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
        if matches!(self.kind, Kind::Categories(_)) {
            return self.candidate(0);
        }
        let mut ticks = Vec::new();
        for sparsity in 0..1000 {
            ticks = self.candidate(sparsity);
            if ticks.len() <= 1 || ticks.len() <= MAX_TICKS && fits(&ticks) {
                break;
            }
        }
        ticks
    }

    /// Ticks that `Self::ticks` tries after `sparsity` denser sets of ticks did not fit.
    fn candidate(&self, sparsity: i32) -> Vec<Tick> {
        match &self.kind {
            Kind::Linear { step } => self.linear_ticks(Step(step.0 + sparsity)),
            Kind::Log2 => self.powers(2, sparsity + 1),
            Kind::Log10 if sparsity == 0 => self.steps(),
            Kind::Log10 => self.powers(10, sparsity),
            Kind::Categories(names) => {
                let tick = |(index, name): (usize, &String)| Tick {
                    place: self.place_of_measure(index as f64),
                    label: name.clone(),
                };
                names.iter().enumerate().map(tick).collect()
            }
        }
    }

    fn linear_ticks(&self, step: Step) -> Vec<Tick> {
        let omitted = self.omitted_exponent();
        let decimals = (omitted - step.exponent()).max(0) as usize;
        let first = (self.low / step.value() - 1e-6).ceil();
        let count = (self.high / step.value() + 1e-6).floor() - first + 1.0;
        let tick = |index: i32| {
            let value = (first + f64::from(index)) * step.value();
            let label = number::fixed(value / 10_f64.powi(omitted), decimals);
            Tick { place: self.place_of_measure(value), label }
        };
        (0..count as i32).map(tick).collect()
    }

    /// Ticks at the powers of `base` whose exponents are multiples of `every`.
    fn powers(&self, base: u32, every: i32) -> Vec<Tick> {
        let exponents = (self.low - WHOLE).ceil() as i32..=(self.high + WHOLE).floor() as i32;
        let is_plain = match base {
            2 => self.low >= -4.0 && self.high <= 19.0,
            _ => self.low >= -4.0 && self.high <= 6.0,
        };
        let tick = |exponent: i32| {
            let value = f64::from(base).powi(exponent);
            let label = if is_plain { number::human(value, 6) } else { number::power(base, exponent) };
            Tick { place: self.place_of_measure(f64::from(exponent)), label }
        };
        exponents.filter(|exponent| exponent % every == 0).map(tick).collect()
    }

    /// Ticks at 1, 2 and 5 times each power of ten.
    fn steps(&self) -> Vec<Tick> {
        let mut step = Step::at_least(10_f64.powf(self.low));
        let is_plain = self.low >= -4.0 && self.high <= 6.0;
        let mut ticks = Vec::new();
        while step.value().log10() <= self.high + WHOLE {
            let label = match (is_plain, step.digit()) {
                (true, _) => number::human(step.value(), 1),
                (false, 1) => number::power(10, step.exponent()),
                (false, digit) => format!("{digit}×{}", number::power(10, step.exponent())),
            };
            ticks.push(Tick { place: self.place_of_measure(step.value().log10()), label });
            step.0 += 1;
        }
        ticks
    }

    fn place_of_measure(&self, measure: f64) -> f64 {
        ((measure - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks(|_| true).into_iter().map(|tick| tick.label).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(
            labels(&Axis::linear(0.0, 180.0)),
            ["0", "20", "40", "60", "80", "100", "120", "140", "160", "180"]
        );
        assert_eq!(
            labels(&Axis::linear(-0.03, 0.04)),
            ["−0.03", "−0.02", "−0.01", "0.00", "0.01", "0.02", "0.03", "0.04"]
        );
        assert_eq!(labels(&Axis::log2(1.0, 128.0)), ["1", "2", "4", "8", "16", "32", "64", "128"]);
        assert_eq!(labels(&Axis::log2(0.25, 1.5)), ["0.25", "0.5", "1", "2"]);
        assert_eq!(labels(&Axis::log10(3.0, 70.0)), ["2", "5", "10", "20", "50", "100"]);
        assert_eq!(labels(&Axis::log10(0.003, 800.0)), ["0.001", "0.01", "0.1", "1", "10", "100", "1,000"]);
        let wide = labels(&Axis::log10(1e-300, 1e300));
        assert!(wide.len() <= MAX_TICKS && wide.contains(&"10⁰".to_owned()), "{wide:?}");
        let log2 = labels(&Axis::log2(1.0, 2_f64.powi(30)));
        assert!(log2.len() <= MAX_TICKS && log2.contains(&"2³⁰".to_owned()), "{log2:?}");
    }

    #[test]
    fn a_power_of_ten_moves_to_the_axis_label() {
        let axis = Axis::linear(0.0, 6e9);
        assert_eq!((labels(&axis)[1].as_str(), axis.omitted_exponent()), ("1", 9));
        let axis = Axis::linear(0.0, 8e-6);
        assert_eq!((labels(&axis)[1].as_str(), axis.omitted_exponent()), ("1", -6));
        assert_eq!(Axis::linear(0.0, 5e6).omitted_exponent(), 0);
    }

    #[test]
    fn every_axis_has_at_least_two_ticks_and_contains_its_range() {
        let ranges = [
            (0.0, 0.0),
            (5.0, 5.0),
            (-3.0, -3.0),
            (1.0, 1.0 + 1e-12),
            (1e-280, 1e280),
            (1e15, 1e15 + 1.0),
            (3.0, 4.0),
            (3.0, 3.0),
            (10.0, 10.0),
            (1.0, 2.0),
            (0.9, 1.1),
            (1e-7, 2e-7),
        ];
        for (low, high) in ranges {
            let mut axes = vec![Axis::linear(low, high)];
            if low > 0.0 {
                axes.extend([Axis::log2(low, high), Axis::log10(low, high)]);
            }
            for axis in axes {
                let ticks = axis.ticks(|_| true);
                assert!((2..=MAX_TICKS).contains(&ticks.len()), "{axis:?}: {ticks:?}");
                assert!(ticks.windows(2).all(|pair| pair[0].place < pair[1].place), "{axis:?}: {ticks:?}");
                let ends = [axis.place(low), axis.place(high)];
                assert!(ends.iter().all(|end| (0.0..=1.0).contains(end)) && axis.holds(low), "{axis:?}");
                assert!(ends[0] < ends[1] || high - low <= 1e-9 * high.abs(), "{axis:?}: {ends:?}");
            }
        }
    }

    #[test]
    fn ticks_thin_out_until_they_fit() {
        let few = |ticks: &[Tick]| ticks.len() <= 3;
        for axis in [Axis::linear(0.0, 180.0), Axis::log2(1.0, 4096.0), Axis::log10(1.0, 1e9)] {
            assert!((2..=3).contains(&axis.ticks(few).len()), "{axis:?}");
        }
    }
}
