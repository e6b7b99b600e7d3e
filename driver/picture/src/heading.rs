//! Headings of files: a line with the file's kind and version, a line of JSON, and the CRC-32C of both lines.

use std::io::{self, BufRead, ErrorKind, Read};

use photoncard_shared::checksum::checksum;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Maximum length of the JSON, bytes. The names of a large scene's objects take some 70 bytes each.
const MAX_HEAD: u64 = 1 << 30;

/// Kind and version of a file.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Name of the kind. It begins the first line in all versions.
    pub name: &'static str,
    /// Version of the format.
    pub version: u32,
}

/// A heading read from a file.
#[derive(Debug)]
pub struct Heading<T> {
    /// Contents of the JSON.
    pub head: T,
    /// Size of the heading, bytes.
    pub bytes: u64,
    /// CRC-32C of both lines.
    pub checksum: u32,
}

/// Reason why a heading cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum HeadingFault {
    /// The file is not of this kind, in any version.
    #[error("the file is of another kind")]
    Foreign,
    /// The file is of this kind, but has another version, which the error contains.
    #[error("the file is of version {0}")]
    Version(u32),
    /// The heading is truncated or damaged. The text describes how.
    #[error("the file is damaged: {0}")]
    Damaged(&'static str),
    /// The file cannot be read.
    #[error("the file cannot be read: {0}")]
    Unreadable(#[from] io::Error),
}

impl Kind {
    /// Encodes the heading of a file with `head` as JSON. Returns the heading, and the CRC-32C of both lines.
    ///
    /// # Errors
    /// If `head` cannot be encoded as JSON.
    pub fn heading(self, head: &impl Serialize) -> serde_json::Result<(Vec<u8>, u32)> {
        let Self { name, version } = self;
        let mut bytes = format!("{name} {version}\n{}\n", serde_json::to_string(head)?).into_bytes();
        let sum = checksum(&bytes);
        bytes.extend(sum.to_le_bytes());
        Ok((bytes, sum))
    }

    /// Reads the heading of a file.
    ///
    /// # Errors
    /// If the file is of another kind or version, damaged, or unreadable.
    pub fn read<T: DeserializeOwned>(self, reader: &mut impl BufRead) -> Result<Heading<T>, HeadingFault> {
        let mut bytes = Vec::new();
        // The kind, a blank, a number of 10 digits and the line feed.
        let title = self.name.len() as u64 + 12;
        reader.by_ref().take(title).read_until(b'\n', &mut bytes)?;
        self.check_title(&bytes)?;
        let title = bytes.len();
        reader.by_ref().take(MAX_HEAD).read_until(b'\n', &mut bytes)?;
        let mut sum = [0; 4];
        reader.read_exact(&mut sum).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => HeadingFault::Damaged("it ends within its head"),
            _ => error.into(),
        })?;
        let checksum = checksum(&bytes);
        if checksum.to_le_bytes() != sum {
            return Err(HeadingFault::Damaged("its head has another checksum"));
        }
        let head = bytes.get(title..).and_then(|text| serde_json::from_slice(text).ok());
        let head = head.ok_or(HeadingFault::Damaged("its head lacks something, or has too much"))?;
        Ok(Heading { head, bytes: (bytes.len() + sum.len()) as u64, checksum })
    }

    fn check_title(self, line: &[u8]) -> Result<(), HeadingFault> {
        let rest = line.strip_prefix(self.name.as_bytes()).and_then(|rest| rest.strip_prefix(b" "));
        let number = rest.and_then(|rest| str::from_utf8(rest.strip_suffix(b"\n")?).ok()?.parse().ok());
        match number {
            Some(version) if version == self.version => Ok(()),
            Some(other) => Err(HeadingFault::Version(other)),
            None => Err(HeadingFault::Foreign),
        }
    }
}
