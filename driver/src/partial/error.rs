//! Why finished tiles cannot be kept, or taken over.

use std::io;
use std::path::PathBuf;

/// The version of the file's format, in its first line.
pub(super) const VERSION: u32 = 2;

/// Why a partial render cannot be gone on with, or kept.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PartialError {
    /// The file is none of this program.
    #[error("{} is no partial render of this program, and is left as it is", path.display())]
    #[diagnostic(help("finished tiles are kept under that name: move it away, or choose another output"))]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// Something that is not a file of its own is in the way.
    #[error("cannot keep finished tiles in {}: a {kind} has that name", path.display())]
    #[diagnostic(help("move it away, or choose another output"))]
    NotAFile {
        /// The file.
        path: PathBuf,
        /// What is there.
        kind: &'static str,
    },
    /// It is of another version of the program.
    #[error("{} is a partial render of version {found}, and this program goes on with version {VERSION}", path.display())]
    #[diagnostic(help("go on with the program that began it, or render without --resume to begin anew"))]
    Version {
        /// The file.
        path: PathBuf,
        /// The version of its format.
        found: u32,
    },
    /// It is of another picture.
    #[error("{} is of another picture: {}", path.display(), differences.join("; "))]
    #[diagnostic(help("render with the same settings, or without --resume to begin anew"))]
    Differs {
        /// The file.
        path: PathBuf,
        /// What differs.
        differences: Vec<String>,
    },
    /// Another render writes it.
    #[error("another render is writing {}", path.display())]
    #[diagnostic(help("wait until it is done, or choose another output"))]
    Busy {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be read or written.
    #[error("cannot keep finished tiles in {}: {source}", path.display())]
    #[diagnostic(help("check the folder's permissions and the free space"))]
    File {
        /// The file.
        path: PathBuf,
        /// What happened.
        #[source]
        source: io::Error,
    },
}
