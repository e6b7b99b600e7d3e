//! Errors of prepared scenes.

use std::io;
use std::path::PathBuf;

use photoncard_picture::allocation;
use photoncard_picture::output::OutputError;

use crate::PROGRAM;

/// Version of the format. The file's first line states it.
pub(super) const VERSION: u32 = 4;

/// Error of a prepared scene that cannot be opened or written.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum PreparedError {
    /// The file is not a prepared scene.
    #[error("{} is no prepared scene", path.display())]
    #[diagnostic(help(
        "give a file that `photoncard prepare` has written, or leave --prepared out for a glTF file"
    ))]
    Foreign {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file has another version of the format.
    #[error("{} is a prepared scene of version {found}, and this program reads version {VERSION}", path.display())]
    #[diagnostic(help("prepare the scene again, with this program"))]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// Version of the file's format.
        found: u32,
    },
    /// Another version of the program prepared the scene, so that its pixels may differ.
    #[error("{} was prepared by {found}, and this is {PROGRAM}", path.display())]
    #[diagnostic(help("prepare the scene again, with this program"))]
    Program {
        /// Path of the file.
        path: PathBuf,
        /// Name and version of the program.
        found: String,
    },
    /// The bytes of the file are not those that were written.
    #[error("{} is damaged: {fault}", path.display())]
    #[diagnostic(help("copy it again, or prepare the scene again"))]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// Description of the damage.
        fault: &'static str,
    },
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    #[diagnostic(help("check that the path names a file and that it may be read"))]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: io::Error,
    },
    /// The system refuses the memory for the card image.
    #[error("{} takes {bytes} bytes of memory, which the system does not give", path.display())]
    #[diagnostic(help("{}", allocation::REMEDY))]
    Memory {
        /// Path of the file.
        path: PathBuf,
        /// Size of the card image, bytes.
        bytes: u64,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
