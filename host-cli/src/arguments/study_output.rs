//! Options of a study's output and of its sampling.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::parts::Part;
use photoncard_driver::study::SampleRate;

use super::host::threads;

/// Folder of a study's output, and options that limit its work.
#[derive(Args)]
pub(crate) struct StudyOutput {
    /// The folder for reports and finished points; it is made if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Share of the tiles that is rendered where a study does not need all tiles
    #[arg(long, value_name = "SHARE", default_value = "1/17", allow_hyphen_values = true)]
    pub(crate) sample: SampleRate,
    /// Measure the K-th of N shares of the points, and write no report; photoncard study merge writes it when
    /// all parts are measured, here or on other machines
    #[arg(long, value_name = "K/N")]
    pub(crate) part: Option<Part>,
    /// Number of threads, each of which runs an emulated chip [default: one per core]
    #[arg(long, value_parser = threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
    /// Show no progress
    #[arg(long)]
    pub(crate) quiet: bool,
}
