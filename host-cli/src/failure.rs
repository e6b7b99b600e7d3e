//! How a command fails: what is said, and the exit status.

use std::process::ExitCode;

use miette::{Diagnostic, MietteDiagnostic, Report};
use photoncard_driver::render::RenderError;

use crate::console::{say, say_error};

/// Why a command did not do its work.
pub(crate) enum Failure {
    /// Wrong arguments or unreadable input: status 2.
    Input(Report),
    /// The work failed: status 1.
    Work(Report),
    /// An interrupt: status 130, as of a process ended by SIGINT. It tells what is left.
    Stopped(&'static str),
}

impl Failure {
    /// A failure of input that tells its own remedy.
    pub(crate) fn input(error: impl Diagnostic + Send + Sync + 'static) -> Self {
        Self::Input(Report::new(error))
    }

    /// A failure of the work that tells its own remedy.
    pub(crate) fn work(error: impl Diagnostic + Send + Sync + 'static) -> Self {
        Self::Work(Report::new(error))
    }

    /// A failure of input that is an error only, with its causes.
    pub(crate) fn input_error(error: &(dyn std::error::Error + 'static)) -> Self {
        Self::Input(Report::new(MietteDiagnostic::new(with_causes(error))))
    }

    /// A failure of the work that is an error only, with its causes.
    pub(crate) fn work_error(error: &(dyn std::error::Error + 'static)) -> Self {
        Self::Work(Report::new(MietteDiagnostic::new(with_causes(error))))
    }

    /// Standard output that takes no data.
    pub(crate) fn output(error: &std::io::Error) -> Self {
        let text = format!("cannot write to standard output: {error}");
        let help = "check the space of the file or the device that it is directed to";
        Self::Work(Report::new(MietteDiagnostic::new(text).with_help(help)))
    }

    /// Says what happened, and gives the exit status.
    pub(crate) fn report(self) -> ExitCode {
        match self {
            Self::Input(report) => {
                say_error(&report);
                ExitCode::from(2)
            }
            Self::Work(report) => {
                say_error(&report);
                ExitCode::from(1)
            }
            Self::Stopped(text) => {
                say(format_args!("photoncard: {text}"));
                ExitCode::from(130)
            }
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
