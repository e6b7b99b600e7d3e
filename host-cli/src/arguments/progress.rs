//! Form in which a command reports progress and failure.

use clap::ValueEnum;
use clap::error::Error;

use crate::console;
use crate::failure::failure_json;

/// Form of progress and failure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressForm {
    /// A bar on a terminal, else lines on standard error
    #[default]
    Text,
    /// Lines of Open Job Description on standard output
    Openjd,
    /// JSON objects, one a line, and nothing else on standard error
    Json,
}

/// Returns whether arguments state the form [`ProgressForm::Json`], also if they are invalid otherwise.
pub(super) fn state_json(arguments: &[String]) -> bool {
    let is_joined = arguments.iter().any(|word| word == "--progress=json");
    is_joined || arguments.windows(2).any(|pair| pair == ["--progress", "json"])
}

/// Writes an error of the command line as an object of the kind `failure`. The remedy consists of clap's
/// paragraphs between the error and the usage.
pub(super) fn say_json(error: &Error) {
    let text = error.to_string();
    let mut paragraphs = text.trim_end().split("\n\n").map(str::trim);
    let message = paragraphs.next().unwrap_or_default();
    let message = message.strip_prefix("error: ").unwrap_or(message);
    let remedy: Vec<&str> = paragraphs
        .take_while(|paragraph| !paragraph.starts_with("Usage:") && !paragraph.starts_with("For more"))
        .map(|paragraph| paragraph.strip_prefix("tip: ").unwrap_or(paragraph))
        .collect();
    let remedy = (!remedy.is_empty()).then(|| remedy.join("\n"));
    console::say_json(&failure_json(message, remedy.as_deref(), 2));
}
