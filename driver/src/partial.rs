//! A render that may be gone on with: finished tiles are kept in a file beside the picture, one after another.
//!
//! ```text
//! photoncard partial render 2\n
//! { settings as JSON }\n
//! record: 89 54 49 4c 45 0d 0a 1a | x, y, width, height: u32 each | pixels, 40 bytes each, with layers 80 | CRC-32C: u32
//! ...
//! ```
//!
//! Numbers are little-endian; the checksum is that of all before it in the record. A tile that was being written when the process
//! ended is cut off. A record that is damaged is skipped: the next one is found by the eight bytes that it begins with. Of two
//! records of a pixel the later one holds. What a picture does not depend on is not in the settings: tiles, order and cards may be
//! others when it is gone on with.
//!
//! The file is locked by the render that writes it. What is there under its name and is no such file is refused, and stays as it is.

mod error;
mod file;
mod records;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use photoncard_shared::message::Tile;
use serde_json::{Map, Value};

pub use self::error::PartialError;
use self::error::VERSION;
use self::file::{FAMILY, Title, read_title};
use self::records::{HEAD_BYTES, read_tiles, record};
use crate::film::Film;
use crate::sink::{FinishedTile, TileSink};

/// Bytes of the settings at the most.
const MAX_SETTINGS: u64 = 1 << 20;

/// Where finished tiles are kept, and whether those of an earlier render are taken over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartialSettings {
    /// The file.
    pub path: PathBuf,
    /// Whether to go on with what it holds.
    pub resume: bool,
}

/// The file of a render's finished tiles. It is made when there is one.
pub struct PartialRender {
    path: PathBuf,
    settings: Value,
    kept: Mutex<KeptTiles>,
}

/// Tiles in the file, and the file once it is open.
#[derive(Default)]
struct KeptTiles {
    /// The file, locked.
    file: Option<File>,
    /// Whether it begins with title and settings.
    is_begun: bool,
    /// Whether it holds a tile that this render has taken over.
    holds_earlier: bool,
    /// Whether it holds a tile that this render has taken over or kept.
    holds_tiles: bool,
    /// Where the records begin that this render has written, by the number of their tile.
    records: HashMap<u32, u64>,
    failed: Option<PartialError>,
}

impl PartialRender {
    /// Begins to keep tiles of the picture that `settings` tells, all that its pixels depend on. If it is to be gone on with
    /// what is there, that is written into the film.
    ///
    /// # Errors
    /// If what is there is no partial render or another render's, cannot be read, or is to be gone on with and of another picture.
    pub(crate) fn begin(
        partial: &PartialSettings,
        settings: Value,
        film: &mut Film,
    ) -> Result<Self, PartialError> {
        let path = partial.path.clone();
        let this = Self { path, settings, kept: Mutex::default() };
        if let Some(file) = file::open(&this.path, false)? {
            let mut kept = this.lock();
            if partial.resume {
                this.resume(&mut kept, &file, film)?;
            }
            kept.file = Some(file);
        }
        Ok(this)
    }

