//! Form in which a command reports progress and failure.

use clap::ValueEnum;

/// Form of progress and failure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressForm {
    /// A bar on a terminal, else lines on standard error
    #[default]
    Text,
    /// Lines of Open Job Description on standard output
    Openjd,
}
