//! A render that may be gone on with: finished tiles are kept in a file beside the picture, one after another.
//!
//! ```text
//! photoncard partial render 1\n
//! { settings as JSON }\n
//! tile: x, y, width, height: u32 each | its pixels, 40 bytes each | CRC-32C of both: u32
//! ...
//! ```
//!
//! Numbers are little-endian. A tile that was being written when the process ended is cut off. What a picture does not depend on
//! is not in the settings: tiles, order and cards may be others when it is gone on with.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
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
    file: Option<File>,
    failed: Option<io::Error>,
}

impl PartialRender {
    /// Begins to keep tiles of the picture that `settings` tells, all that its pixels depend on. If it is to be gone on with
    /// what is there, that is written into the film.
    ///
    /// # Errors
    /// If what is there is of another picture or cannot be read.
    pub(crate) fn begin(
        partial: &PartialSettings,
        settings: Value,
        film: &mut Film,
    ) -> Result<Self, PartialError> {
        let path = partial.path.clone();
        let this = Self { path, settings, state: Mutex::default() };
        if partial.resume {
            this.lock().file = this.resume(film)?;
        }
        Ok(this)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn error(&self, source: io::Error) -> PartialError {
        PartialError::File { path: self.path.clone(), source }
    }

    fn resume(&self, film: &mut Film) -> Result<Option<File>, PartialError> {
        let file = match File::options().read(true).write(true).open(&self.path) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(self.error(error)),
        };
        let mut reader = BufReader::new(file);
        let mut sound = self.read_head(&mut reader)?;
        while let Some(bytes) = read_tile(&mut reader, film).map_err(|error| self.error(error))? {
            sound += bytes;
        }
        let mut file = reader.into_inner();
        file.set_len(sound).and_then(|()| file.seek(SeekFrom::End(0))).map_err(|error| self.error(error))?;
        Ok(Some(file))
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
        let State { file, failed } = &mut *self.lock();
        if failed.is_none()
            && let Err(error) = self.append(file, record)
        {
            *failed = Some(error);
        }
    }

    fn append(&self, file: &mut Option<File>, record: &[u8]) -> io::Result<()> {
        let file = match file {
            Some(file) => file,
            none => {
                let mut file = File::create(&self.path)?;
                writeln!(file, "{TITLE}\n{}", self.settings)?;
                none.insert(file)
            }
        };
        // One call: another process sees a tile whole or cut off.
        file.write_all(record)
    }

    /// Tells what went wrong while tiles were kept.
    ///
    /// # Errors
    /// If anything did.
    pub(crate) fn check(&self) -> Result<(), PartialError> {
        // Whoever holds the lock writes, and tells of it later.
        let Ok(mut state) = self.state.try_lock() else { return Ok(()) };
        state.failed.take().map_or(Ok(()), |error| Err(self.error(error)))
    }
}

/// Removes the file of a partial render, when the picture is written. One that is not there is none.
///
/// # Errors
/// If it cannot be removed.
pub fn remove_partial(path: &Path) -> Result<(), PartialError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != ErrorKind::NotFound => {
            Err(PartialError::File { path: path.to_owned(), source })
        }
        _ => Ok(()),
    }
}

fn places(tile: &Tile) -> impl Iterator<Item = (u32, u32)> {
    let Tile { x, y, width, height, .. } = *tile;
    (y..y + height).flat_map(move |row| (x..x + width).map(move |column| (column, row)))
}

/// Reads the next tile into the film. Returns its bytes; `None` at the end, and of a tile that is cut off or damaged.
fn read_tile(reader: &mut impl Read, film: &mut Film) -> io::Result<Option<u64>> {
    let mut bytes = vec![0; PLACE_BYTES];
    if !read_all(reader, &mut bytes)? {
        return Ok(None);
    }
    let number = |index: usize| bytes.as_chunks().0.get(index).map_or(0, |bytes| u32::from_le_bytes(*bytes));
    let tile = Tile { id: 0, x: number(0), y: number(1), width: number(2), height: number(3) };
    let window = film.window();
    let fits = |first: u32, count: u32, [low, high]: [u32; 2]| {
        first >= low && first.checked_add(count).is_some_and(|end| end <= high)
    };
    if !fits(tile.x, tile.width, [window.x0, window.x1]) || !fits(tile.y, tile.height, [window.y0, window.y1])
    {
        return Ok(None);
    }
    bytes.resize(PLACE_BYTES + tile.pixels() as usize * PIXEL_BYTES, 0);
    let mut sum = [0; 4];
    if !read_all(reader, &mut bytes[PLACE_BYTES..])? || !read_all(reader, &mut sum)? {
        return Ok(None);
    }
    if checksum(&bytes) != u32::from_le_bytes(sum) {
        return Ok(None);
    }
    for ((x, y), pixel) in places(&tile).zip(bytes[PLACE_BYTES..].as_chunks::<PIXEL_BYTES>().0) {
        // The tile lies inside the window.
        let _ = film.write(x, y, Pixel::read(pixel));
    }
    Ok(Some((bytes.len() + sum.len()) as u64))
}

/// Fills a buffer. Returns whether there were so many bytes.
fn read_all(reader: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match reader.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
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
