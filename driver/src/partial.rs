//! A render that may be gone on with: finished tiles are kept in a file beside the picture, one after another.
//!
//! ```text
//! photoncard partial render 1\n
//! { settings as JSON }\n
//! tile: x, y, width, height: u32 each | its pixels, 40 bytes each | CRC-32C of both: u32
//! ...
//! ```
//!
//! Numbers are little-endian. A tile that was being written when the process ended is cut off; one that is damaged is skipped.
//! What a picture does not depend on is not in the settings: tiles, order and cards may be others when it is gone on with.
//! The file is locked by the render that writes it.

#[cfg(test)]
mod tests;

use std::fs::{self, File, TryLockError};
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use photoncard_shared::checksum::checksum;
use photoncard_shared::message::{PIXEL_BYTES, Pixel, Tile};
use serde_json::{Map, Value};

use crate::film::Film;

/// The first line.
const TITLE: &str = "photoncard partial render 1";
/// Bytes of the settings at the most.
const MOST_SETTINGS: u64 = 1 << 20;
const PLACE_BYTES: usize = 16;
const CHECKSUM_BYTES: usize = 4;

/// Where finished tiles are kept, and whether those of an earlier render are taken over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartialSettings {
    /// The file.
    pub path: PathBuf,
    /// Whether to go on with what it holds.
    pub resume: bool,
}

/// Why a partial render cannot be gone on with, or kept.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PartialError {
    /// The file is none of this program.
    #[error("{} is no partial render", path.display())]
    #[diagnostic(help("remove it, or render without --resume"))]
    Foreign {
        /// The file.
        path: PathBuf,
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

/// The file of a render's finished tiles. It is made when there is one.
pub struct PartialRender {
    path: PathBuf,
    settings: Value,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// The file, locked.
    file: Option<File>,
    /// Whether it begins with title and settings.
    is_begun: bool,
    failed: Option<PartialError>,
}

impl PartialRender {
    /// Begins to keep tiles of the picture that `settings` tells, all that its pixels depend on. If it is to be gone on with
    /// what is there, that is written into the film.
    ///
    /// # Errors
    /// If what is there is of another picture, is another render's, or cannot be read.
    pub(crate) fn begin(
        partial: &PartialSettings,
        settings: Value,
        film: &mut Film,
    ) -> Result<Self, PartialError> {
        let path = partial.path.clone();
        let this = Self { path, settings, state: Mutex::default() };
        match File::options().read(true).write(true).open(&this.path) {
            Ok(file) => {
                this.lock_file(&file)?;
                if partial.resume {
                    this.resume(&file, film)?;
                }
                *this.lock() = State { file: Some(file), is_begun: partial.resume, failed: None };
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(this.error(error)),
        }
        Ok(this)
    }

    /// Makes the file this render's own. Where the system has no locks, nothing is checked.
    fn lock_file(&self, file: &File) -> Result<(), PartialError> {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(PartialError::Busy { path: self.path.clone() }),
            Err(TryLockError::Error(error)) if error.kind() != ErrorKind::Unsupported => {
                Err(self.error(error))
            }
            _ => Ok(()),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn error(&self, source: io::Error) -> PartialError {
        PartialError::File { path: self.path.clone(), source }
    }

    /// Takes the sound tiles of the file into the film, and cuts off what is behind the last.
    fn resume(&self, mut file: &File, film: &mut Film) -> Result<(), PartialError> {
        let mut reader = BufReader::new(file);
        let head = self.read_head(&mut reader)?;
        let sound = read_tiles(&mut reader, head, film).and_then(|sound| {
            file.set_len(sound)?;
            file.seek(SeekFrom::End(0))
        });
        sound.map(drop).map_err(|error| self.error(error))
    }

    /// Compares title and settings. Returns their bytes.
    fn read_head(&self, reader: &mut impl BufRead) -> Result<u64, PartialError> {
        let foreign = || PartialError::Foreign { path: self.path.clone() };
        let mut line = |expected: &str| -> Result<String, PartialError> {
            let mut text = Vec::new();
            let mut limited = reader.by_ref().take(MOST_SETTINGS);
            limited.read_until(b'\n', &mut text).map_err(|error| self.error(error))?;
            let text = String::from_utf8(text).map_err(|_| foreign())?;
            let is_line = text.ends_with('\n') && text.starts_with(expected);
            is_line.then_some(text).ok_or_else(foreign)
        };
        let title = line(TITLE)?;
        let settings = line("{")?;
        let found: Value = serde_json::from_str(&settings).map_err(|_| foreign())?;
        let differences = differences(&found, &self.settings);
        if !differences.is_empty() {
            return Err(PartialError::Differs { path: self.path.clone(), differences });
        }
        Ok((title.len() + settings.len()) as u64)
    }

    /// What is kept of a finished tile.
    pub(crate) fn record(tile: &Tile, film: &Film) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(PLACE_BYTES + tile.pixels() as usize * PIXEL_BYTES + 4);
        for number in [tile.x, tile.y, tile.width, tile.height] {
            bytes.extend(number.to_le_bytes());
        }
        for (x, y) in places(tile) {
            bytes.extend(film.pixel(x, y).copied().unwrap_or_default().to_bytes());
        }
        bytes.extend(checksum(&bytes).to_le_bytes());
        bytes
    }

    /// Keeps a finished tile's record. What goes wrong is told by [`Self::check`].
    pub(crate) fn keep(&self, record: &[u8]) {
        let mut state = self.lock();
        if state.failed.is_none()
            && let Err(error) = self.append(&mut state, record)
        {
            state.failed = Some(error);
        }
    }

    fn append(&self, state: &mut State, record: &[u8]) -> Result<(), PartialError> {
        let file = match &mut state.file {
            Some(file) => file,
            none => none.insert(self.create()?),
        };
        let begin = |file: &mut File| {
            file.set_len(0)?;
            writeln!(file, "{TITLE}\n{}", self.settings)
        };
        if !std::mem::replace(&mut state.is_begun, true) {
            begin(file).map_err(|error| self.error(error))?;
        }
        // One call: another process sees a tile whole or cut off.
        file.write_all(record).map_err(|error| self.error(error))
    }

    fn create(&self) -> Result<File, PartialError> {
        // Not cut off before it is locked: another render may have made it meanwhile.
        let options = File::options().read(true).write(true).create(true).truncate(false).open(&self.path);
        let file = options.map_err(|error| self.error(error))?;
        self.lock_file(&file)?;
        Ok(file)
    }

    /// Tells what went wrong while tiles were kept.
    ///
    /// # Errors
    /// If anything did.
    pub(crate) fn check(&self) -> Result<(), PartialError> {
        // Whoever holds the lock writes, and tells of it later.
        let Ok(mut state) = self.state.try_lock() else { return Ok(()) };
        state.failed.take().map_or(Ok(()), Err)
    }

    /// Removes the file, when the picture is written. One that is not there is none.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn remove(self) -> Result<(), PartialError> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(self.error(error)),
            _ => Ok(()),
        }
    }
}

