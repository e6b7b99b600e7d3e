//! Errors of parts and of their merge.

use std::io;
use std::path::PathBuf;

use photoncard_picture::film::FilmError;
use photoncard_picture::output::OutputError;

use super::dealing::{Part, named};

/// Version of the format of a part's file. The first line states it.
pub(super) const VERSION: u32 = 2;

/// Error of a part that cannot be written, or of parts that cannot be merged.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum PartError {
    /// The file is not a part.
    #[error("{} is no part of a picture", path.display())]
    #[diagnostic(help("merge files that `photoncard render --part K/N` has written"))]
    Foreign {
        /// Path of the file.
        path: PathBuf,
    },
    /// The part has another version of the format.
    #[error("{} is a part of version {found}, and this program merges version {VERSION}", path.display())]
    #[diagnostic(help("merge with the program that rendered it"))]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// Version of the file's format.
        found: u32,
    },
    /// The bytes of the part are not those that were written.
    #[error("{} is damaged: {fault}", path.display())]
    #[diagnostic(help("copy it again, or render the part again"))]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// Description of the damage.
        fault: &'static str,
    },
    /// The parts are of different pictures.
    #[error("parts differ in {}", differences.join("; "))]
    #[diagnostic(help("render all parts with equal settings"))]
    Differs {
        /// Descriptions of the settings that differ.
        differences: Vec<String>,
    },
    /// Two files of the same part have different pixels.
    #[error("{} and {} are both part {part}, with other pixels: a machine or a card was wrong", first.display(), second.display())]
    #[diagnostic(help("render the part once more; `cards.verify` compares the tiles of two cards"))]
    Unequal {
        /// Part of both files.
        part: Part,
        /// Path of one file.
        first: PathBuf,
        /// Path of the other file.
        second: PathBuf,
    },
    /// Parts of the picture are missing.
    #[error("{} of {count} parts are missing: {}", missing.len(), named(missing))]
    #[diagnostic(help("render them, and merge all"))]
    Missing {
        /// Number of parts of the picture.
        count: u32,
        /// The missing parts.
        missing: Vec<Part>,
    },
    /// The film of the picture is not possible.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// A part cannot be read.
    #[error("cannot read {}", path.display())]
    #[diagnostic(help("check that the path names a file and that it may be read"))]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: io::Error,
    },
    /// A part cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
