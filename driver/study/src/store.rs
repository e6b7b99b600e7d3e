//! Finished points of a study, stored so that an interrupted study continues where it stopped.
//!
//! A point is one JSON file with its result and its *key*: everything that the result depends on, including
//! the program's version. A point is found only by an equal key, so that a new version measures all points
//! again.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use photoncard_picture::output::{self, OutputError, kind_of};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use super::report::is_portable;

/// Name of the points' folder within the study's folder.
pub(crate) const POINTS: &str = "points";

/// Error of the store.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The folder cannot be created.
    #[error("cannot create the folder {}; check the permissions of the folder that it is to be in", folder.display())]
    Folder {
        /// Path of the folder.
        folder: PathBuf,
        /// Error of the operating system.
        #[source]
        source: io::Error,
    },
    /// The name is not a portable file name.
    #[error(
        "'{name}' cannot name a point; use up to 100 letters, digits, '-' and '.', the first and the last of them no dot"
    )]
    BadName {
        /// Name of the point.
        name: String,
    },
    /// The result cannot be represented in JSON.
    #[error("the result of the point '{name}' cannot be kept as JSON; its maps must have text for keys")]
    NotJson {
        /// Name of the point.
        name: String,
        /// Error of the serializer.
        #[source]
        source: serde_json::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A folder of finished points.
#[derive(Debug)]
pub(crate) struct PointStore {
    folder: PathBuf,
    notices: Vec<String>,
}

/// Contents of a point's file.
#[derive(Deserialize, Serialize)]
struct StoredPoint {
    key: Value,
    result: Value,
    /// FNV-1a hash of key and result, in hexadecimal.
    checksum: String,
}

impl PointStore {
    /// Opens the store in `folder/points`, which is created if it is missing.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub(crate) fn open(folder: &Path) -> Result<Self, StoreError> {
        let folder = folder.join(POINTS);
        match fs::create_dir_all(&folder) {
            Ok(()) => Ok(Self { folder, notices: Vec::new() }),
            Err(source) => Err(StoreError::Folder { folder, source }),
        }
    }

    /// Returns the result of the point with this name and key, if it is finished.
    ///
    /// A file that cannot be read, is damaged or edited, or has another key counts as missing, and adds a
    /// sentence to the [notices](Self::notices).
    pub(crate) fn get<T: DeserializeOwned>(&mut self, name: &str, key: &Value) -> Option<T> {
        let path = self.path(name, key).ok()?;
        let read = match fs::metadata(&path).map(|found| kind_of(found.file_type())) {
            // Reading a pipe would block.
            Ok(Some(kind)) => Err(format!("is a {kind}")),
            Ok(None) => match fs::read(&path) {
                Err(error) => Err(format!("cannot be read ({error})")),
                Ok(bytes) => result(&bytes, key),
            },
            Err(error) if error.kind() == ErrorKind::NotFound => return None,
            Err(error) => Err(format!("cannot be read ({error})")),
        };
        match read {
            Ok(result) => Some(result),
            Err(why) => {
                self.notices.push(format!("the finished point {} {why}", path.display()));
                None
            }
        }
    }

    /// Stores the result of a point. It replaces an earlier result with the same name and key.
    ///
    /// Finite numbers are read back exactly. JSON has no infinities and no NaN: a result that may contain
    /// them must use an `Option`, or it is not found again.
    ///
    /// # Errors
    /// If the name has other characters than letters, digits, `-` and `.`, the result cannot be represented
    /// in JSON, or the file cannot be written.
    pub(crate) fn put<T: Serialize>(&self, name: &str, key: &Value, result: &T) -> Result<(), StoreError> {
        let path = self.path(name, key)?;
        let not_json = |source| StoreError::NotJson { name: name.to_owned(), source };
        let result = serde_json::to_value(result).map_err(not_json)?;
        let checksum = checksum(key, &result);
        let point = StoredPoint { key: key.clone(), result, checksum };
        let mut bytes = serde_json::to_vec_pretty(&point).map_err(not_json)?;
        bytes.push(b'\n');
        Ok(output::write(&path, &bytes)?)
    }

    /// Sentences about the files that [`Self::get`] could not use.
    pub(crate) fn notices(&self) -> &[String] {
        &self.notices
    }

    fn path(&self, name: &str, key: &Value) -> Result<PathBuf, StoreError> {
        if !is_portable(name) {
            return Err(StoreError::BadName { name: name.to_owned() });
        }
        let hash = fnv1a(key.to_string().bytes());
        Ok(self.folder.join(format!("{name}-{hash:016x}.json")))
    }
}

/// Decodes the result in a point's file. The error describes why the file cannot be used.
fn result<T: DeserializeOwned>(bytes: &[u8], key: &Value) -> Result<T, String> {
    let point: StoredPoint =
        serde_json::from_slice(bytes).map_err(|error| format!("is damaged ({error})"))?;
    if point.key != *key {
        return Err("holds other settings than its name says".to_owned());
    }
    if point.checksum != checksum(&point.key, &point.result) {
        return Err("was changed".to_owned());
    }
    serde_json::from_value(point.result).map_err(|error| format!("holds another kind of result ({error})"))
}

