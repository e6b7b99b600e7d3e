//! Bytes of a scene's buffers, from the BIN chunk, data URIs and files in the scene's folder.

use std::sync::Arc;

use super::document::Document;
use super::files::Bytes;
use super::uri::{INSIDE_FOLDER, decode_data, is_data, locate};
use crate::error::SceneError;

const EXPORT_AGAIN: &str = "export the scene again; the buffer and its description do not fit";

/// Bytes of every buffer, each at least as long as `byteLength`.
pub(super) fn load(document: &Document) -> Result<Vec<Bytes<'_>>, SceneError> {
    (0..document.root.buffers.len()).map(|index| load_one(document, index)).collect()
}

fn load_one(document: &Document, index: usize) -> Result<Bytes<'_>, SceneError> {
    let buffer = &document.root.buffers[index];
    let fault = |field: &str, reason: String, remedy| SceneError::Buffer {
        location: document.location(format!("buffers[{index}]{field}")),
        reason,
        remedy,
    };
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
