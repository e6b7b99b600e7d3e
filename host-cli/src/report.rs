//! Layout of errors: with colours and line breaks on a terminal, and with foreign text escaped.

use std::error::Error;
use std::fmt::{Display, Formatter, Result};
use std::io::{IsTerminal, stderr};

use miette::{
    Diagnostic, LabeledSpan, MietteHandler, MietteHandlerOpts, ReportHandler, Severity, SourceCode,
};
use photoncard_driver::printable::printable;

/// Installs the layout. Lines are broken on a terminal only: elsewhere a path in a message stays in one piece.
pub(crate) fn lay_out_errors() {
    let build = |_: &_| {
        let options = MietteHandlerOpts::new().wrap_lines(stderr().is_terminal()).break_words(false);
        Box::new(PrintableHandler(options.build())) as Box<dyn ReportHandler>
    };
    // `set_hook` fails only if there is a hook already.
    let _ = miette::set_hook(Box::new(build));
}

/// Handler that escapes the texts of every error before colours and line breaks are added.
struct PrintableHandler(MietteHandler);

impl ReportHandler for PrintableHandler {
    fn debug(&self, error: &dyn Diagnostic, f: &mut Formatter<'_>) -> Result {
        self.0.debug(&Printable::new(error), f)
    }
}

/// Diagnostic with its texts and causes escaped. An excerpt of a file is escaped by its author instead, as labels point
/// into it by offset.
#[derive(Debug)]
struct Printable<'a> {
    diagnostic: &'a dyn Diagnostic,
    message: String,
    cause: Option<Cause<'a>>,
}

#[derive(Debug)]
enum Cause<'a> {
    Diagnostic(Box<Printable<'a>>),
    Error(PrintableError),
}

impl<'a> Printable<'a> {
    fn new(diagnostic: &'a dyn Diagnostic) -> Self {
        let cause = match diagnostic.diagnostic_source() {
            Some(cause) => Some(Cause::Diagnostic(Box::new(Printable::new(cause)))),
            None => diagnostic.source().map(|cause| Cause::Error(PrintableError::new(cause))),
        };
        Self { diagnostic, message: escaped(diagnostic), cause }
    }
}

impl Display for Printable<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(&self.message)
    }
}

impl Error for Printable<'_> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match &self.cause {
            Some(Cause::Error(cause)) => Some(cause),
            _ => None,
        }
    }
}

impl Diagnostic for Printable<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn Display + 'a>> {
        self.diagnostic.code()
    }

    fn severity(&self) -> Option<Severity> {
        self.diagnostic.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn Display + 'a>> {
        self.diagnostic.help().map(|help| Box::new(escaped(&help)) as Box<dyn Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.diagnostic.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.diagnostic.labels()
    }

    fn diagnostic_source(&self) -> Option<&dyn Diagnostic> {
        match &self.cause {
            Some(Cause::Diagnostic(cause)) => Some(cause.as_ref()),
            _ => None,
        }
    }
}

/// Error with its text and causes escaped.
#[derive(Debug)]
struct PrintableError {
    message: String,
    cause: Option<Box<PrintableError>>,
}

impl PrintableError {
    fn new(error: &dyn Error) -> Self {
        Self { message: escaped(error), cause: error.source().map(|cause| Box::new(Self::new(cause))) }
    }
}

impl Display for PrintableError {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(&self.message)
    }
}

impl Error for PrintableError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as &(dyn Error + 'static))
    }
}

fn escaped(text: impl Display) -> String {
    printable(&text.to_string()).into_owned()
}
