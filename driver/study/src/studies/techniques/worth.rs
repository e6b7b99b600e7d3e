//! Compares techniques at equal quality: rays and bytes needed to reach an error, factors between techniques
//! with their intervals, and conclusions.

use super::super::super::laboratory::Results;
use super::super::super::measure::{Measurement, TileMeasurement};
use super::super::super::quality::Quality;
use super::super::super::sample::{Estimate, Ratio, jackknife_half_width};
use super::super::super::scale::Scale;
use super::super::present::say;
use super::technique::{NAIVE, Technique};

/// Number of gather rays at which a technique reaches an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum AtQuality {
    /// The error is reached with this number of rays.
    Met(f64),
    /// The error is already reached with this number, the fewest rays that were measured. Fewer may suffice.
    AtMost(f64),
    /// The error is not reached with this number, the most rays that were measured.
    Missed(f64),
}

impl AtQuality {
    pub(super) fn rays(self) -> f64 {
        let (Self::Met(rays) | Self::AtMost(rays) | Self::Missed(rays)) = self;
        rays
    }
}

/// Returns the number of gather rays at which the error first falls to `rmse`; `None` if `curve` is empty.
/// Each element of `curve` is a number of rays and the corresponding error, in ascending order of rays.
/// Between elements, the logarithm of the error is linear in the logarithm of the rays.
fn at_quality(curve: &[[f64; 2]], rmse: f64) -> Option<AtQuality> {
    let &[rays, first] = curve.first()?;
    if first <= rmse {
        return Some(if curve.len() == 1 { AtQuality::Met(rays) } else { AtQuality::AtMost(rays) });
    }
    for pair in curve.windows(2) {
        let &[[rays, high], [more_rays, low]] = pair else { continue };
        if low <= rmse {
            let share = (high / rmse).ln() / (high / low).ln();
            return Some(AtQuality::Met(rays * (more_rays / rays).powf(share)));
        }
    }
    curve.last().map(|&[rays, _]| AtQuality::Missed(rays))
}

/// Returns the bytes read with `rays` gather rays. Each element of `curve` is a number of rays and the
/// corresponding bytes, in ascending order of rays. Between elements and beyond them, the logarithm of the
/// bytes is linear in the logarithm of the rays.
fn bytes_at(curve: &[(f64, Estimate)], rays: f64) -> Estimate {
    let after = curve.iter().position(|(more, _)| *more >= rays).unwrap_or(curve.len());
    let after = after.clamp(1, curve.len().saturating_sub(1).max(1));
    let (Some(&(fewer, below)), Some(&(more, above))) = (curve.get(after - 1), curve.get(after)) else {
        return curve.first().map_or(Estimate::default(), |(_, bytes)| *bytes);
    };
    let share = (rays / fewer).ln() / (more / fewer).ln();
    let value = below.value * (above.value / below.value).powf(share);
    let relative = (below.half_width / below.value).max(above.half_width / above.value);
    Estimate { value, half_width: relative * value }
}

/// Rays and bytes with which a technique reaches the error of the naive render.
pub(super) struct Worth {
    /// Number of gather rays.
    pub(super) at: AtQuality,
    /// Half-width of the 95 % interval of the logarithm of [`Self::at`], by the jackknife over the tiles in
    /// which errors were measured.
    rays_spread: f64,
    /// Bytes from DRAM.
    pub(super) bytes: Estimate,
    /// Half-width of the 95 % interval of the bytes' logarithm, by the same jackknife.
    bytes_spread: f64,
}

impl Worth {
    /// Number of rays with its 95 % interval, one end of which is open if the number is a bound.
    pub(super) fn rays(&self) -> Ratio {
        let value = self.at.rays();
        let [lower, upper] = [value / self.rays_spread.exp(), value * self.rays_spread.exp()];
        match self.at {
            AtQuality::Met(_) => Ratio { value, lower, upper },
            AtQuality::AtMost(_) => Ratio { value, lower: 0.0, upper },
            AtQuality::Missed(_) => Ratio { value, lower, upper: f64::INFINITY },
        }
    }
}

/// Errors of a technique by its number of rays, ascending.
type Errors = Vec<(u32, Quality)>;

