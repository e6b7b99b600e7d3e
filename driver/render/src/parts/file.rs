//! Reads and writes the file of a part.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, Write};
use std::path::{Path, PathBuf};

use photoncard_picture::film::Film;
use photoncard_picture::heading::{Heading, HeadingFault, Kind};
use photoncard_picture::output::{OutputError, PendingFile};
use photoncard_picture::sink::FinishedTile;
use photoncard_shared::message::Tile;

use super::error::{PartError, VERSION};
use super::head::{PartHead, PartPicture};
use crate::partial::records::{decode, record, record_bytes};

const KIND: Kind = Kind { name: "photoncard part", version: VERSION };

/// Writes the file of the part `head.part`, whole or not at all. `film` has the pixels of the part.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, head: &PartHead, film: &Film) -> Result<(), PartError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let mut file = io::BufWriter::new(PendingFile::create(path)?);
    let (bytes, sum) = KIND.heading(head).map_err(|error| failed(error.into()))?;
    file.write_all(&bytes).map_err(failed)?;
    // A finished render has all pixels of its part.
    for tile in head.part.patches(film.window()).iter().filter_map(|patch| film.finished(patch)) {
        file.write_all(&record(&tile, 0, sum)).map_err(failed)?;
    }
    Ok(file.into_inner().map_err(|error| failed(error.into_error()))?.commit()?)
}

/// File of a part that was opened, with its head.
pub(super) struct PartFile {
    pub(super) path: PathBuf,
    pub(super) head: PartHead,
    pub(super) picture: PartPicture,
    /// Checksum of the head.
    checksum: u32,
    /// Size of the head and of the file, bytes.
    bytes: [u64; 2],
}

impl PartFile {
    /// Reads and checks the head of a part.
    ///
    /// # Errors
    /// If the file is not a part, of another version, or unreadable, or its head is damaged.
    pub(super) fn open(path: &Path) -> Result<Self, PartError> {
        let unreadable = |source| PartError::Unreadable { path: path.to_owned(), source };
        let damaged = |fault| PartError::Damaged { path: path.to_owned(), fault };
        let found = std::fs::metadata(path).map_err(unreadable)?;
        if !found.is_file() {
            return Err(unreadable(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")));
        }
        let mut reader = BufReader::new(File::open(path).map_err(unreadable)?);
        let Heading { head, bytes, checksum }: Heading<PartHead> =
            KIND.read(&mut reader).map_err(|fault| match fault {
                HeadingFault::Foreign => PartError::Foreign { path: path.to_owned() },
                HeadingFault::Version(found) => PartError::Version { path: path.to_owned(), found },
                HeadingFault::Damaged(fault) => damaged(fault),
                HeadingFault::Unreadable(source) => unreadable(source),
            })?;
        let picture = head.picture().ok_or_else(|| damaged("its head is of no picture"))?;
        let bytes = [bytes, found.len()];
        Ok(Self { path: path.to_owned(), head, picture, checksum, bytes })
    }

    /// Checks that the file has the length of its head and of the records of `patches`, the patches of the
    /// part.
    ///
    /// # Errors
    /// If the file has another length.
    pub(super) fn check_length(&self, patches: &[Tile]) -> Result<(), PartError> {
        let records: u64 = patches.iter().map(|patch| record_bytes(patch, &self.picture.format)).sum();
        let [head, whole] = self.bytes;
        if whole.checked_sub(head) == Some(records) {
            return Ok(());
        }
        let fault = "its length is not that of its part: it is cut off, or not yet copied";
        Err(PartError::Damaged { path: self.path.clone(), fault })
    }

    /// Reads the `patches` of the part and passes them to `put`. The head is read again before and after
    /// them, to detect that the file was overwritten.
    ///
    /// # Errors
    /// If the file is damaged, unreadable, or has changed since it was opened; and the errors of `put`.
    pub(super) fn read(
        &self,
        patches: &[Tile],
        mut put: impl FnMut(FinishedTile) -> Result<(), PartError>,
    ) -> Result<(), PartError> {
        let unreadable = |source| PartError::Unreadable { path: self.path.clone(), source };
        let fault = "pixels of it have another checksum, or are those of another part";
        let damaged = || PartError::Damaged { path: self.path.clone(), fault };
        let mut reader = BufReader::new(File::open(&self.path).map_err(unreadable)?);
        self.check_head(&mut reader)?;
        for patch in patches {
            let mut bytes = vec![0; record_bytes(patch, &self.picture.format) as usize];
            match reader.read_exact(&mut bytes) {
                Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Err(damaged()),
                read => read.map_err(unreadable)?,
            }
            put(decode(&bytes, patch, self.picture.format, self.checksum).ok_or_else(damaged)?)?;
        }
        self.check_head(&mut reader)
    }

    /// Checks that the file still begins with the same head. The reader is then at the end of the head.
    fn check_head(&self, reader: &mut BufReader<File>) -> Result<(), PartError> {
        reader.rewind().map_err(|source| PartError::Unreadable { path: self.path.clone(), source })?;
        match KIND.read::<PartHead>(reader) {
            Ok(found) if found.checksum == self.checksum => Ok(()),
            _ => {
                Err(PartError::Damaged { path: self.path.clone(), fault: "it has changed while it was read" })
            }
        }
    }
}
