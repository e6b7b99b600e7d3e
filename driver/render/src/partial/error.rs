//! Errors of partial renders.

use std::io;
use std::path::PathBuf;

/// Version of the file's format, in its first line.
pub(super) const VERSION: u32 = 4;

/// Error of a partial render that cannot be resumed or written.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PartialError {
    /// Error of a file that is no partial render.
    #[error("{} is no partial render of this program, and is left as it is", path.display())]
    #[diagnostic(help("finished tiles are kept under that name: move it away, or choose another output"))]
    Foreign {
        /// Path of the file.
        path: PathBuf,
    },
    /// Error of an object of this name that is no regular file.
    #[error("cannot keep finished tiles in {}: a {kind} has that name", path.display())]
    #[diagnostic(help("move it away, or choose another output"))]
    NotAFile {
        /// Path of the object.
        path: PathBuf,
        /// Kind of the object.
        kind: &'static str,
    },
    /// Error of a file of another version of the format.
    #[error("{} is a partial render of version {found}, and this program goes on with version {VERSION}", path.display())]
    #[diagnostic(help("go on with the program that began it; or remove the file to begin anew"))]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// Version of the file's format.
        found: u32,
    },
    /// Error of a partial render whose settings are not as they were written.
    #[error("the settings in {} are damaged: it is unknown of which picture its finished tiles are", path.display())]
    #[diagnostic(help("copy it again; or remove the file to begin anew, or choose another output"))]
    Damaged {
        /// Path of the file.
        path: PathBuf,
    },
    /// Error of a partial render of another picture.
    #[error("{} is of another picture: {}", path.display(), differences.join("; "))]
    #[diagnostic(help(
        "render with the same settings; or remove the file to begin anew, or choose another output"
    ))]
    Differs {
        /// Path of the file.
        path: PathBuf,
        /// Descriptions of the settings that differ.
        differences: Vec<String>,
    },
    /// Error of finished tiles that would be lost, as the render is not to go on from them.
    #[error("{} has the finished tiles of an earlier render", path.display())]
    #[diagnostic(help(
        "go on from them with --resume and that render's settings; or remove the file to begin anew, or \
         choose another output"
    ))]
    Unfinished {
        /// Path of the file.
        path: PathBuf,
    },
    /// Error of a file that another render is writing.
    #[error("another render is writing {}", path.display())]
    #[diagnostic(help("wait until it is done, or choose another output"))]
    Busy {
        /// Path of the file.
        path: PathBuf,
    },
    /// Error of reading or writing.
    #[error("cannot keep finished tiles in {}: {source}", path.display())]
    #[diagnostic(help("check the folder's permissions and the free space"))]
    File {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        #[source]
        source: io::Error,
    },
}