/// Number of rays at which a technique with `errors` reaches the error of `naive`. Errors are those of all
/// tiles except `omitted`.
fn rays_at(errors: &Errors, naive: &Quality, omitted: Option<usize>) -> Option<AtQuality> {
    let rmse =
        |quality: &Quality| omitted.map_or_else(|| quality.rmse(), |tile| quality.without(tile).rmse());
    let curve: Vec<_> = errors.iter().map(|(rays, quality)| [f64::from(*rays), rmse(quality)]).collect();
    at_quality(&curve, rmse(naive))
}

/// Results for one scene.
#[derive(Clone, Copy)]
pub(super) struct Measured<'a> {
    pub(super) scale: &'a Scale,
    pub(super) results: &'a Results,
    pub(super) scene: &'static str,
}

impl Measured<'_> {
    pub(super) fn traffic(&self, technique: &Technique, rays: u32) -> &Measurement {
        self.results.traffic(&technique.traffic(self.scale, self.scene, rays))
    }

    /// Error of the technique with all seeds together.
    pub(super) fn quality(&self, technique: &Technique, rays: u32) -> Quality {
        let points = technique.quality(self.scale, self.scene, rays);
        Quality::pooled(points.iter().map(|point| self.results.quality(point)))
    }

    /// Error of the naive render, with its interval by the jackknife over the tiles that are compared.
    pub(super) fn naive_error(&self) -> Ratio {
        let quality = self.quality(&NAIVE, self.scale.gather_rays);
        let without = (0..quality.tiles.len()).map(|tile| quality.without(tile).rmse());
        let half_width = jackknife_half_width(&without.collect::<Vec<_>>());
        Estimate { value: quality.rmse(), half_width }.with_ends()
    }

    /// Ratio of the naive render's bytes to those of a technique at equal rays.
    pub(super) fn factor_at_equal_rays(&self, technique: &Technique) -> Ratio {
        if technique.name == NAIVE.name {
            return Ratio::ONE;
        }
        self.bytes_over(&NAIVE, technique)
    }

    pub(super) fn worth(&self, technique: &Technique) -> Worth {
        let gather_rays = self.scale.gather_rays;
        let bytes = |rays| (f64::from(rays), self.traffic(technique, rays).dram_bytes());
        let curve: Vec<_> = technique.traffic_sweep(self.scale).into_iter().map(bytes).collect();
        let error = |rays| (rays, self.quality(technique, rays));
        let errors: Errors = technique.sweep(self.scale).into_iter().map(error).collect();
        let naive = self.quality(&NAIVE, gather_rays);
        let at =
            |omitted| rays_at(&errors, &naive, omitted).unwrap_or(AtQuality::Missed(f64::from(gather_rays)));
        let spread = |of: &dyn Fn(f64) -> f64| {
            let without = (0..naive.tiles.len()).map(|tile| of(at(Some(tile)).rays()).ln());
            if technique.changes_pixels() { jackknife_half_width(&without.collect::<Vec<_>>()) } else { 0.0 }
        };
        Worth {
            at: at(None),
            rays_spread: spread(&|rays| rays),
            bytes: bytes_at(&curve, at(None).rays()),
            bytes_spread: spread(&|rays| bytes_at(&curve, rays).value),
        }
    }

    /// Ratio of the bytes of two techniques at equal rays.
    pub(super) fn bytes_over(&self, base: &Technique, technique: &Technique) -> Ratio {
        let [base, other] =
            [base, technique].map(|technique| self.traffic(technique, self.scale.gather_rays));
        base.over(other, TileMeasurement::all_bytes)
    }

    /// Ratio of the bytes of `base` to those of `technique` at the naive render's error.
    fn factor(&self, base: &Technique, technique: &Technique) -> Ratio {
        if technique.name == base.name {
            return Ratio::ONE;
        }
        let [base, worth] = [base, technique].map(|technique| self.worth(technique));
        Ratio::new(base.bytes, worth.bytes, base.bytes_spread.hypot(worth.bytes_spread))
    }

    /// Ratio of the naive render's bytes to those of a technique at the naive render's error; `None` if the
    /// technique does not reach that error.
    pub(super) fn factor_at_quality(&self, technique: &Technique) -> Option<Ratio> {
        self.factor_over(&NAIVE, technique)
    }

    /// Ratio of the bytes of `base` to those of `technique` at the naive render's error; `None` if the
    /// technique does not reach that error.
    pub(super) fn factor_over(&self, base: &Technique, technique: &Technique) -> Option<Ratio> {
        let is_reached = !matches!(self.worth(technique).at, AtQuality::Missed(_));
        is_reached.then(|| self.factor(base, technique))
    }

    /// Part of a sentence that states whether `technique` reads fewer bytes than `base` at the naive render's
    /// error.
    pub(super) fn verdict(&self, base: &Technique, technique: &Technique) -> String {
        let at = self.worth(technique).at;
        let factor = self.factor(base, technique);
        let rays = say(at.rays());
        let amount = match at {
            AtQuality::Met(_) => {
                format!("with {rays} rays {} times less ({})", say(factor.value), range(factor))
            }
            AtQuality::AtMost(_) => {
                format!(
                    "with {rays} rays, more than it needs, {} times less ({})",
                    say(factor.value),
                    range(factor)
                )
            }
            AtQuality::Missed(_) => {
                format!(
                    "the error is not reached with {rays} rays, which read 1/{} of the bytes",
                    say(factor.value)
                )
            }
        };
        format!("{}: {amount}", Verdict::new(at, factor).word())
    }
}

