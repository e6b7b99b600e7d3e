//! Options of the host's own work, and of what it reports.

use clap::Args;

use super::progress::ProgressForm;

/// Maximum number of threads. Without a limit, a number that the system cannot start would end the process.
const MAX_THREADS: usize = 1024;

#[derive(Args)]
pub(crate) struct HostOptions {
    /// Threads for the host's own work [default: one per core]
    #[arg(long, value_parser = threads, allow_negative_numbers = true, help_heading = "Order of the work", hide_short_help = true)]
    pub(crate) threads: Option<usize>,
    /// Show no progress; contents of the scene that are ignored or missing are still reported
    #[arg(long)]
    pub(crate) quiet: bool,
    /// Form in which progress and a failure are reported
    #[arg(long, value_enum, default_value_t, hide_short_help = true)]
    pub(crate) progress: ProgressForm,
}

/// Parses a number of threads.
pub(super) fn threads(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| (1..=MAX_THREADS).contains(count));
    count
        .ok_or_else(|| format!("use 1 to {MAX_THREADS} threads, or leave the option out for a thread a core"))
}
