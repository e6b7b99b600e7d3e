//! Checks of output files before any work starts.

use std::path::{Path, PathBuf};

use miette::{MietteDiagnostic, Report};
use photoncard_driver::output;
use photoncard_driver::tone_mapping::is_of_photoncard;

use crate::failure::Failure;

/// Checks that the files `written` are writable, and that no file of `written` or `reserved` occurs twice or
/// is an input. Each input is a path with the words by which the error names it.
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

/// Checks that each existing file at `paths`, which no option states, was written by photoncard: files of
/// other programs are never replaced there.
pub(crate) fn check_foreign(mut paths: impl Iterator<Item = PathBuf>) -> Result<(), Failure> {
    let Some(other) = paths.find(|path| path.exists() && !is_of_photoncard(path)) else {
        return Ok(());
    };
    let text = format!("{} is there, and photoncard did not write it", other.display());
    let report = MietteDiagnostic::new(text).with_help("name the picture by -o OUT.png or -o OUT.exr");
    Err(Failure::Input(Report::new(report)))
}
