//! Head of a partial render: title, settings, and their checksum.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};

use photoncard_shared::checksum::checksum;
use serde_json::{Map, Value};

use super::error::{PartialError, VERSION};
use super::file::{self, FAMILY, Title, read_title};
use super::records::has_record;

/// Maximum size of the settings, bytes.
const MAX_SETTINGS: u64 = 1 << 20;

pub(super) struct Head {
    /// Settings that identify the picture, as values by option names.
    pub(super) settings: Map<String, Value>,
    pub(super) bytes: u64,
    /// CRC-32C of title and settings.
    pub(super) checksum: u32,
}

/// File of finished tiles, and whether a render resumes from it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartialSettings {
    /// Path of the file.
    pub path: PathBuf,
    /// True to take over the tiles in the file. If false, a file with tiles is an error.
    pub resume: bool,
}

impl PartialSettings {
    /// Reads the settings in the file that a render resumes from, as values by option names. Returns `None`
    /// without `resume`, or if the file does not exist or ends within its head.
    ///
    /// # Errors
    /// If the file is not a partial render of this version, its settings are damaged, or it is in use by
    /// another render or unreadable.
    pub fn kept(&self) -> Result<Option<Map<String, Value>>, PartialError> {
        let Some(file) = self.resume.then(|| file::open(&self.path, false)).transpose()?.flatten() else {
            return Ok(None);
        };
        (&file).rewind().map_err(failed(&self.path))?;
        Ok(read_head(&mut BufReader::new(&file), &self.path)?.map(|head| head.settings))
    }

    /// Checks that a render may write the file. Without `resume`, the file must have no tiles.
    ///
    /// # Errors
    /// If the file is in use, unreadable or not a partial render; without `resume`, also if it has tiles or
    /// is damaged.
    pub fn check_free(&self) -> Result<(), PartialError> {
        let file = file::open(&self.path, false)?;
        file.filter(|_| !self.resume).map_or(Ok(()), |file| check_empty(&file, &self.path))
    }
}

/// Reads the head of a partial render; `None` if the file ends within it.
pub(super) fn read_head(reader: &mut impl BufRead, path: &Path) -> Result<Option<Head>, PartialError> {
    let foreign = || PartialError::Foreign { path: path.to_owned() };
    match read_title(reader).map_err(failed(path))?.ok_or_else(foreign)? {
        Title::CutOff => return Ok(None),
        Title::Version(VERSION) => {}
        Title::Version(found) => return Err(PartialError::Version { path: path.to_owned(), found }),
    }
    let mut settings = Vec::new();
    let mut limited = reader.by_ref().take(MAX_SETTINGS);
    limited.read_until(b'\n', &mut settings).map_err(failed(path))?;
    if !settings.ends_with(b"\n") && (settings.len() as u64) < MAX_SETTINGS {
        return Ok(None);
    }
    let mut sum = [0; 4];
    match reader.read_exact(&mut sum) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(None),
        read => read.map_err(failed(path))?,
    }
    let bytes = [title().as_bytes(), &settings].concat();
    let checksum = checksum(&bytes);
    let settings = serde_json::from_slice(&settings).ok().filter(|_| checksum.to_le_bytes() == sum);
    let settings = settings.ok_or_else(|| PartialError::Damaged { path: path.to_owned() })?;
    Ok(Some(Head { settings, bytes: (bytes.len() + sum.len()) as u64, checksum }))
}

/// Encodes a head. Returns its bytes, and the checksum of title and settings.
pub(super) fn encode(settings: &Value) -> (Vec<u8>, u32) {
    let mut bytes = format!("{}{settings}\n", title()).into_bytes();
    let sum = checksum(&bytes);
    bytes.extend(sum.to_le_bytes());
    (bytes, sum)
}

/// Checks that a file has no tiles.
///
/// # Errors
/// If it has tiles, is not a partial render of this version, or its settings are damaged.
pub(super) fn check_empty(mut file: &File, path: &Path) -> Result<(), PartialError> {
    file.rewind().map_err(failed(path))?;
    let mut reader = BufReader::new(file);
    let has_tiles =
        read_head(&mut reader, path)?.is_some() && has_record(&mut reader).map_err(failed(path))?;
    if has_tiles { Err(PartialError::Unfinished { path: path.to_owned() }) } else { Ok(()) }
}

/// Creates the error of a file that cannot be read.
fn failed(path: &Path) -> impl Fn(io::Error) -> PartialError {
    move |source| PartialError::File { path: path.to_owned(), source }
}

/// First line of the file.
pub(super) fn title() -> String {
    format!("{FAMILY}{VERSION}\n")
}

/// Describes the settings that differ between a file and the render.
pub(super) fn differences(found: &Map<String, Value>, asked: &Value) -> Vec<String> {
    let empty = Map::new();
    let asked = asked.as_object().unwrap_or(&empty);
    let names = asked.keys().chain(found.keys().filter(|name| !asked.contains_key(*name)));
    let differing = names.filter(|name| found.get(*name) != asked.get(*name));
    let say = |value: Option<&Value>| value.map_or("nothing".to_owned(), Value::to_string);
    differing
        .map(|name| format!("{name} was {} and is {}", say(found.get(name)), say(asked.get(name))))
        .collect()
}
