//! Checks of output files before any work.

use std::path::Path;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::output;

use crate::failure::Failure;

/// Checks that the files `written` can be written, and that none of them or of `reserved` is one of the inputs, each with its
/// description, or another output.
pub(crate) fn check(inputs: &[(&Path, &str)], written: &[&Path], reserved: &[&Path]) -> Result<(), Failure> {
    for path in written {
        output::check_writable(path).map_err(|error| Failure::input_error(&error))?;
    }
    let mut taken = inputs.to_vec();
    for path in written.iter().chain(reserved) {
        if let Some((_, what)) = taken.iter().find(|(other, _)| output::is_same_file(path, other)) {
            let text = format!("cannot write {}: it is {what} as well", path.display());
            let report = MietteDiagnostic::new(text).with_help("give every output a name of its own");
            return Err(Failure::Input(Report::new(report)));
        }
        taken.push((path, "another output"));
    }
    Ok(())
}
