//! Failures of a command: message and exit status.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use miette::{Diagnostic, MietteDiagnostic, Report};
use photoncard_driver::printable::printable;
use photoncard_driver::render::RenderError;
use serde_json::{Value, json};

use crate::flags::with_flags;
use crate::report::help;

/// Failure of a command.
pub(crate) enum Failure {
    /// Invalid arguments or unreadable input: status 2.
    Input(Report),
    /// Failure of the work: status 1.
    Work(Report),
    /// Interrupt: status 130, as for a process ended by SIGINT. The text says what the interrupt leaves
    /// behind.
    Stopped(&'static str),
}

impl Failure {
    /// Creates an `Input` failure from an error that may have a remedy.
    pub(crate) fn input(error: impl Diagnostic + Send + Sync + 'static) -> Self {
        Self::Input(Report::new(error))
    }

    /// Creates a `Work` failure from an error that may have a remedy.
    pub(crate) fn work(error: impl Diagnostic + Send + Sync + 'static) -> Self {
        Self::Work(Report::new(error))
    }

    /// Creates an `Input` failure from an error without a remedy. The message includes the error's causes.
    pub(crate) fn input_error(error: &(dyn std::error::Error + 'static)) -> Self {
        Self::Input(Report::new(MietteDiagnostic::new(with_causes(error))))
    }

    /// Creates a `Work` failure from an error without a remedy. The message includes the error's causes.
    pub(crate) fn work_error(error: &(dyn std::error::Error + 'static)) -> Self {
        Self::Work(Report::new(MietteDiagnostic::new(with_causes(error))))
    }

    /// Creates the failure of a write to standard output.
    pub(crate) fn output(error: &std::io::Error) -> Self {
        let text = format!("cannot write to standard output: {error}");
        let help = "check the space of the file or the device that it is directed to";
        Self::Work(Report::new(MietteDiagnostic::new(text).with_help(help)))
    }

    /// Creates the failure of a folder that cannot be made.
    pub(crate) fn folder(path: &Path, error: &std::io::Error) -> Self {
        let text = format!("cannot make the folder {}: {error}", path.display());
        Self::Input(Report::new(MietteDiagnostic::new(text).with_help("choose another folder")))
    }

    /// Creates the failure of a folder that should exist, but cannot be used.
    pub(crate) fn no_folder(path: &Path, error: &std::io::Error) -> Self {
        let text = format!("cannot use the folder {}: {error}", path.display());
        Self::Input(Report::new(
            MietteDiagnostic::new(text).with_help("make the folder first, or choose another"),
        ))
    }

    /// Message with its causes, in one line.
    pub(crate) fn line(&self) -> String {
        match self {
            Self::Input(report) | Self::Work(report) => {
                let causes: Vec<String> = report.chain().map(ToString::to_string).collect();
                printable(&with_flags(&causes.join(": "))).into_owned()
            }
            Self::Stopped(text) => (*text).to_owned(),
        }
    }

    /// Replaces the text of an interrupt, which says what it leaves behind.
    pub(crate) fn stopped_as(self, text: &'static str) -> Self {
        match self {
            Self::Stopped(_) => Self::Stopped(text),
            other => other,
        }
    }

    pub(crate) fn status(&self) -> ExitCode {
        ExitCode::from(self.code())
    }

    fn code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Work(_) => 1,
            Self::Stopped(_) => 130,
        }
    }

    /// Message, remedy and exit status as an object of the kind `failure`.
    pub(crate) fn json(&self) -> Value {
        let remedy = match self {
            Self::Input(report) | Self::Work(report) => help(report.as_ref()),
            Self::Stopped(_) => None,
        };
        failure_json(&self.line(), remedy.as_deref(), self.code())
    }
}

/// Object of the kind `failure` of `--progress json`.
pub(crate) fn failure_json(message: &str, remedy: Option<&str>, status: u8) -> Value {
    json!({ "kind": "failure", "message": message, "remedy": remedy, "status": status })
}

impl fmt::Display for Failure {
    /// Writes message and remedy.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Input(report) | Self::Work(report) => write!(f, "{report:?}"),
            Self::Stopped(text) => write!(f, "photoncard: {text}"),
        }
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Stopped => Self::Stopped("stopped; no picture was written"),
            error if error.is_input() => Self::Input(Report::new(error)),
            error => Self::Work(Report::new(error)),
        }
    }
}

fn with_causes(error: &(dyn std::error::Error + 'static)) -> String {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}