/// Text of the interval of a ratio.
fn range(ratio: Ratio) -> String {
    format!("{} to {}", say(ratio.lower), say(ratio.upper))
}

/// Result of comparing the bytes that two techniques read at equal quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Pays,
    Costs,
    Open,
}

impl Verdict {
    /// Creates the verdict on a technique that reaches the error with `at` rays. `factor` is the ratio of the
    /// bytes of the other technique to those of this one. It is a lower bound with [`AtQuality::AtMost`], and
    /// an upper bound with [`AtQuality::Missed`].
    fn new(at: AtQuality, factor: Ratio) -> Self {
        match at {
            AtQuality::Met(_) | AtQuality::AtMost(_) if factor.lower > 1.0 => Self::Pays,
            AtQuality::Met(_) | AtQuality::Missed(_) if factor.upper < 1.0 => Self::Costs,
            _ => Self::Open,
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Pays => "pays",
            Self::Costs => "does not pay",
            Self::Open => "no difference is shown",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_quality_lies_between_the_points_of_a_curve() {
        // The error of independent rays, and bytes in proportion to rays.
        let curve = [25.0, 100.0, 400.0].map(|rays: f64| [rays, rays.powf(-0.5)]);
        let Some(AtQuality::Met(rays)) = at_quality(&curve, 1.0 / 8.0) else { panic!() };
        assert!((rays - 64.0).abs() < 1e-9, "{rays}");
        assert_eq!(at_quality(&curve, 0.3), Some(AtQuality::AtMost(25.0)));
        assert_eq!(at_quality(&curve, 0.01), Some(AtQuality::Missed(400.0)));
        assert_eq!(at_quality(&curve[..1], 0.2), Some(AtQuality::Met(25.0)));
        assert_eq!(at_quality(&[], 0.2), None);
    }

    #[test]
    fn bytes_are_interpolated_and_extrapolated_over_rays() {
        let curve = [25.0, 100.0, 400.0]
            .map(|rays: f64| (rays, Estimate { value: 7.0 * rays, half_width: 0.7 * rays }));
        for rays in [10.0, 25.0, 64.0, 100.0, 300.0, 400.0, 500.0] {
            let bytes = bytes_at(&curve, rays);
            assert!((bytes.value / (7.0 * rays) - 1.0).abs() < 1e-12, "{rays}: {bytes:?}");
            assert!((bytes.half_width / bytes.value - 0.1).abs() < 1e-12);
        }
        assert_eq!(bytes_at(&curve[..1], 60.0).value, 175.0);
        assert_eq!(bytes_at(&[], 60.0), Estimate::default());
    }

    #[test]
    fn a_verdict_needs_an_interval_that_excludes_one() {
        let ratio = |lower, upper| Ratio { value: 1.0, lower, upper };
        let (met, at_most, missed) = (AtQuality::Met(9.0), AtQuality::AtMost(9.0), AtQuality::Missed(9.0));
        for (at, factor, verdict) in [
            (met, ratio(1.1, 2.0), Verdict::Pays),
            (met, ratio(0.9, 2.0), Verdict::Open),
            (met, ratio(0.5, 0.9), Verdict::Costs),
            (at_most, ratio(1.1, 2.0), Verdict::Pays),
            (at_most, ratio(0.5, 0.9), Verdict::Open),
            (missed, ratio(1.1, 2.0), Verdict::Open),
            (missed, ratio(0.5, 0.9), Verdict::Costs),
        ] {
            assert_eq!(Verdict::new(at, factor), verdict, "{at:?} {factor:?}");
        }
    }
}
