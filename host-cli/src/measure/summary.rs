//! Summary of a measurement.

use super::table::Photometry;
use crate::console::{counted, say};

/// Illuminances of all points, lx.
pub(super) struct Summary {
    count: usize,
    sum: f64,
    least: f64,
    greatest: f64,
    threshold: Option<f64>,
    /// Number of points that have the threshold or more.
    reached: usize,
    /// True if the illuminances are those of probes, means over all normals.
    are_probes: bool,
}

impl Summary {
    pub(super) fn new(threshold: Option<f64>, are_probes: bool) -> Self {
        Self { count: 0, sum: 0.0, least: f64::INFINITY, greatest: 0.0, threshold, reached: 0, are_probes }
    }

    /// Adds the illuminance of a point.
    pub(super) fn add(&mut self, lux: f64) {
        self.count += 1;
        self.sum += lux;
        self.least = self.least.min(lux);
        self.greatest = self.greatest.max(lux);
        self.reached += usize::from(self.threshold.is_some_and(|threshold| lux >= threshold));
    }

    /// Prints the summary: mean, extremes, the uniformity of EN 12464-1, and the share of the threshold.
    pub(super) fn say(&self, photometry: &Photometry) {
        say(format_args!("photoncard: {}", self.text(photometry)));
    }

    fn text(&self, photometry: &Photometry) -> String {
        let points = counted(self.count, if self.are_probes { "probe" } else { "point" });
        if self.count == 0 {
            return points;
        }
        let mean = self.sum / self.count as f64;
        let uniformity = if mean > 0.0 { self.least / mean } else { 1.0 };
        let Self { least, greatest, .. } = self;
        if self.are_probes {
            return format!(
                "{points}: illuminance, mean of all normals, {mean:.4} lx, least {least:.4}, greatest {greatest:.4}, by {} lm/W",
                photometry.lumens_per_watt
            );
        }
        let reached = self.threshold.map_or(String::new(), |threshold| {
            let share = 100.0 * self.reached as f64 / self.count as f64;
            format!("; {share:.1} % of the points have {threshold} lx or more")
        });
        format!(
            "{points}: mean {mean:.4} lx, least {least:.4}, greatest {greatest:.4}, uniformity (least over mean) {uniformity:.3}, by {} lm/W{reached}",
            photometry.lumens_per_watt
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_has_mean_extremes_uniformity_and_the_share_above_a_threshold() {
        let photometry = Photometry { lumens_per_watt: 683.0, weights: [0.0, 1.0, 0.0] };
        let mut summary = Summary::new(Some(500.0), false);
        assert_eq!(summary.text(&photometry), "0 points");
        [250.0, 500.0, 750.0, 500.0].into_iter().for_each(|lux| summary.add(lux));
        let text = summary.text(&photometry);
        for part in
            ["4 points: mean 500.0000 lx", "least 250.0000", "0.500", "683 lm/W", "75.0 % of the points"]
        {
            assert!(text.contains(part), "{text}");
        }
        let mut dark = Summary::new(None, false);
        dark.add(0.0);
        assert!(dark.text(&photometry).contains("(least over mean) 1.000"));
        let mut probes = Summary::new(None, true);
        [1.0, 3.0].into_iter().for_each(|lux| probes.add(lux));
        assert!(
            probes.text(&photometry).starts_with("2 probes: illuminance, mean of all normals, 2.0000 lx")
        );
    }
}
