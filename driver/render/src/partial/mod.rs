//! Partial renders: finished tiles are appended to a file beside the picture, so that a later render can
//! resume from them.
//!
//! ```text
//! photoncard partial render 4\n
//! { settings as JSON }\n
//! CRC-32C: u32
//! record: 89 54 49 4c 45 0d 0a 1a | x, y, width, height, first sample, samples: u32 each
//!         | pixels, 60 to 236 bytes each | CRC-32C: u32
//! ...
//! ```
//!
//! Numbers are little-endian. The first checksum covers the two lines. The checksum of a record covers the
//! first checksum and all preceding bytes of the record. An incomplete last record, left when the process
//! ended during a write, is truncated. A damaged record is skipped: the reader searches for the magic number
//! of the next one. If two records contain the same samples of a pixel, the later one is used. The settings
//! are those that pixels depend on, so that a resumed render can use other tiles, another order and other
//! cards. The number of samples is not among them: a picture with more samples takes over complete ranges of
//! samples, beginning with the first sample, and renders the others.
//!
//! The render that writes the file locks it. A file with this name that is not a partial render is refused
//! and left unchanged. The same holds for a file with tiles if the render does not resume.

mod error;
mod file;
mod head;
pub(crate) mod records;
mod samples;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufReader, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use photoncard_shared::message::Tile;
use serde_json::Value;

pub use self::error::PartialError;
pub use self::head::PartialSettings;
use self::head::{Head, check_empty, differences, encode, read_head};
use self::records::{HEAD_BYTES, read_tiles, record};
use self::samples::{KeptSamples, Split};
use photoncard_picture::film::Film;
use photoncard_picture::sink::{FinishedTile, TileSink};

/// File of a render's finished tiles. It is created when the first tile is finished.
pub struct PartialRender {
    path: PathBuf,
    settings: Value,
    /// Number of the first sample in the tiles that this render appends.
    first_sample: u32,
    kept: Mutex<KeptTiles>,
}

/// State of the file of finished tiles.
#[derive(Default)]
struct KeptTiles {
    /// The file, locked; `None` until it is created.
    file: Option<File>,
    /// Checksum of title and settings; `None` until they are written.
    head: Option<u32>,
    /// True if the file has tiles of the earlier render.
    holds_earlier: bool,
    /// True if the file has tiles of this render or of the earlier one.
    holds_tiles: bool,
    /// Offset in the file of each record that this render wrote, by tile number.
    records: HashMap<u32, u64>,
    failed: Option<PartialError>,
}

impl PartialRender {
    /// Opens the file if it exists. `settings` identify the picture: all settings that its pixels depend on,
    /// except the number of samples, which `film` states. With [`PartialSettings::resume`], the tiles in the
    /// file are written into `film`. If they contain all pixels of the picture's first samples, a film of
    /// these is the second result, and `film` has the remaining samples.
    ///
    /// # Errors
    /// If the file is not a partial render, in use by another render, or unreadable; if its settings are
    /// damaged, or differ although it is resumed; or if it has tiles and is not resumed.
    pub(crate) fn begin(
        partial: &PartialSettings,
        settings: Value,
        film: &mut Film,
    ) -> Result<(Self, Option<Film>), PartialError> {
        let path = partial.path.clone();
        let mut this = Self { path, settings, first_sample: 0, kept: Mutex::default() };
        let Some(file) = file::open(&this.path, false)? else { return Ok((this, None)) };
        let base = if partial.resume {
            this.resume(&file, film)?
        } else {
            check_empty(&file, &this.path)?;
            None
        };
        this.lock().file = Some(file);
        this.first_sample = base.as_ref().map_or(0, |base| base.format().samples);
        Ok((this, base))
    }

