//! The file of a prepared scene.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;

use photoncard_shared::address::LINE_BYTES;

use super::error::{PreparedError, VERSION};
use super::head::{Head, checksum};
use super::scene::PreparedScene;
use crate::heading::{HeadingFault, Kind};
use crate::output::{OutputError, PendingFile};
use crate::pack::{CardImage, MappedLines};
use crate::render::PROGRAM;

/// Kind of the file.
pub(super) const KIND: Kind = Kind { name: "photoncard prepared scene", version: VERSION };
/// Multiple of bytes at which the lines begin: a page of memory, and so a line.
const PAGE: u64 = 4096;

impl PreparedScene {
    /// Writes the prepared scene, whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), PreparedError> {
        write(self, path)
    }

    /// Opens a prepared scene.
    ///
    /// # Errors
    /// If the file is none, of another version of format or program, damaged or unreadable.
    pub fn open(path: &Path) -> Result<Self, PreparedError> {
        open(path)
    }
}

fn write(scene: &PreparedScene, path: &Path) -> Result<(), PreparedError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let mut bytes = KIND.heading(&Head::new(scene)).map_err(|error| failed(error.into()))?;
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
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() {
        return Err(unreadable(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")));
    }
    let file = File::open(path).map_err(unreadable)?;
    let mut reader = BufReader::new(&file);
    let (head, bytes): (Head, u64) = KIND.read(&mut reader).map_err(|fault| match fault {
        HeadingFault::Foreign => PreparedError::Foreign { path: path.to_owned() },
        HeadingFault::Version(found) => PreparedError::Version { path: path.to_owned(), found },
        HeadingFault::Damaged(fault) => damaged(fault),
        HeadingFault::Unreadable(source) => unreadable(source),
    })?;
    if head.program != PROGRAM {
        return Err(PreparedError::Program { path: path.to_owned(), found: head.program });
    }
    let start = bytes.next_multiple_of(PAGE);
    if found.len() != start + u64::from(head.lines) * LINE_BYTES as u64 {
        return Err(damaged("its length is not that of its card image: it is cut off, or not yet copied"));
    }
    let mut gap = vec![0; (start - bytes) as usize];
    reader.read_exact(&mut gap).map_err(unreadable)?;
    if gap.iter().any(|&byte| byte != 0) {
        return Err(damaged("there is something between its head and its card image"));
    }
    let lines = MappedLines::new(&file, start).map_err(unreadable)?;
    if lines.len() != head.lines as usize || checksum(&lines) != head.checksum {
        return Err(damaged("its card image has another checksum"));
    }
    let image = CardImage::mapped(lines).map_err(damaged)?;
    head.into_scene(image).map_err(damaged)
}
