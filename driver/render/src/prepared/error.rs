//! Errors of prepared scenes.

use std::io;
use std::path::PathBuf;

use photoncard_picture::allocation;
use photoncard_picture::output::OutputError;

use crate::PROGRAM;

/// Version of the format, in the file's first line.
pub(super) const VERSION: u32 = 4;

/// Error of a prepared scene that cannot be opened or written.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum PreparedError {
    /// Error of a file that is no prepared scene.
    #[error("{} is no prepared scene", path.display())]
    #[diagnostic(help(
        "give a file that `photoncard prepare` has written, or leave --prepared out for a glTF file"
    ))]
    Foreign {
        /// Path of the file.
        path: PathBuf,
    },
    /// Error of a prepared scene of another version of the format.
    #[error("{} is a prepared scene of version {found}, and this program reads version {VERSION}", path.display())]
    #[diagnostic(help("prepare the scene again, with this program"))]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// Version of the file's format.
        found: u32,
    },
    /// Error of a prepared scene of another program, whose pixels may be others.
    #[error("{} was prepared by {found}, and this is {PROGRAM}", path.display())]
    #[diagnostic(help("prepare the scene again, with this program"))]
    Program {
        /// Path of the file.
        path: PathBuf,
        /// Name and version of the program.
        found: String,
    },
    /// Error of a prepared scene whose bytes are not those that were written.
    #[error("{} is damaged: {fault}", path.display())]
    #[diagnostic(help("copy it again, or prepare the scene again"))]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// Description of the damage.
        fault: &'static str,
    },
    /// Error of reading.
    #[error("cannot read {}", path.display())]
    #[diagnostic(help("check that the path names a file and that it may be read"))]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        #[source]
        source: io::Error,
    },
    /// Error of a card image for which the system gives no memory.
    #[error("{} takes {bytes} bytes of memory, which the system does not give", path.display())]
    #[diagnostic(help("{}", allocation::REMEDY))]
    Memory {
        /// Path of the file.
        path: PathBuf,
        /// Size of its card image, bytes.
        bytes: u64,
    },
    /// Error of writing.
    #[error(transparent)]
    Output(#[from] OutputError),
}