fn checksum(key: &Value, result: &Value) -> String {
    format!("{:016x}", fnv1a(format!("{key}\n{result}").bytes()))
}

/// 64-bit hash of Fowler, Noll and Vo (FNV-1a).
fn fnv1a(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
    struct Outcome {
        seconds: f64,
        requests: u64,
        error: Option<f64>,
    }

    fn outcome() -> Outcome {
        Outcome { seconds: 1.0 / 3.0, requests: u64::MAX, error: None }
    }

    fn key(version: &str) -> Value {
        json!({"version": version, "seed": 7, "order": "sort", "error": 0.1})
    }

    fn only_file(folder: &Path) -> PathBuf {
        let files: Vec<_> =
            fs::read_dir(folder.join(POINTS)).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert_eq!(files.len(), 1);
        files[0].clone()
    }

    #[test]
    fn a_point_survives_reopening() {
        let folder = tempfile::tempdir().unwrap();
        let store = PointStore::open(folder.path()).unwrap();
        store.put("sort-1.5", &key("1"), &outcome()).unwrap();
        let mut store = PointStore::open(folder.path()).unwrap();
        assert_eq!(store.get::<Outcome>("sort-1.5", &key("1")), Some(outcome()));
        let newer = Outcome { requests: 1, ..outcome() };
        store.put("sort-1.5", &key("1"), &newer).unwrap();
        assert_eq!(store.get::<Outcome>("sort-1.5", &key("1")), Some(newer));
        assert!(store.notices().is_empty());
    }

    #[test]
    fn a_point_is_found_only_by_its_name_key_and_version() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = PointStore::open(folder.path()).unwrap();
        store.put("sort", &key("1"), &outcome()).unwrap();
        assert_eq!(store.get::<Outcome>("sort", &key("2")), None);
        assert_eq!(store.get::<Outcome>("hash", &key("1")), None);
        assert!(store.notices().is_empty());
        store.put("sort", &key("2"), &1_u32).unwrap();
        assert_eq!(store.get::<Outcome>("sort", &key("1")), Some(outcome()));
    }

    /// Two keys with the same hash share a file name.
    #[test]
    fn a_file_with_another_key_is_not_trusted() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = PointStore::open(folder.path()).unwrap();
        store.put("sort", &key("1"), &outcome()).unwrap();
        let other = store.path("sort", &key("2")).unwrap();
        fs::rename(only_file(folder.path()), other).unwrap();
        assert_eq!(store.get::<Outcome>("sort", &key("2")), None);
        assert!(store.notices()[0].contains("other settings"), "{:?}", store.notices());
    }

    #[test]
    fn damaged_and_edited_files_are_reported_and_can_be_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = PointStore::open(folder.path()).unwrap();
        store.put("sort", &key("1"), &outcome()).unwrap();
        let file = only_file(folder.path());
        let whole = fs::read_to_string(&file).unwrap();
        let edited = whole.replace("0.333", "0.334");
        assert_ne!(edited, whole);
        let damaged = ["", &whole[..whole.len() / 2], "null", edited.as_str()];
        for (count, contents) in damaged.into_iter().enumerate() {
            fs::write(&file, contents).unwrap();
            assert_eq!(store.get::<Outcome>("sort", &key("1")), None);
            assert_eq!(store.notices().len(), count + 1, "{contents}");
        }
        fs::write(&file, [0xff, 0xfe]).unwrap();
        assert_eq!(store.get::<Outcome>("sort", &key("1")), None);
        store.put("sort", &key("1"), &outcome()).unwrap();
        assert_eq!(store.get::<Outcome>("sort", &key("1")), Some(outcome()));
        assert_eq!(store.get::<String>("sort", &key("1")), None);
        assert!(store.notices().last().unwrap().contains("another kind"));
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_in_place_of_a_point_does_not_block() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = PointStore::open(folder.path()).unwrap();
        let path = store.path("sort", &key("1")).unwrap();
        rustix::fs::mkfifoat(rustix::fs::CWD, path, rustix::fs::Mode::RWXU).unwrap();
        assert_eq!(store.get::<Outcome>("sort", &key("1")), None);
        assert!(store.notices()[0].contains("is a named pipe"), "{:?}", store.notices());
        assert!(store.put("sort", &key("1"), &outcome()).is_err());
    }

    #[test]
    fn names_that_leave_the_folder_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = PointStore::open(folder.path()).unwrap();
        assert!(matches!(store.put("../sort", &key("1"), &1), Err(StoreError::BadName { .. })));
        assert_eq!(store.get::<u32>("../sort", &key("1")), None);
    }

    #[test]
    fn the_hash_is_fnv_1a() {
        assert_eq!(fnv1a(b"".iter().copied()), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a(b"foobar".iter().copied()), 0x8594_4171_f739_67e8);
    }
}
