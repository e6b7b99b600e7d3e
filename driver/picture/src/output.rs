//! Output files that appear whole or not at all. They are written to a temporary file in their folder, which
//! is then renamed.

use std::fs::{self, FileType};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};
use thiserror::Error;

/// Error that prevents an output file from being written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The path has no file name.
    #[error("'{}' names no file; add a file name", path.display())]
    NoFileName {
        /// Path of the output.
        path: PathBuf,
    },
    /// The folder does not exist, or is not a folder.
    #[error("cannot write {}: the folder {} does not exist; create it or choose another", path.display(), folder.display())]
    MissingFolder {
        /// Path of the output file.
        path: PathBuf,
        /// Path of the folder.
        folder: PathBuf,
    },
    /// The path names something other than a regular file.
    #[error("cannot write {}: a {kind} has that name; choose another", path.display())]
    NotAFile {
        /// Path of the output file.
        path: PathBuf,
        /// Kind of the existing object.
        kind: &'static str,
    },
    /// Writing the file failed.
    #[error("cannot write {}; check the folder's permissions and the free space", path.display())]
    Write {
        /// Path of the output file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: io::Error,
    },
}

/// Checks, before long work starts, that `path` can be written when the work is done.
///
/// # Errors
/// If the folder is missing or cannot be written to, or `path` names something other than a regular file.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    PendingFile::create(path).map(drop)
}

/// Writes `bytes` to `path`, replacing an existing file. On failure an existing file is unchanged.
///
/// # Errors
/// As [`check_writable`], and if the disk is full or fails.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut file = PendingFile::create(path)?;
    file.write_all(bytes).map_err(|source| OutputError::Write { path: path.to_owned(), source })?;
    file.commit()
}

/// Temporary file that [`Self::commit`] renames to the output's path. It is removed if the value is dropped
/// without a commit.
#[derive(Debug)]
pub struct PendingFile {
    file: NamedTempFile,
    target: PathBuf,
    path: PathBuf,
}

impl PendingFile {
    /// Creates a temporary file for the output `path`.
    ///
    /// # Errors
    /// As [`check_writable`].
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let target = resolve(path)?;
        let file = create_beside(&target, path)?;
        Ok(Self { file, target, path: path.to_owned() })
    }

    /// Renames the temporary file to the output's path, replacing an existing file.
    ///
    /// # Errors
    /// If the disk is full or fails.
    pub fn commit(self) -> Result<(), OutputError> {
        let Self { file, target, path } = self;
        let failed = |source| OutputError::Write { path: path.clone(), source };
        file.as_file().sync_all().map_err(failed)?;
        file.persist(&target).map_err(|error| failed(error.error))?;
        // The rename itself survives a power cut only once the folder is on disk too. Not every file system
        // can sync a folder, and the file is complete either way.
        if let Ok(folder) = fs::File::open(folder_of(&target)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

impl Write for PendingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Returns whether two paths name one file, or would name one after it is written. Names of files that do not
/// exist yet are compared exactly, even if the file system treats some of them as equal, such as names that
/// differ only in case.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    let absolute = |path: &Path| {
        let folder = || Some(fs::canonicalize(folder_of(path)).ok()?.join(path.file_name()?));
        fs::canonicalize(path).ok().or_else(folder)
    };
    match (absolute(a), absolute(b)) {
        (Some(a), Some(b)) => a == b,
        _ => a == b,
    }
}

/// Path of the file that is replaced: `path` with symbolic links resolved.
fn resolve(path: &Path) -> Result<PathBuf, OutputError> {
    if path.file_name().is_none() {
        return Err(OutputError::NoFileName { path: path.to_owned() });
    }
    let refused = |kind| OutputError::NotAFile { path: path.to_owned(), kind };
    match fs::metadata(path) {
        // Renaming over a pipe or a device would replace it.
        Ok(found) => match kind_of(found.file_type()) {
            Some(kind) => Err(refused(kind)),
            None => {
                fs::canonicalize(path).map_err(|source| OutputError::Write { path: path.to_owned(), source })
            }
        },
        Err(_) if path.is_symlink() => Err(refused("broken symbolic link")),
        Err(_) => Ok(path.to_owned()),
    }
}

