//! Options of a study's output and of its sampling.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::study::SampleRate;

use super::threads::threads;

/// Output of a study, and extent of its work.
#[derive(Args)]
pub(crate) struct StudyOutput {
    /// The folder for reports and finished points; it is made if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// The share of the tiles that is rendered where not all are needed
    #[arg(long, value_name = "SHARE", default_value = "1/17", allow_hyphen_values = true)]
    pub(crate) sample: SampleRate,
    /// Threads, an emulated chip on each [default: a thread a core]
    #[arg(long, value_parser = threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
    /// Show no progress
    #[arg(long)]
    pub(crate) quiet: bool,
}
