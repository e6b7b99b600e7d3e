//! Options of the machine for which a study computes times.

use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::Args;
use photoncard_driver::cost_model::Rates;

/// Rates of the machine for which a study computes times. The measured numbers of reads and operations do not
/// depend on these rates.
#[derive(Args)]
#[command(next_help_heading = "Chip of the report's times")]
pub(crate) struct RateOptions {
    /// Bandwidth of a chip's DRAM, GB/s [default: that of the chip's file, or 90]
    #[arg(long, value_name = "GB/S", value_parser = giga, allow_negative_numbers = true)]
    bandwidth: Option<f64>,
    /// Arithmetic of a chip, GFLOPS [default: that of the chip's file, or 500]
    #[arg(long, value_name = "GFLOPS", value_parser = giga, allow_negative_numbers = true)]
    flops: Option<f64>,
}

/// Machine for which a study computes times and numbers of chips. The measured numbers of reads and
/// operations do not depend on this machine.
#[derive(Args)]
#[command(next_help_heading = "Chip of the report's times")]
pub(crate) struct MachineOptions {
    #[command(flatten)]
    rates: RateOptions,
    /// Latency of a read from DRAM, nanoseconds; the studies reordering and interactive use it for their
    /// times [default: that of the chip's file, or 100]
    #[arg(long, value_name = "NS", value_parser = latency, allow_negative_numbers = true)]
    latency: Option<f64>,
    /// Number of rays or gathers in flight in each unit of a chip; the studies reordering and interactive use
    /// it for their times [default: that of the chip's file, or 128]
    #[arg(long, value_name = "N", value_parser = tasks, allow_negative_numbers = true)]
    tasks: Option<u32>,
}

impl RateOptions {
    pub(crate) fn rates(&self) -> Rates {
        Rates { bandwidth_gb_s: self.bandwidth, gflops: self.flops, ..Rates::default() }
    }
}

impl MachineOptions {
    pub(crate) fn rates(&self) -> Rates {
        Rates { latency_ns: self.latency, tasks: self.tasks, ..self.rates.rates() }
    }
}

fn giga(text: &str) -> Result<f64, String> {
    within(text, &Rates::GIGA)
}

fn latency(text: &str) -> Result<f64, String> {
    within(text, &Rates::LATENCY)
}

fn tasks(text: &str) -> Result<u32, String> {
    within(text, &Rates::TASKS)
}

/// Parses a number, which must be in a range.
fn within<T: FromStr + PartialOrd + std::fmt::Display>(
    text: &str,
    range: &RangeInclusive<T>,
) -> Result<T, String> {
    let number = text.parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("use a number from {} to {}", range.start(), range.end()))
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use photoncard_driver::cost_model::Machine;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        machine: MachineOptions,
    }

    fn parsed(arguments: &[&str]) -> Result<Machine, clap::Error> {
        let words = ["study"].iter().chain(arguments);
        Command::try_parse_from(words).map(|command| command.machine.rates().machine())
    }

    #[test]
    fn the_default_machine_is_the_nominal_one() {
        assert_eq!(parsed(&[]).unwrap(), Machine::NOMINAL);
    }

    #[test]
    fn options_are_in_the_units_that_they_name() {
        let machine =
            parsed(&["--bandwidth", "12.8", "--flops=40", "--latency", "0", "--tasks", "7"]).unwrap();
        assert_eq!(
            machine,
            Machine { bandwidth: 12.8e9, flops: 40e9, latency: 0.0, tasks: 7, ..Machine::NOMINAL }
        );
    }

    #[test]
    fn rates_out_of_range_are_refused() {
        for arguments in [
            ["--bandwidth", "0"],
            ["--bandwidth", "nan"],
            ["--flops", "-1"],
            ["--flops", "inf"],
            ["--latency", "-0.5"],
            ["--latency", "1e9"],
            ["--tasks", "0"],
            ["--tasks", "1.5"],
        ] {
            let error = parsed(&arguments).unwrap_err().to_string();
            assert!(error.contains("use a number from"), "{arguments:?}: {error}");
        }
    }
}
