//! Errors of partial renders.

use std::io;
use std::path::PathBuf;

/// Version of the format of a partial render's file, which the file's first line states.
pub(super) const VERSION: u32 = 4;

/// Error of a partial render that cannot be resumed or written.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PartialError {
    /// The file is not a partial render.
    #[error("{} is no partial render of this program, and is left as it is", path.display())]
    #[diagnostic(help("finished tiles are kept under that name: move it away, or choose another output"))]
    Foreign {
        /// Path of the file.
        path: PathBuf,
    },
    /// The path names an object that is not a regular file.
    #[error("cannot keep finished tiles in {}: a {kind} has that name", path.display())]
    #[diagnostic(help("move it away, or choose another output"))]
    NotAFile {
        /// Path of the object.
        path: PathBuf,
        /// Kind of the object.
        kind: &'static str,
    },
    /// The file has another version of the format.
    #[error("{} is a partial render of version {found}, and this program goes on with version {VERSION}", path.display())]
    #[diagnostic(help("go on with the program that began it; or remove the file to begin anew"))]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// Version of the file's format.
        found: u32,
    },
    /// The settings in the file are damaged.
    #[error("the settings in {} are damaged: it is unknown of which picture its finished tiles are", path.display())]
    #[diagnostic(help("copy it again; or remove the file to begin anew, or choose another output"))]
    Damaged {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file is a partial render of another picture.
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
    /// The file has finished tiles that would be lost, because the render does not resume.
    #[error("{} has the finished tiles of an earlier render", path.display())]
    #[diagnostic(help(
        "go on from them with `outputs.partial.resume` and that render's settings; or remove the file to begin anew, \
         or choose another output"
    ))]
    Unfinished {
        /// Path of the file.
        path: PathBuf,
    },
    /// Another render is writing the file.
    #[error("another render is writing {}", path.display())]
    #[diagnostic(help("wait until it is done, or choose another output"))]
    Busy {
        /// Path of the file.
        path: PathBuf,
    },
    /// Reading or writing failed.
    #[error("cannot keep finished tiles in {}: {source}", path.display())]
    #[diagnostic(help("check the folder's permissions and the free space"))]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: io::Error,
    },
}
