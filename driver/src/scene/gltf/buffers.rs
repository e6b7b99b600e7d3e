//! The bytes of a scene's buffers: the BIN chunk, data URIs, and files inside the scene's folder.

use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::document::{Document, read_file};
use crate::error::SceneError;

/// Writers disagree on padding, and what is missing is caught by the buffer's stated length.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

const INSIDE_FOLDER: &str =
    "put the file beside the scene and refer to it by its name, or export the scene as .glb";
const EXPORT_AGAIN: &str = "export the scene again; the buffer and its description do not fit";

/// The bytes of every buffer, each at least as long as the file states.
pub(super) fn load(document: &Document) -> Result<Vec<Cow<'_, [u8]>>, SceneError> {
    (0..document.root.buffers.len()).map(|index| load_one(document, index)).collect()
}

fn load_one(document: &Document, index: usize) -> Result<Cow<'_, [u8]>, SceneError> {
    let buffer = &document.root.buffers[index];
    let fault = |field: &str, reason: String, remedy| SceneError::Buffer {
        place: document.place(format!("buffers[{index}]{field}")),
        reason,
        remedy,
    };
    let bytes = match (&buffer.uri, &document.blob) {
        (Some(uri), _) if uri.starts_with("data:") => {
            Cow::Owned(decode_data(uri).map_err(|reason| fault(".uri", reason, EXPORT_AGAIN))?)
        }
        (Some(uri), _) => {
            let file = locate(&document.path, uri).map_err(|reason| fault(".uri", reason, INSIDE_FOLDER))?;
            let bytes = read_file(&file).map_err(|source| SceneError::Unreadable { file, source })?;
            Cow::Owned(bytes)
        }
        (None, Some(blob)) if index == 0 => Cow::Borrowed(blob.as_slice()),
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

fn decode_data(uri: &str) -> Result<Vec<u8>, String> {
    let (kind, data) = uri.split_once(',').ok_or("the data URI has no comma")?;
    if !kind.ends_with(";base64") {
        return percent_decode(data);
    }
    BASE64.decode(data).map_err(|error| format!("the data URI is not base64: {error}"))
}

fn percent_decode(text: &str) -> Result<Vec<u8>, String> {
    let mut bytes = text.bytes();
    let mut decoded = Vec::with_capacity(text.len());
    while let Some(byte) = bytes.next() {
        if byte != b'%' {
            decoded.push(byte);
            continue;
        }
        let mut digit = || bytes.next().and_then(|digit| char::from(digit).to_digit(16));
        let (Some(high), Some(low)) = (digit(), digit()) else {
            return Err("a % of the URI is not followed by two hexadecimal digits".to_owned());
        };
        decoded.push((high * 16 + low) as u8);
    }
    Ok(decoded)
}

/// The file a URI names, if that is inside the scene's folder: a scene from elsewhere reads nothing but its own.
fn locate(scene: &Path, uri: &str) -> Result<PathBuf, String> {
    let refused = |why: &str| format!("the uri {uri:?} {why}");
    let decoded = String::from_utf8(percent_decode(uri)?).map_err(|_| refused("is not UTF-8"))?;
    let scheme = decoded.split(['/', '?', '#']).next().is_some_and(|start| start.contains(':'));
    if scheme {
        return Err(refused("has a scheme, and only files beside the scene are read"));
    }
    if decoded.starts_with('/') || decoded.contains(['\\', '\0']) {
        return Err(refused("is not a relative path"));
    }
    if decoded.split('/').any(|part| part == "..") {
        return Err(refused("leaves the scene's folder"));
    }
    if decoded.is_empty() {
        return Err(refused("is empty"));
    }
    let folder = scene.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let file = folder.join(&decoded);
    // A link may lead elsewhere. A file that is missing is reported when it is opened.
    match (fs::canonicalize(folder), fs::canonicalize(&file)) {
        (Ok(folder), Ok(target)) if !target.starts_with(&folder) => {
            Err(refused("leads out of the scene's folder through a link"))
        }
        _ => Ok(file),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_inside_the_folder_are_located() {
        let scene = Path::new("folder/scene.gltf");
        assert_eq!(locate(scene, "a.bin"), Ok(PathBuf::from("folder/a.bin")));
        assert_eq!(locate(scene, "sub/my%20file.bin"), Ok(PathBuf::from("folder/sub/my file.bin")));
        assert_eq!(locate(Path::new("scene.gltf"), "a.bin"), Ok(PathBuf::from("./a.bin")));
        let bad = [
            "",
            "/etc/passwd",
            "../a.bin",
            "sub/../../a.bin",
            "%2e%2e/a.bin",
            "%2Fetc/passwd",
            "..%2Fa.bin",
            "http://example.org/a.bin",
            "file:///etc/passwd",
            "c:/a.bin",
            "..\\a.bin",
            "a%00.bin",
            "a%f.bin",
            "%ff",
        ];
        for uri in bad {
            assert!(locate(scene, uri).is_err(), "{uri}");
        }
    }

    #[test]
    fn data_uris_are_decoded_with_and_without_padding() {
        for uri in ["data:application/octet-stream;base64,AQI=", "data:;base64,AQI", "data:,%01%02"] {
            assert_eq!(decode_data(uri), Ok(vec![1, 2]), "{uri}");
        }
        for uri in ["data:", "data:;base64", "data:;base64,A", "data:;base64,!!!!", "data:,%0"] {
            assert!(decode_data(uri).is_err(), "{uri}");
        }
    }
}
