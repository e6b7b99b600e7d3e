//! Bytes of a scene's buffers, from the BIN chunk, data URIs and files in the scene's folder.

use std::sync::Arc;

use gltf::json;

use super::compression::{Compressed, DecodedViews, is_placeholder};
use super::document::Document;
use super::files::Bytes;
use super::uri::{INSIDE_FOLDER, decode_data, is_data, locate};
use crate::error::SceneError;

const EXPORT_AGAIN: &str = "export the scene again; the buffer and its description do not fit";

/// Bytes of every buffer, and of the compressed buffer views decoded so far.
pub(super) struct Buffers<'a> {
    /// Bytes of each buffer, at least `byteLength` long. Placeholders of compressed views are empty.
    bytes: Vec<Bytes<'a>>,
    decoded: DecodedViews,
}

impl<'a> Buffers<'a> {
    /// Reads the buffers of a document.
    pub(super) fn load(document: &'a Document) -> Result<Self, SceneError> {
        let Document { root, .. } = document;
        let bytes =
            (0..root.buffers.len()).map(|index| load_one(document, index)).collect::<Result<_, _>>()?;
        Ok(Self { bytes, decoded: DecodedViews::new(root.buffer_views.len()) })
    }

    /// Bytes of the buffer view `index`; `None` if they exceed its buffer.
    pub(super) fn view(
        &self,
        document: &Document,
        index: usize,
        view: &json::buffer::View,
    ) -> Result<Option<&[u8]>, SceneError> {
        if let Some(compressed) = Compressed::of(document, index, view)? {
            let stream = self.part(compressed.buffer(), compressed.place());
            return self.decoded.get(document, &compressed, stream).map(Some);
        }
        let offset = view.byte_offset.map_or(0, |offset| offset.0);
        Ok(self.part(view.buffer.value(), (offset, view.byte_length.0)))
    }

    /// Bytes of a buffer at an offset; `None` if they exceed the buffer.
    fn part(&self, buffer: usize, (offset, length): (u64, u64)) -> Option<&[u8]> {
        let start = usize::try_from(offset).ok()?;
        let end = usize::try_from(offset.checked_add(length)?).ok()?;
        self.bytes.get(buffer)?.get(start..end)
    }
}

fn load_one(document: &Document, index: usize) -> Result<Bytes<'_>, SceneError> {
    let buffer = &document.root.buffers[index];
    let fault = |field: &str, reason: String, remedy| SceneError::Buffer {
        location: document.location(format!("buffers[{index}]{field}")),
        reason,
        remedy,
    };
    if is_placeholder(document, index, buffer) {
        return Ok(Bytes::Part(&[]));
    }
    let bytes = match (&buffer.uri, document.blob()) {
        (Some(uri), _) if is_data(uri) => {
            let (_, bytes) = decode_data(uri).map_err(|reason| fault(".uri", reason, EXPORT_AGAIN))?;
            Bytes::Shared(Arc::new(bytes))
        }
        (Some(uri), _) => {
            let file = locate(&document.path, uri).map_err(|reason| fault(".uri", reason, INSIDE_FOLDER))?;
            document.files.read(&file).map_err(|source| SceneError::Unreadable { file, source })?
        }
        (None, Some(blob)) if index == 0 => Bytes::Part(blob),
        (None, _) => {
            let reason = "it has no uri, and only the first buffer of a GLB may do without".to_owned();
            return Err(fault("", reason, EXPORT_AGAIN));
        }
    };
    let (stated, available) = (buffer.byte_length.0, bytes.len() as u64);
    if available < stated {
        let reason = format!("{stated} bytes are stated and {available} are there");
        return Err(fault(".byteLength", reason, EXPORT_AGAIN));
    }
    Ok(bytes)
}
