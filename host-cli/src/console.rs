//! The standard streams, either of which may be closed or full: neither makes the program panic.

use std::fmt::Arguments;
use std::io::{ErrorKind, IsTerminal, Write, stderr, stdout};

use miette::MietteHandlerOpts;

use crate::failure::Failure;

/// Lines of errors are broken on a terminal only: elsewhere a path in a message stays in one piece.
pub(crate) fn lay_out_errors() {
    let build = |_: &_| {
        let options = MietteHandlerOpts::new().wrap_lines(stderr().is_terminal()).break_words(false);
        Box::new(options.build()) as Box<dyn miette::ReportHandler>
    };
    // Only a second hook is refused.
    let _ = miette::set_hook(Box::new(build));
}

/// Writes a line for people. If nobody can read it, the work goes on.
pub(crate) fn say(line: Arguments) {
    let _ = writeln!(stderr(), "{line}");
}

/// Writes data to standard output. A reader that closes it early has what it wanted.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::output(&error)),
        _ => Ok(()),
    }
}
