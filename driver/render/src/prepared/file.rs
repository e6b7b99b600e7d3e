//! Reads and writes the file of a prepared scene.

use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use photoncard_map::pack::CardImage;
use photoncard_picture::allocation::{self, OutOfMemory};
use photoncard_picture::heading::{Heading, HeadingFault, Kind};
use photoncard_picture::output::{OutputError, PendingFile};
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::checksum::Checksum;
use photoncard_shared::embedded::FILE_ALIGNMENT;

use super::head::Head;
use super::scene::PreparedScene;
use crate::PROGRAM;

pub(super) const KIND: Kind = Kind { name: "photoncard prepared scene", version: VERSION };
/// Alignment of the card image in the file, bytes: a page of memory, which is a multiple of a line.
const PAGE: u64 = FILE_ALIGNMENT as u64;
/// Maximum number of lines of a card image, because no card has more than 4 GiB of memory.
const MAX_LINES: u32 = u32::MAX / LINE_BYTES as u32;
/// Number of bytes that are read at once.
const BUFFER: usize = 1 << 18;

impl PreparedScene {
    /// Writes the prepared scene, whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), PreparedError> {
        write(self, path)
    }

    /// Reads a prepared scene into memory, and checks it.
    ///
    /// # Errors
    /// If the file is not a prepared scene, of another version of format or program, damaged, or unreadable.
    pub fn open(path: &Path) -> Result<Self, PreparedError> {
        open(path)
    }
}

fn write(scene: &PreparedScene, path: &Path) -> Result<(), PreparedError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let (mut bytes, _) = KIND.heading(&Head::new(scene)).map_err(|error| failed(error.into()))?;
    bytes.resize(bytes.len().next_multiple_of(PAGE as usize), 0);
    let mut file = BufWriter::new(PendingFile::create(path)?);
    let lines = scene.kept.prepared.image.lines();
    let mut parts = std::iter::once(&*bytes).chain(lines.iter().map(|line| &line.0[..]));
    parts.try_for_each(|part| file.write_all(part)).map_err(failed)?;
    Ok(file.into_inner().map_err(|error| failed(error.into_error()))?.commit()?)
}

fn open(path: &Path) -> Result<PreparedScene, PreparedError> {
    let unreadable = |source| PreparedError::Unreadable { path: path.to_owned(), source };
    let damaged = |fault| PreparedError::Damaged { path: path.to_owned(), fault };
    let cut_off = |error: io::Error| match error.kind() {
        ErrorKind::UnexpectedEof => damaged("it was cut off while it was read"),
        _ => unreadable(error),
    };
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() {
        return Err(unreadable(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")));
    }
    let file = File::open(path).map_err(unreadable)?;
    let mut reader = BufReader::with_capacity(BUFFER, file);
    let Heading { head, bytes, .. }: Heading<Head> = KIND.read(&mut reader).map_err(|fault| match fault {
        HeadingFault::Foreign => PreparedError::Foreign { path: path.to_owned() },
        HeadingFault::Version(found) => PreparedError::Version { path: path.to_owned(), found },
        HeadingFault::Damaged(fault) => damaged(fault),
        HeadingFault::Unreadable(source) => unreadable(source),
    })?;
    if head.program != PROGRAM {
        return Err(PreparedError::Program { path: path.to_owned(), found: head.program });
    }
    if head.lines > MAX_LINES {
        return Err(damaged("its card image is larger than the memory of any card"));
    }
    let start = bytes.next_multiple_of(PAGE);
    if found.len() != start + u64::from(head.lines) * LINE_BYTES as u64 {
        return Err(damaged("its length is not that of its card image: it is cut off, or not yet copied"));
    }
    let mut gap = vec![0; (start - bytes) as usize];
    reader.read_exact(&mut gap).map_err(cut_off)?;
    if gap.iter().any(|&byte| byte != 0) {
        return Err(damaged("there is something between its head and its card image"));
    }
    let mut lines = empty(head.lines)
        .map_err(|OutOfMemory { bytes }| PreparedError::Memory { path: path.to_owned(), bytes })?;
    let checksum = read_lines(&mut reader, head.lines, &mut lines).map_err(cut_off)?;
    if checksum != head.checksum {
        return Err(damaged("its card image has another checksum"));
    }
    let image = CardImage::of_lines(lines).map_err(damaged)?;
    head.into_scene(image).map_err(damaged)
}

/// Creates an empty list with room for `count` lines.
fn empty(count: u32) -> Result<Vec<Line>, OutOfMemory> {
    let mut lines = Vec::new();
    let bytes = u64::from(count) * LINE_BYTES as u64;
    lines.try_reserve_exact(count as usize).map_err(|_| OutOfMemory { bytes })?;
    Ok(lines)
}

/// Reads lines into memory. Returns the CRC-32C of the lines as they are in memory, so that later changes of
/// the file do not matter.
fn read_lines(reader: &mut impl BufRead, count: u32, lines: &mut Vec<Line>) -> io::Result<u32> {
    let mut sum = Checksum::default();
    for _ in 0..count {
        let mut line = Line::ZERO;
        reader.read_exact(&mut line.0)?;
        sum.update(&line.0);
        lines.push(line);
    }
    Ok(sum.value())
}

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