/// Name of the kind of a file system object; `None` for a regular file.
pub fn kind_of(found: FileType) -> Option<&'static str> {
    if found.is_file() {
        return None;
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if found.is_fifo() {
            return Some("named pipe");
        } else if found.is_socket() {
            return Some("socket");
        }
    }
    Some(if found.is_dir() {
        "folder"
    } else if found.is_symlink() {
        "symbolic link"
    } else {
        "device"
    })
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn create_beside(target: &Path, path: &Path) -> Result<NamedTempFile, OutputError> {
    let folder = folder_of(target);
    if !folder.is_dir() {
        return Err(OutputError::MissingFolder { path: path.to_owned(), folder: folder.to_owned() });
    }
    let mut builder = Builder::new();
    builder.prefix(".photoncard-").suffix(".part");
    // A temporary file is private by default; this one gets the permissions of an ordinary file under the
    // umask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|source| OutputError::Write { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_written_file_is_complete_and_leaves_no_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.exr");
        check_writable(&path).unwrap();
        assert!(names(folder.path()).is_empty());
        write(&path, b"first").unwrap();
        write(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(names(folder.path()), ["picture.exr"]);
    }

    #[test]
    fn a_pending_file_appears_only_when_it_is_committed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace");
        let mut given_up = PendingFile::create(&path).unwrap();
        given_up.write_all(b"half").unwrap();
        assert!(!path.exists());
        drop(given_up);
        assert!(names(folder.path()).is_empty());
        let mut file = PendingFile::create(&path).unwrap();
        file.write_all(b"one, ").unwrap();
        file.write_all(b"two").unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one, two");
        assert_eq!(names(folder.path()), ["trace"]);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("absent/picture.exr");
        for result in [check_writable(&path), write(&path, b"x")] {
            let error = result.unwrap_err();
            assert!(matches!(error, OutputError::MissingFolder { .. }), "{error}");
            assert!(error.to_string().contains("absent"), "{error}");
        }
        fs::write(folder.path().join("file"), b"").unwrap();
        let below_a_file = check_writable(&folder.path().join("file/picture.exr"));
        assert!(matches!(below_a_file, Err(OutputError::MissingFolder { .. })), "{below_a_file:?}");
    }

    #[test]
    fn folders_and_nameless_paths_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        for result in [check_writable(folder.path()), write(folder.path(), b"x")] {
            assert!(matches!(result, Err(OutputError::NotAFile { .. })), "{result:?}");
        }
        for path in ["", "/", ".."] {
            let result = check_writable(Path::new(path));
            assert!(matches!(result, Err(OutputError::NoFileName { .. })), "{path}: {result:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn is_same_file_recognises_a_file_by_any_of_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        assert!(is_same_file(&at("absent"), &at("./absent")));
        assert!(!is_same_file(&at("absent"), &at("other")));
        fs::write(at("file"), b"").unwrap();
        std::os::unix::fs::symlink(at("file"), at("link")).unwrap();
        assert!(is_same_file(&at("file"), &at("link")));
        assert!(!is_same_file(&at("file"), &at("absent/file")));
    }

    #[cfg(unix)]
    #[test]
    fn writing_keeps_links_and_devices() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        let device = write(Path::new("/dev/null"), b"x");
        assert!(matches!(device, Err(OutputError::NotAFile { kind: "device", .. })), "{device:?}");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_sockets_and_broken_links_are_refused_and_kept() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        rustix::fs::mkfifoat(rustix::fs::CWD, at("pipe"), rustix::fs::Mode::RWXU).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
        symlink(at("absent"), at("broken")).unwrap();
        symlink(at("loop"), at("loop")).unwrap();
        symlink(at("pipe"), at("link")).unwrap();
        let before = names(folder.path());
        for (name, word) in [
            ("pipe", "named pipe"),
            ("link", "named pipe"),
            ("socket", "socket"),
            ("broken", "broken symbolic link"),
            ("loop", "broken symbolic link"),
        ] {
            for result in [check_writable(&at(name)), write(&at(name), b"x")] {
                assert!(
                    matches!(result, Err(OutputError::NotAFile { kind, .. }) if kind == word),
                    "{result:?}"
                );
            }
        }
        assert_eq!(names(folder.path()), before);
        assert!(fs::symlink_metadata(at("pipe")).unwrap().file_type().is_fifo());
        assert!(at("broken").is_symlink() && at("loop").is_symlink());
    }
}
