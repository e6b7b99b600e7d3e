//! Rates of a chip as a user states them, each of which may be left out.

use std::ops::RangeInclusive;

use super::Machine;

/// Stated rates of a chip. What is `None` is that of another source, and finally of [`Machine::NOMINAL`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Bandwidth of DRAM, GB/s.
    pub bandwidth_gb_s: Option<f64>,
    /// Arithmetic, GFLOPS.
    pub gflops: Option<f64>,
    /// Latency of a read from DRAM, nanoseconds.
    pub latency_ns: Option<f64>,
    /// Number of rays or gathers in flight in each unit.
    pub tasks: Option<u32>,
}

impl Rates {
    /// Valid range of bandwidth, GB/s, and of arithmetic, GFLOPS.
    pub const GIGA: RangeInclusive<f64> = 0.1..=1e6;
    /// Valid range of latency, nanoseconds.
    pub const LATENCY: RangeInclusive<f64> = 0.0..=10_000.0;
    /// Valid range of tasks in flight.
    pub const TASKS: RangeInclusive<u32> = 1..=65_536;

    /// Returns these rates, with those of `other` where these are not stated.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            bandwidth_gb_s: self.bandwidth_gb_s.or(other.bandwidth_gb_s),
            gflops: self.gflops.or(other.gflops),
            latency_ns: self.latency_ns.or(other.latency_ns),
            tasks: self.tasks.or(other.tasks),
        }
    }

    /// Machine of these rates. What is not stated is that of [`Machine::NOMINAL`].
    pub fn machine(&self) -> Machine {
        let nominal = Machine::NOMINAL;
        Machine {
            bandwidth: self.bandwidth_gb_s.map_or(nominal.bandwidth, |rate| 1e9 * rate),
            flops: self.gflops.map_or(nominal.flops, |rate| 1e9 * rate),
            latency: self.latency_ns.map_or(nominal.latency, |latency| latency / 1e9),
            tasks: self.tasks.unwrap_or(nominal.tasks),
            ..nominal
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stated_rate_counts_before_another_source_and_that_before_the_nominal_one() {
        let stated = Rates { gflops: Some(40.0), ..Rates::default() };
        let other = Rates { gflops: Some(7.0), tasks: Some(3), ..Rates::default() };
        let expected = Machine { flops: 40e9, tasks: 3, ..Machine::NOMINAL };
        assert_eq!(stated.or(other).machine(), expected);
        assert_eq!(Rates::default().machine(), Machine::NOMINAL);
    }
}
