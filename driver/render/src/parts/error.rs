//! Errors of parts and of their merge.

use std::io;
use std::path::PathBuf;

use photoncard_picture::film::FilmError;
use photoncard_picture::output::OutputError;

use super::dealing::Part;

/// Version of the format of a part's file, in its first line.
pub(super) const VERSION: u32 = 2;

/// Error of a part that cannot be written, or of parts that cannot be merged.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum PartError {
    /// Error of a file that is no part.
    #[error("{} is no part of a picture", path.display())]
    #[diagnostic(help("merge files that `photoncard render --part K/N` has written"))]
    Foreign {
        /// Path of the file.
        path: PathBuf,
    },
    /// Error of a part of another version of the format.
    #[error("{} is a part of version {found}, and this program merges version {VERSION}", path.display())]
    #[diagnostic(help("merge with the program that rendered it"))]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// Version of the file's format.
        found: u32,
    },
    /// Error of a part whose bytes are not those that were written.
    #[error("{} is damaged: {fault}", path.display())]
    #[diagnostic(help("copy it again, or render the part again"))]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// Description of the damage.
        fault: &'static str,
    },
    /// Error of parts of different pictures.
    #[error("parts differ in {}", differences.join("; "))]
    #[diagnostic(help("render all parts with equal settings"))]
    Differs {
        /// Descriptions of the settings that differ.
        differences: Vec<String>,
    },
    /// Error of two files of a part that have other pixels.
    #[error("{} and {} are both part {part}, with other pixels: a machine or a card was wrong", first.display(), second.display())]
    #[diagnostic(help("render the part once more; --verify compares the tiles of two cards"))]
    Unequal {
        /// Their part.
        part: Part,
        /// Path of one file.
        first: PathBuf,
        /// Path of the other file.
        second: PathBuf,
    },
    /// Error of a picture of which parts are missing.
    #[error("{} of {count} parts are missing: {}", missing.len(), named(missing))]
    #[diagnostic(help("render them, and merge all"))]
    Missing {
        /// Number of the picture's parts.
        count: u32,
        /// The missing parts.
        missing: Vec<Part>,
    },
    /// Error of a picture that is not possible.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// Error of reading a part.
    #[error("cannot read {}", path.display())]
    #[diagnostic(help("check that the path names a file and that it may be read"))]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        #[source]
        source: io::Error,
    },
    /// Error of writing a part.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// The first of some parts, and the number of the others.
fn named(parts: &[Part]) -> String {
    const NAMED: usize = 8;
    let mut text = parts.iter().take(NAMED).map(Part::to_string).collect::<Vec<_>>().join(", ");
    if parts.len() > NAMED {
        text += &format!(" and {} more", parts.len() - NAMED);
    }
    text
}
