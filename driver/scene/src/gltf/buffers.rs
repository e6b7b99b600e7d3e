//! Bytes of a scene's buffers, from the BIN chunk, data URIs and files in the scene's folder.

use std::cell::OnceCell;
use std::sync::Arc;

use gltf::json;

use super::compression::{Compressed, DecodedViews, is_placeholder};
use super::document::Document;
use super::files::Bytes;
use super::uri::{INSIDE_FOLDER, decode_data, is_data, locate};
use crate::error::SceneError;

const EXPORT_AGAIN: &str = "export the scene again; the buffer and its description do not fit";

/// Bytes of the buffers that were read and of the buffer views that were decoded. A buffer is read when a
/// view needs it, because an unused one may be missing or belong to an extension.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    /// Bytes of each buffer that was read, at least `byteLength` long. A placeholder of compressed views has
    /// no bytes; `None` stands for the BIN chunk.
    bytes: Vec<OnceCell<Option<Bytes<'static>>>>,
    decoded: DecodedViews,
}

impl<'a> Buffers<'a> {
    /// Creates the buffers of a document without reading any.
    pub(super) fn of(document: &'a Document) -> Self {
        let Document { root, .. } = document;
        let bytes = root.buffers.iter().map(|_| OnceCell::new()).collect();
        Self { document, bytes, decoded: DecodedViews::new(root.buffer_views.len()) }
    }

    /// Bytes of buffer view `index`, decoded if it is compressed; `None` if they exceed its buffer.
    pub(super) fn view(&self, index: usize, view: &json::buffer::View) -> Result<Option<&[u8]>, SceneError> {
        if let Some(compressed) = Compressed::of(self.document, index, view)? {
            let stream = self.part(compressed.buffer(), compressed.place())?;
            return self.decoded.get(self.document, &compressed, stream).map(Some);
        }
        let offset = view.byte_offset.map_or(0, |offset| offset.0);
        self.part(view.buffer.value(), (offset, view.byte_length.0))
    }

    /// Returns `length` bytes of a buffer from `offset` on; `None` if the buffer does not have them.
    fn part(&self, buffer: usize, (offset, length): (u64, u64)) -> Result<Option<&[u8]>, SceneError> {
        let Some(cell) = self.bytes.get(buffer) else { return Ok(None) };
        let bytes = match cell.get() {
            Some(bytes) => bytes,
            None => {
                let bytes = load_one(self.document, buffer)?;
                cell.get_or_init(|| bytes)
            }
        };
        let bytes = bytes.as_deref().or(self.document.blob()).unwrap_or_default();
        let ends = [Some(offset), offset.checked_add(length)].map(|end| usize::try_from(end?).ok());
        Ok(ends[0].zip(ends[1]).and_then(|(start, end)| bytes.get(start..end)))
    }
}

/// Reads a buffer; returns `None` for the BIN chunk.
fn load_one(document: &Document, index: usize) -> Result<Option<Bytes<'static>>, SceneError> {
    let buffer = &document.root.buffers[index];
    let fault = |field: &str, reason: String, remedy| SceneError::Buffer {
        location: document.location(format!("buffers[{index}]{field}")),
        reason,
        remedy,
    };
    if is_placeholder(document, index, buffer) {
        return Ok(Some(Bytes::Part(&[])));
    }
    let bytes = match (&buffer.uri, document.blob()) {
        (Some(uri), _) if is_data(uri) => {
            let (_, bytes) = decode_data(uri).map_err(|reason| fault(".uri", reason, EXPORT_AGAIN))?;
            Some(Bytes::Shared(Arc::new(bytes)))
        }
        (Some(uri), _) => {
            let file = locate(&document.path, uri).map_err(|reason| fault(".uri", reason, INSIDE_FOLDER))?;
            Some(document.files.read(&file).map_err(|source| SceneError::Unreadable { file, source })?)
        }
        (None, Some(_)) if index == 0 => None,
        (None, _) => {
            let reason =
                "it has no uri, and is not the BIN chunk of a GLB, so that its bytes are nowhere".to_owned();
            return Err(fault("", reason, EXPORT_AGAIN));
        }
    };
    let length = bytes.as_deref().or(document.blob()).map_or(0, <[u8]>::len);
    let (stated, available) = (buffer.byte_length.0, length as u64);
    if available < stated {
        let reason = format!("{stated} bytes are stated and {available} are there");
        return Err(fault(".byteLength", reason, EXPORT_AGAIN));
    }
    Ok(bytes)
}
