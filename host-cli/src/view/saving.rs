//! Pictures that pages save, under plain names in one folder. A file that this view did not write is never
//! replaced.

use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::arguments::PictureFormat;

/// Maximum length of a name, bytes.
const MAX_NAME: usize = 100;
/// Names of devices on Windows, reserved with any suffix.
const DEVICES: [&str; 6] = ["aux", "con", "nul", "prn", "conin$", "conout$"];

/// Folder of saved pictures.
pub(super) struct Folder {
    path: PathBuf,
    /// Identities of the pictures that this view has saved, by name.
    saved: BTreeMap<String, Identity>,
}

/// Identity of a file with its contents: it changes when the file is replaced or written by another program.
#[derive(PartialEq)]
struct Identity {
    length: u64,
    modified: Option<SystemTime>,
    /// Device and inode number of the file; `None` on systems other than Unix.
    number: Option<[u64; 2]>,
}

impl Identity {
    fn new(found: &Metadata) -> Self {
        Self { length: found.len(), modified: found.modified().ok(), number: number(found) }
    }
}

#[cfg(unix)]
fn number(found: &Metadata) -> Option<[u64; 2]> {
    use std::os::unix::fs::MetadataExt;
    Some([found.dev(), found.ino()])
}

#[cfg(not(unix))]
fn number(_: &Metadata) -> Option<[u64; 2]> {
    None
}

