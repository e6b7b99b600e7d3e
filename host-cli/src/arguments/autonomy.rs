//! Arguments of `photoncard autonomy`.

use std::path::PathBuf;

use clap::Args;

use super::files::{TextOutput, text};

#[derive(Args)]
pub(crate) struct AutonomyOptions {
    /// Tables of photoncard measure, one for each hour, of the same points
    #[arg(required = true, value_name = "TABLE.csv")]
    pub(crate) tables: Vec<PathBuf>,
    /// Illuminance, lx, that an hour needs to count
    #[arg(long, value_name = "LUX", default_value_t = 300.0, allow_negative_numbers = true)]
    pub(crate) threshold: f64,
    /// Share of the hours that a point needs to count
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, allow_negative_numbers = true)]
    pub(crate) share: f64,
    /// The table to write: the share of the hours of each point; - for standard output
    #[arg(short, long, value_name = "OUT.csv", value_parser = text())]
    pub(crate) output: Option<TextOutput>,
}