fn places(tile: &Tile) -> impl Iterator<Item = (u32, u32)> {
    let Tile { x, y, width, height, .. } = *tile;
    (y..y + height).flat_map(move |row| (x..x + width).map(move |column| (column, row)))
}

/// Reads all sound tiles of a file, from `start` on, into the film. Returns where the last one ends. After what is no sound tile
/// the next one is looked for at every byte: its place in the picture and its checksum tell it.
fn read_tiles(reader: &mut BufReader<&File>, start: u64, film: &mut Film) -> io::Result<u64> {
    let end = reader.get_ref().metadata()?.len();
    let (mut at, mut sound) = (start, start);
    while at < end {
        let position = reader.stream_position()?;
        reader.seek_relative(at as i64 - position as i64)?;
        match read_tile(reader, end - at, film)? {
            Some(bytes) => {
                at += bytes;
                sound = at;
            }
            None => at += 1,
        }
    }
    Ok(sound)
}

/// Reads a tile of at most `most` bytes into the film. Returns its bytes; `None` if there is no sound one.
fn read_tile(reader: &mut impl Read, most: u64, film: &mut Film) -> io::Result<Option<u64>> {
    let mut place = [0; PLACE_BYTES];
    if most < PLACE_BYTES as u64 || !read_all(reader, &mut place)? {
        return Ok(None);
    }
    let number = |index: usize| place.as_chunks().0.get(index).map_or(0, |bytes| u32::from_le_bytes(*bytes));
    let tile = Tile { id: 0, x: number(0), y: number(1), width: number(2), height: number(3) };
    let window = film.window();
    let fits = |first: u32, count: u32, [low, high]: [u32; 2]| {
        count > 0 && first >= low && first.checked_add(count).is_some_and(|end| end <= high)
    };
    if !fits(tile.x, tile.width, [window.x0, window.x1]) || !fits(tile.y, tile.height, [window.y0, window.y1])
    {
        return Ok(None);
    }
    let length = (PLACE_BYTES + CHECKSUM_BYTES) as u64 + tile.pixels() * PIXEL_BYTES as u64;
    if length > most {
        return Ok(None);
    }
    let mut bytes = place.to_vec();
    bytes.resize(length as usize, 0);
    if !read_all(reader, &mut bytes[PLACE_BYTES..])? {
        return Ok(None);
    }
    let (bytes, sum) = bytes.split_at(length as usize - CHECKSUM_BYTES);
    if checksum(bytes).to_le_bytes() != sum {
        return Ok(None);
    }
    for ((x, y), pixel) in places(&tile).zip(bytes[PLACE_BYTES..].as_chunks::<PIXEL_BYTES>().0) {
        // The tile lies inside the window.
        let _ = film.write(x, y, Pixel::read(pixel));
    }
    Ok(Some(length))
}

/// Fills a buffer. Returns whether there were so many bytes.
fn read_all(reader: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match reader.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// Text of a file, fit for a terminal.
fn printable(text: &str) -> String {
    let escape = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    text.chars().map(escape).collect()
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
        .map(|difference| printable(&difference))
        .collect()
}