    fn lock(&self) -> MutexGuard<'_, KeptTiles> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn error(&self, source: io::Error) -> PartialError {
        PartialError::File { path: self.path.clone(), source }
    }

    /// Writes the valid tiles of the file into the film, and truncates the file after the last valid tile.
    /// Returns a film of the first samples if the file has all tiles of these samples.
    fn resume(&self, mut file: &File, film: &mut Film) -> Result<Option<Film>, PartialError> {
        file.rewind().map_err(|error| self.error(error))?;
        let mut reader = BufReader::new(file);
        let Some(head) = read_head(&mut reader, &self.path)? else { return Ok(None) };
        let differences = differences(&head.settings, &self.settings);
        if !differences.is_empty() {
            return Err(PartialError::Differs { path: self.path.clone(), differences });
        }
        let asked = film.format().samples;
        let mut found = KeptSamples::new(film);
        let sound = read_tiles(&mut reader, head.bytes, head.checksum, &mut found)
            .map_err(|error| self.error(error))?;
        self.check_unchanged(&mut reader, &head)?;
        let Split { base, rest } = found.split().map_err(|samples| PartialError::Differs {
            path: self.path.clone(),
            differences: vec![format!("spp was {samples}, and not all of them are finished, and is {asked}")],
        })?;
        match rest {
            Some(rest) => *film = rest,
            None => film.set_first_sample(base.as_ref().map_or(0, |base| base.format().samples)),
        }
        file.set_len(sound).and_then(|()| file.seek(SeekFrom::End(0))).map_err(|error| self.error(error))?;
        let mut kept = self.lock();
        kept.holds_earlier = sound > head.bytes;
        kept.holds_tiles = kept.holds_earlier;
        kept.head = Some(head.checksum);
        Ok(base)
    }

    /// Checks that a file still has the head `head`. A file with another head belongs to another picture, and
    /// must not be truncated.
    fn check_unchanged(&self, reader: &mut BufReader<&File>, head: &Head) -> Result<(), PartialError> {
        reader.rewind().map_err(|error| self.error(error))?;
        let is_same = read_head(reader, &self.path)?.is_some_and(|again| again.checksum == head.checksum);
        is_same.then_some(()).ok_or_else(|| self.written_over("read"))
    }

    /// Checks that the file still has the settings of this render, with the checksum `head`. If it is the
    /// file of another picture, tiles appended to it would be lost.
    fn check_own(&self, mut file: &File, head: u32) -> Result<(), PartialError> {
        file.rewind().map_err(|error| self.error(error))?;
        let found = read_head(&mut BufReader::new(file), &self.path)?;
        let is_own = found.is_some_and(|found| found.checksum == head);
        is_own.then_some(()).ok_or_else(|| self.written_over("rendered"))
    }

    fn written_over(&self, when: &str) -> PartialError {
        let differences = vec![format!("it was written over while it was {when}")];
        PartialError::Differs { path: self.path.clone(), differences }
    }

    fn append(&self, kept: &mut KeptTiles, tile: &FinishedTile) -> Result<(), PartialError> {
        if kept.file.is_none() {
            let file = file::open(&self.path, true)?;
            file.as_ref().map_or(Ok(()), |file| check_empty(file, &self.path))?;
            kept.file = file;
        }
        let Some(file) = &mut kept.file else { return Ok(()) };
        let head = match kept.head {
            Some(head) => self.check_own(file, head).map(|()| head)?,
            None => *kept.head.insert(self.write_head(file).map_err(|error| self.error(error))?),
        };
        let mut write = || {
            let start = file.seek(SeekFrom::End(0))?;
            // With a single call, another process sees the tile whole or truncated.
            file.write_all(&record(tile, self.first_sample, head))?;
            Ok(start)
        };
        let start = write().map_err(|error| self.error(error))?;
        kept.records.insert(tile.tile().id, start);
        kept.holds_tiles = true;
        Ok(())
    }

    /// Invalidates the record of a tile by overwriting the record's head with zeros, so that readers skip it.
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

    /// Writes title and settings. Returns their checksum.
    fn write_head(&self, file: &mut File) -> io::Result<u32> {
        let (bytes, sum) = encode(&self.settings);
        file.set_len(0)?;
        file.rewind()?;
        file.write_all(&bytes)?;
        Ok(sum)
    }

    /// Removes the file after a failed write if it has no tiles, because there is nothing to resume from.
    fn discard_empty(&self, kept: &mut KeptTiles) {
        if let Some(file) = kept.file.take_if(|_| !kept.holds_tiles) {
            // If the removal fails, the file is empty at least.
            let _ = file.set_len(0);
            let _ = file::remove(&file, &self.path);
            kept.head = None;
        }
    }

    /// Returns whether the file has tiles of this or the earlier render.
    pub(crate) fn holds_tiles(&self) -> bool {
        self.lock().holds_tiles
    }

    /// Returns the first failure of writing a tile. Each failure is returned once.
    ///
    /// # Errors
    /// If a write failed.
    pub(crate) fn check(&self) -> Result<(), PartialError> {
        // If another thread holds the lock, it is writing a tile: the next call finds its failure.
        let Ok(mut kept) = self.kept.try_lock() else { return Ok(()) };
        kept.failed.take().map_or(Ok(()), Err)
    }

    /// Removes the file; called after the picture is written. A file that this render did not open belongs to
    /// another render, and stays.
    ///
    /// # Errors
    /// If the file cannot be removed.
    pub fn remove(self) -> Result<(), PartialError> {
        match &self.lock().file {
            Some(file) => file::remove(file, &self.path).map_err(|error| self.error(error)),
            None => Ok(()),
        }
    }
}

/// Stores tiles. A failure is kept until the render loop calls `PartialRender::check`.
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
