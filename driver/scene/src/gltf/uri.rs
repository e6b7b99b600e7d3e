//! Resolves URIs: data URIs, and files in the scene's folder. All files besides the scene file are located
//! here.

use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

/// Base64 engine that accepts missing padding, on which writers disagree. Missing bytes are detected by the
/// buffer's stated length.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Remedy for a URI that names no readable file.
pub(super) const INSIDE_FOLDER: &str =
    "put the file beside the scene and refer to it by its name, or export the scene as .glb";

pub(super) fn is_data(uri: &str) -> bool {
    uri.starts_with("data:")
}

/// Media type of a data URI, empty if it has none, and its bytes.
pub(super) fn decode_data(uri: &str) -> Result<(&str, Vec<u8>), String> {
    let (head, data) = uri.split_once(',').ok_or("the data URI has no comma")?;
    let kind = head.strip_prefix("data:").unwrap_or_default().split(';').next().unwrap_or_default();
    let bytes = if head.ends_with(";base64") {
        BASE64.decode(data).map_err(|error| format!("the data URI is not base64: {error}"))?
    } else {
        percent_decode(data)?
    };
    Ok((kind, bytes))
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

/// Path of the file that a URI names. It must lie in the scene's folder, so that a downloaded scene cannot
/// read other files.
pub(super) fn locate(scene: &Path, uri: &str) -> Result<PathBuf, String> {
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
    // A symbolic link may lead out of the folder. A missing file is reported when it is opened.
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
        let uris =
            [("data:image/png;base64,AQI=", "image/png"), ("data:;base64,AQI", ""), ("data:,%01%02", "")];
        for (uri, kind) in uris {
            assert_eq!(decode_data(uri), Ok((kind, vec![1, 2])), "{uri}");
        }
        for uri in ["data:", "data:;base64", "data:;base64,A", "data:;base64,!!!!", "data:,%0"] {
            assert!(decode_data(uri).is_err(), "{uri}");
        }
    }
}
