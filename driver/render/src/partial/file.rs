//! Opens the file of a partial render safely: links are not followed, pipes do not block, and no foreign file
//! is written or removed.

use std::fs::{self, File, Metadata, TryLockError};
use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

use photoncard_picture::output::kind_of;

use super::error::PartialError;

/// Beginning of the first line of a partial render in all versions of the format, followed by the version
/// number.
pub(super) const FAMILY: &str = "photoncard partial render ";
/// Maximum length of the first line, bytes: [`FAMILY`], a version of up to 10 digits, and the line feed.
const MAX_TITLE: u64 = FAMILY.len() as u64 + 11;
/// Maximum number of attempts to open a file while other processes create or remove it.
const MAX_TRIES: usize = 16;

/// First line of a partial render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Title {
    /// The file ends within its first line, so that it contains no tiles.
    CutOff,
    /// Version of the format.
    Version(u32),
}

/// Reads the first line of a file; `None` if the file is not a partial render.
pub(super) fn read_title(reader: &mut impl BufRead) -> io::Result<Option<Title>> {
    let mut line = Vec::new();
    reader.take(MAX_TITLE).read_until(b'\n', &mut line)?;
    if FAMILY.as_bytes().starts_with(&line) {
        return Ok(Some(Title::CutOff));
    }
    let number = line.strip_prefix(FAMILY.as_bytes()).and_then(|number| str::from_utf8(number).ok());
    Ok(number.and_then(|number| match number.strip_suffix('\n') {
        Some(number) => number.parse().ok().map(Title::Version),
        // A longer line is no title, even if truncated.
        None => {
            let is_cut_off =
                (line.len() as u64) < MAX_TITLE && number.bytes().all(|byte| byte.is_ascii_digit());
            is_cut_off.then_some(Title::CutOff)
        }
    }))
}

/// Opens and locks the file of a partial render. A file that does not exist is created if `create` is true;
/// otherwise `None` is returned.
pub(super) fn open(path: &Path, create: bool) -> Result<Option<File>, PartialError> {
    let failed = |source| PartialError::File { path: path.to_owned(), source };
    for _ in 0..MAX_TRIES {
        let file = match fs::symlink_metadata(path) {
            Ok(found) => {
                check_kind(path, &found)?;
                open_there(path)
            }
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            Err(_) if !create => return Ok(None),
            Err(_) => File::options().read(true).write(true).create_new(true).open(path),
        };
        let file = match file {
            // Another process has created or removed the file meanwhile.
            Err(error) if [ErrorKind::AlreadyExists, ErrorKind::NotFound].contains(&error.kind()) => continue,
            file => file.map_err(failed)?,
        };
        check_kind(path, &file.metadata().map_err(failed)?)?;
        check_lock(path, &file.try_lock())?;
        // The previous owner may have removed the file before it was locked.
        if is_at(&file, path).map_err(failed)? {
            let title = read_title(&mut BufReader::new(&file)).map_err(failed)?;
            let foreign = PartialError::Foreign { path: path.to_owned() };
            return title.map(|_| Some(file)).ok_or(foreign);
        }
    }
    Err(PartialError::Busy { path: path.to_owned() })
}

/// Opens an existing file for reading and writing, without following a link and without blocking on a pipe.
#[cfg(unix)]
fn open_there(path: &Path) -> io::Result<File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::RDWR | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    Ok(rustix::fs::open(path, flags, Mode::empty())?.into())
}

#[cfg(not(unix))]
fn open_there(path: &Path) -> io::Result<File> {
    File::options().read(true).write(true).open(path)
}

/// Checks that a file is a regular file with a single hard link. A file with several may belong to somebody
/// else.
fn check_kind(path: &Path, found: &Metadata) -> Result<(), PartialError> {
    let linked = has_other_names(found).then_some("file with other hard links");
    match kind_of(found.file_type()).or(linked) {
        None => Ok(()),
        Some(kind) => Err(PartialError::NotAFile { path: path.to_owned(), kind }),
    }
}

#[cfg(unix)]
fn has_other_names(found: &Metadata) -> bool {
    std::os::unix::fs::MetadataExt::nlink(found) > 1
}

/// Returns false, because not every system reports the number of links.
#[cfg(not(unix))]
fn has_other_names(_: &Metadata) -> bool {
    false
}

/// Checks that no other render has locked the file. The check passes on a system that has no locks or refuses
/// them.
pub(super) fn check_lock(path: &Path, locked: &Result<(), TryLockError>) -> Result<(), PartialError> {
    match locked {
        Err(TryLockError::WouldBlock) => Err(PartialError::Busy { path: path.to_owned() }),
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

/// Removes the file, unless its path now names another file.
pub(super) fn remove(file: &File, path: &Path) -> io::Result<()> {
    if !is_at(file, path)? {
        return Ok(());
    }
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Returns whether `path` still names the opened file.
#[cfg(unix)]
pub(super) fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let file = file.metadata()?;
    match fs::symlink_metadata(path) {
        Ok(named) => Ok((named.dev(), named.ino()) == (file.dev(), file.ino())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Returns true, because on other systems an open file cannot be renamed or removed.
#[cfg(not(unix))]
pub(super) fn is_at(_: &File, _: &Path) -> io::Result<bool> {
    Ok(true)
}
