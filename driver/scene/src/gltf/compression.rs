//! Compressed buffer views (`EXT_meshopt_compression`, `KHR_meshopt_compression`), decoded on first use.

use std::cell::{Cell, OnceCell};

use gltf::json;
use serde::Deserialize;

use super::document::Document;
use super::extensions::MESHOPT;
use crate::error::SceneError;
use crate::meshopt::{self, Fault, Filter, Layout, Mode};

/// Maximum total size of a file's decoded buffer views, and of its decoded Draco primitives, bytes. The
/// vertices of a scene with the maximum number of triangles take less.
pub(super) const MAX_DECODED: u64 = 1 << 32;

const REMEDY: &str = "compress the file again, or export it without the extension";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Extension {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: usize,
    count: usize,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

pub(super) struct Compressed {
    index: usize,
    item: String,
    stated_bytes: u64,
    extension: Extension,
}

impl Compressed {
    /// Parses the extension of a buffer view, if it has one.
    pub(super) fn of(
        document: &Document,
        index: usize,
        view: &json::buffer::View,
    ) -> Result<Option<Self>, SceneError> {
        let Some(extensions) = &view.extensions else { return Ok(None) };
        let found = MESHOPT.into_iter().find_map(|name| Some((name, extensions.others.get(name)?)));
        let Some((name, value)) = found else { return Ok(None) };
        let item = format!("bufferViews[{index}].extensions.{name}");
        let extension = Extension::deserialize(value)
            .map_err(|error| document.invalid(&item, error.to_string(), REMEDY))?;
        Ok(Some(Self { index, item, stated_bytes: view.byte_length.0, extension }))
    }

    /// Index of the buffer with the compressed stream.
    pub(super) fn buffer(&self) -> usize {
        self.extension.buffer
    }

    /// Offset and length of the compressed stream in its buffer, bytes.
    pub(super) fn place(&self) -> (u64, u64) {
        (self.extension.byte_offset, self.extension.byte_length)
    }

    fn layout(&self) -> Layout {
        let Extension { count, byte_stride: stride, mode, filter, .. } = self.extension;
        Layout { count, stride, mode, filter }
    }
}

/// Cache of decoded buffer views.
pub(super) struct DecodedViews {
    views: Vec<OnceCell<Vec<u8>>>,
    /// Total size of the decoded views, bytes.
    bytes: Cell<u64>,
}

impl DecodedViews {
    pub(super) fn new(views: usize) -> Self {
        Self { views: vec![OnceCell::new(); views], bytes: Cell::new(0) }
    }

    /// Decoded contents of a compressed buffer view. `stream` is `None` if it exceeds its buffer.
    pub(super) fn get(
        &self,
        document: &Document,
        compressed: &Compressed,
        stream: Option<&[u8]>,
    ) -> Result<&[u8], SceneError> {
        let cell = &self.views[compressed.index];
        if let Some(bytes) = cell.get() {
            return Ok(bytes);
        }
        let invalid = |reason: String| document.invalid(&compressed.item, reason, REMEDY);
        let fault = |fault| match fault {
            Fault::Invalid(reason) => invalid(reason),
            Fault::Memory(error) => {
                SceneError::memory(&document.path, "decompressing its buffer views", error)
            }
        };
        let stream = stream.ok_or_else(|| invalid("it reaches beyond its buffer".to_owned()))?;
        let layout = compressed.layout();
        let bytes = layout.bytes().map_err(fault)?;
        if bytes != compressed.stated_bytes {
            let stated = compressed.stated_bytes;
            return Err(invalid(format!(
                "its elements take {bytes} bytes, and the buffer view has {stated}"
            )));
        }
        let sum = self.bytes.get().saturating_add(bytes);
        if sum > MAX_DECODED {
            let reason = format!("the buffer views up to this one take {sum} bytes, more than {MAX_DECODED}");
            return Err(invalid(reason));
        }
        self.bytes.set(sum);
        let decoded = meshopt::decode(stream, &layout).map_err(fault)?;
        Ok(cell.get_or_init(|| decoded))
    }
}

/// Returns whether a buffer is only a placeholder for compressed views: it is marked as a fallback, or has no
/// bytes in a file that uses the extension.
pub(super) fn is_placeholder(document: &Document, index: usize, buffer: &json::Buffer) -> bool {
    let marked = buffer.extensions.as_ref().is_some_and(|extensions| {
        let mut marks = MESHOPT.into_iter().filter_map(|name| extensions.others.get(name));
        marks.any(|mark| mark.get("fallback") == Some(&true.into()))
    });
    let has_bytes = buffer.uri.is_some() || index == 0 && document.blob().is_some();
    let is_used = document.root.extensions_used.iter().any(|name| MESHOPT.contains(&name.as_str()));
    marked || !has_bytes && is_used
}