    fn lock(&self) -> MutexGuard<'_, KeptTiles> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn error(&self, source: io::Error) -> PartialError {
        PartialError::File { path: self.path.clone(), source }
    }

    /// Takes the sound tiles of the file into the film, and cuts off what is behind the last.
    fn resume(&self, kept: &mut KeptTiles, mut file: &File, film: &mut Film) -> Result<(), PartialError> {
        file.rewind().map_err(|error| self.error(error))?;
        let mut reader = BufReader::new(file);
        let Some(head) = self.read_head(&mut reader)? else { return Ok(()) };
        let sound = read_tiles(&mut reader, head, film).and_then(|sound| {
            file.set_len(sound)?;
            file.seek(SeekFrom::End(0))
        });
        kept.holds_earlier = sound.map_err(|error| self.error(error))? > head;
        kept.holds_tiles = kept.holds_earlier;
        kept.is_begun = true;
        Ok(())
    }

    /// Compares title and settings. Returns their bytes; `None` if the file ends before theirs do.
    fn read_head(&self, reader: &mut impl BufRead) -> Result<Option<u64>, PartialError> {
        let foreign = || PartialError::Foreign { path: self.path.clone() };
        match read_title(reader).map_err(|error| self.error(error))?.ok_or_else(foreign)? {
            Title::CutOff => return Ok(None),
            Title::Version(VERSION) => {}
            Title::Version(found) => return Err(PartialError::Version { path: self.path.clone(), found }),
        }
        let mut settings = Vec::new();
        let mut limited = reader.take(MAX_SETTINGS);
        limited.read_until(b'\n', &mut settings).map_err(|error| self.error(error))?;
        if !settings.ends_with(b"\n") && (settings.len() as u64) < MAX_SETTINGS {
            return Ok(None);
        }
        let found: Value = serde_json::from_slice(&settings).map_err(|_| foreign())?;
        let differences = differences(&found, &self.settings);
        if !differences.is_empty() {
            return Err(PartialError::Differs { path: self.path.clone(), differences });
        }
        Ok(Some((title().len() + settings.len()) as u64))
    }

    fn append(&self, kept: &mut KeptTiles, tile: &FinishedTile) -> Result<(), PartialError> {
        if kept.file.is_none() {
            kept.file = file::open(&self.path, true)?;
        }
        let Some(file) = &mut kept.file else { return Ok(()) };
        if !kept.is_begun {
            self.write_head(file).map_err(|error| self.error(error))?;
            kept.is_begun = true;
        }
        let mut write = || {
            let start = file.stream_position()?;
            // One call: another process sees a tile whole or cut off.
            file.write_all(&record(tile))?;
            Ok(start)
        };
        let start = write().map_err(|error| self.error(error))?;
        kept.records.insert(tile.tile().id, start);
        kept.holds_tiles = true;
        Ok(())
    }

    /// Makes the record of a tile that was kept one that a reader passes over: its magic number goes.
    fn strike_out(&self, kept: &mut KeptTiles, tile: &Tile) -> Result<(), PartialError> {
        let start = kept.records.remove(&tile.id);
        let (Some(start), Some(file)) = (start, &mut kept.file) else { return Ok(()) };
        let mut write = || {
            file.seek(SeekFrom::Start(start))?;
            file.write_all(&[0; HEAD_BYTES])?;
            file.seek(SeekFrom::End(0))
        };
        write().map_err(|error| self.error(error))?;
        kept.holds_tiles = kept.holds_earlier || !kept.records.is_empty();
        Ok(())
    }

    fn write_head(&self, file: &mut File) -> io::Result<()> {
        file.set_len(0)?;
        file.rewind()?;
        file.write_all(format!("{}{}\n", title(), self.settings).as_bytes())
    }

    /// Removes a file without a tile that cannot be written: there is nothing to go on from.
    fn discard_empty(&self, kept: &mut KeptTiles) {
        if let Some(file) = kept.file.take_if(|_| !kept.holds_tiles) {
            // What cannot be removed is empty.
            let _ = file.set_len(0);
            let _ = file::remove(&file, &self.path);
            kept.is_begun = false;
        }
    }

    /// Whether the file holds a tile that this render has taken over or kept.
    pub(crate) fn holds_tiles(&self) -> bool {
        self.lock().holds_tiles
    }

    /// Tells what went wrong while tiles were kept.
    ///
    /// # Errors
    /// If anything did.
    pub(crate) fn check(&self) -> Result<(), PartialError> {
        // Whoever holds the lock writes, and tells of it later.
        let Ok(mut kept) = self.kept.try_lock() else { return Ok(()) };
        kept.failed.take().map_or(Ok(()), Err)
    }

    /// Removes the file, when the picture is written. Where this render has none, one that is there is another's.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn remove(self) -> Result<(), PartialError> {
        match &self.lock().file {
            Some(file) => file::remove(file, &self.path).map_err(|error| self.error(error)),
            None => Ok(()),
        }
    }
}

/// Failures are kept for the render loop, which asks for them.
impl TileSink for PartialRender {
    fn put(&self, tile: &FinishedTile) {
        let mut kept = self.lock();
        if kept.failed.is_none()
            && let Err(error) = self.append(&mut kept, tile)
        {
            self.discard_empty(&mut kept);
            kept.failed = Some(error);
        }
    }

    fn revoke(&self, tile: &Tile) {
        let mut kept = self.lock();
        if let Err(error) = self.strike_out(&mut kept, tile) {
            kept.failed.get_or_insert(error);
        }
    }
}

/// The first line.
fn title() -> String {
    format!("{FAMILY}{VERSION}\n")
}

/// Every setting that is another, in words.
fn differences(found: &Value, asked: &Value) -> Vec<String> {
    let empty = Map::new();
    let [found, asked] = [found, asked].map(|value| value.as_object().unwrap_or(&empty));
    let names = asked.keys().chain(found.keys().filter(|name| !asked.contains_key(*name)));
    let differing = names.filter(|name| found.get(*name) != asked.get(*name));
    let say = |value: Option<&Value>| value.map_or("nothing".to_owned(), Value::to_string);
    differing
        .map(|name| format!("{name} was {} and is {}", say(found.get(name)), say(asked.get(name))))
        .collect()
}
