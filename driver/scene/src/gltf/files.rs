//! Bytes of buffers and images, and a cache that reads each file in the scene's folder only once.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes of a buffer or an image.
pub(super) enum Bytes<'a> {
    /// A range of the scene file or of a buffer.
    Part(&'a [u8]),
    /// The contents of a file or of a data URI.
    Shared(Arc<Vec<u8>>),
}

impl Deref for Bytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Part(bytes) => bytes,
            Self::Shared(bytes) => bytes,
        }
    }
}

/// Cache of files by their canonical paths.
#[derive(Default)]
pub(super) struct Files(RefCell<BTreeMap<PathBuf, Arc<Vec<u8>>>>);

impl Files {
    /// Returns the contents of a file, which is read at the first call.
    pub(super) fn read(&self, path: &Path) -> io::Result<Bytes<'static>> {
        let canonical = fs::canonicalize(path)?;
        if let Some(bytes) = self.0.borrow().get(&canonical) {
            return Ok(Bytes::Shared(Arc::clone(bytes)));
        }
        let bytes = Arc::new(read_file(&canonical)?);
        self.0.borrow_mut().insert(canonical, Arc::clone(&bytes));
        Ok(Bytes::Shared(bytes))
    }
}

/// Reads a regular file. Pipes and devices are refused, because they might never end.
pub(super) fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file"));
    }
    fs::read(path)
}