impl Folder {
    /// Opens an existing folder.
    pub(super) fn new(path: &Path) -> std::io::Result<Self> {
        let path = fs::canonicalize(path)?;
        if !path.is_dir() {
            return Err(std::io::Error::new(std::io::ErrorKind::NotADirectory, "it is no folder"));
        }
        Ok(Self { path, saved: BTreeMap::new() })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Saves a picture and returns its path. `write` writes it completely or not at all.
    ///
    /// # Errors
    /// If the name is not plain or has another suffix than `.exr` and `.png`, if a file of this name exists
    /// that this view did not write, or if the picture cannot be written.
    pub(super) fn save(
        &mut self,
        name: &str,
        write: impl FnOnce(&Path, PictureFormat) -> Result<(), String>,
    ) -> Result<PathBuf, String> {
        let format = format_of(name)?;
        let path = self.path.join(name);
        if let Ok(found) = fs::symlink_metadata(&path)
            && !(found.is_file() && self.saved.get(name) == Some(&Identity::new(&found)))
        {
            return Err(format!("{name} is there already, and not of this view: choose another name"));
        }
        write(&path, format)?;
        let written = fs::symlink_metadata(&path).map_err(|error| format!("{name} is gone: {error}"))?;
        self.saved.insert(name.to_owned(), Identity::new(&written));
        Ok(path)
    }
}

/// Name of a picture that is not settled: `a-unsettled.exr` for `a.exr`.
pub(super) fn unsettled_name(name: &str) -> String {
    match name.rsplit_once('.') {
        Some((stem, suffix)) => format!("{stem}-unsettled.{suffix}"),
        None => format!("{name}-unsettled"),
    }
}

/// Returns the format that the suffix of a picture's name states. The name must be plain: ASCII letters,
/// digits, spaces and `_-.` alone, with a letter, a digit or `_` at the beginning, and no name of a device on
/// Windows.
pub(super) fn format_of(name: &str) -> Result<PictureFormat, String> {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"_-. ".contains(&byte);
    let begins_plainly =
        name.bytes().next().is_some_and(|first| first.is_ascii_alphanumeric() || first == b'_');
    if !begins_plainly || name.len() > MAX_NAME || !name.bytes().all(is_plain) {
        return Err(format!(
            "a name has letters, digits, spaces and _-. alone, begins with a letter or a digit, and is at most {MAX_NAME} bytes long"
        ));
    }
    let lower = name.to_ascii_lowercase();
    let stem = lower.split('.').next().unwrap_or_default().trim_end();
    let is_port = (stem.len() == 4) && ["com", "lpt"].iter().any(|port| stem.starts_with(port));
    if is_port || DEVICES.contains(&stem) {
        return Err(format!("{stem} is a name of a device: choose another name"));
    }
    match lower.rsplit_once('.') {
        Some((_, "exr")) => Ok(PictureFormat::Exr),
        Some((_, "png")) => Ok(PictureFormat::Png),
        _ => Err("a picture ends in .exr, linear radiance, or .png, tone-mapped".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(path: &Path, _: PictureFormat) -> Result<(), String> {
        fs::write(path, b"picture").map_err(|error| error.to_string())
    }

    #[test]
    fn plain_names_are_saved_repeatedly_in_the_folder() {
        let room = tempfile::tempdir().unwrap();
        let mut folder = Folder::new(room.path()).unwrap();
        for name in ["picture.exr", "A view 2.PNG", "picture.exr"] {
            assert_eq!(folder.save(name, write), Ok(folder.path().join(name)));
        }
    }

    #[test]
    fn a_picture_that_is_not_settled_says_so_in_its_name() {
        assert_eq!(unsettled_name("a.b.png"), "a.b-unsettled.png");
        assert!(format_of(&unsettled_name("png")).is_err());
    }

    #[test]
    fn names_that_are_not_plain_are_refused() {
        let room = tempfile::tempdir().unwrap();
        let mut folder = Folder::new(room.path()).unwrap();
        let long = format!("{}.exr", "a".repeat(100));
        for name in [
            "",
            ".exr",
            "../a.exr",
            "/tmp/a.exr",
            "a/b.exr",
            "a\\b.exr",
            "C:a.exr",
            "a.exr\0",
            "a\n.exr",
            "-o.exr",
            "a",
            "a.jpg",
            "a.exr/",
            "con.png",
            "LPT1.exr",
            "ä.exr",
            " a.exr",
            &long,
        ] {
            assert!(folder.save(name, |_, _| panic!("{name} is written")).is_err(), "{name}");
        }
        assert_eq!(fs::read_dir(room.path()).unwrap().count(), 0);
    }

    #[test]
    fn files_of_other_programs_are_not_replaced() {
        let room = tempfile::tempdir().unwrap();
        let mut folder = Folder::new(room.path()).unwrap();
        fs::write(room.path().join("own.exr"), b"mine").unwrap();
        fs::create_dir(room.path().join("folder.exr")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(room.path().join("elsewhere"), room.path().join("link.exr")).unwrap();
        for name in ["own.exr", "folder.exr", "link.exr"] {
            let is_there = fs::symlink_metadata(room.path().join(name)).is_ok();
            assert_eq!(folder.save(name, write).is_err(), is_there, "{name}");
        }
        assert_eq!(fs::read(room.path().join("own.exr")).unwrap(), b"mine");
        assert!(!room.path().join("elsewhere").exists());
    }

    /// On case-insensitive file systems both names denote one file.
    #[test]
    fn a_file_whose_name_differs_in_case_stays() {
        let room = tempfile::tempdir().unwrap();
        let mut folder = Folder::new(room.path()).unwrap();
        fs::write(room.path().join("A.EXR"), b"mine").unwrap();
        let _ = folder.save("a.exr", write);
        assert!(folder.save("A.EXR", write).is_err());
        assert_eq!(fs::read(room.path().join("A.EXR")).unwrap(), b"mine");
    }

    #[test]
    fn a_file_in_place_of_a_saved_picture_stays() {
        let room = tempfile::tempdir().unwrap();
        let mut folder = Folder::new(room.path()).unwrap();
        let path = room.path().join("a.exr");
        for content in [b"a longer one".as_slice(), b"other"] {
            folder.save("a.exr", write).unwrap();
            fs::remove_file(&path).unwrap();
            fs::write(&path, content).unwrap();
            assert!(folder.save("a.exr", write).is_err());
            assert_eq!(fs::read(&path).unwrap(), content);
            fs::remove_file(&path).unwrap();
        }
    }

    #[test]
    fn a_saved_picture_that_became_a_link_is_not_followed() {
        let room = tempfile::tempdir().unwrap();
        let mut folder = Folder::new(room.path()).unwrap();
        folder.save("a.exr", write).unwrap();
        fs::remove_file(room.path().join("a.exr")).unwrap();
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(room.path().join("other"), room.path().join("a.exr")).unwrap();
            assert!(folder.save("a.exr", write).is_err());
        }
    }
}
