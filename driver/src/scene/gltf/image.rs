//! Images that textures refer to, decoded in parallel.

use std::sync::Arc;

use rayon::prelude::*;

use super::accessor::Source;
use super::files::Bytes;
use super::room::Room;
use super::uri::{INSIDE_FOLDER, decode_data, is_data, locate};
use crate::error::SceneError;
use crate::scene::raster::{Fault, Kind};
use crate::scene::{Encoding, Image, MAX_TEXELS};

const EXPORT_AGAIN: &str = "export the scene again, with its images";

/// An image whose header is read.
struct Found<'a> {
    kind: Kind,
    size: [u32; 2],
    bytes: Bytes<'a>,
}

/// Maximum size of all image files together, bytes: in both formats a texel takes at most eight.
const MAX_FILE_BYTES: u64 = 8 * MAX_TEXELS;

/// Decodes images by index and encoding. All indices exist.
pub(super) fn load(
    source: &Source<'_>,
    wanted: &[(usize, Encoding)],
    room: &mut Room,
) -> Result<Vec<Image>, SceneError> {
    let (mut texels, mut bytes) = (0, 0);
    let mut found = Vec::with_capacity(wanted.len());
    for &(index, _) in wanted {
        let image = find(source, index)?;
        texels += u64::from(image.size[0]) * u64::from(image.size[1]);
        bytes += image.bytes.len() as u64;
        let (count, limit, unit) = if texels > MAX_TEXELS {
            (texels, MAX_TEXELS, "texels")
        } else {
            (bytes, MAX_FILE_BYTES, "bytes")
        };
        if count > limit {
            let reason = format!("the images up to this one have {count} {unit}, more than {limit}");
            return Err(fault(source, index, "", reason, "scale the images down, or use fewer"));
        }
        room.texels(image.size)?;
        found.push(image);
    }
    let decoded: Vec<_> = found
        .into_par_iter()
        .map(|image| (image.size, image.kind.decode(&image.bytes, image.size)))
        .collect();
    // The first error in the order of the file is returned, whichever thread failed first.
    let images = decoded.into_iter().zip(wanted).map(|(([width, height], texels), &(index, encoding))| {
        let texels = texels.map_err(|Fault { reason, remedy }| fault(source, index, "", reason, remedy))?;
        Ok(Image { name: name(source, index), width, height, texels, encoding })
    });
    images.collect()
}

fn fault(
    source: &Source<'_>,
    index: usize,
    field: &str,
    reason: impl Into<String>,
    remedy: &'static str,
) -> SceneError {
    let location = source.document.location(format!("images[{index}]{field}"));
    SceneError::Image { location, reason: reason.into(), remedy }
}

/// Name of the image, or of its file, or `image N`.
fn name(source: &Source<'_>, index: usize) -> String {
    let image = &source.document.root.images[index];
    let file = image.uri.as_ref().filter(|uri| !is_data(uri));
    image.name.as_ref().or(file).cloned().unwrap_or_else(|| format!("image {index}"))
}

fn find<'a>(source: &Source<'a>, index: usize) -> Result<Found<'a>, SceneError> {
    let (stated, bytes) = bytes(source, index)?;
    let fault = |Fault { reason, remedy }| fault(source, index, "", reason, remedy);
    let kind = Kind::of(&bytes).map_err(fault)?;
    if let Some((field, stated)) = stated.filter(|(_, stated)| *stated != kind.media_type()) {
        let reason = format!("the image is stated to be {stated}, and is {}", kind.media_type());
        let remedy = "state the image's own type, or export the scene again";
        return Err(self::fault(source, index, field, reason, remedy));
    }
    let size = kind.size(&bytes).map_err(fault)?;
    Ok(Found { kind, size, bytes })
}

/// JSON path and value of a stated media type.
type Stated<'a> = Option<(&'static str, &'a str)>;

/// Stated media type of an image, and its bytes.
fn bytes<'a>(source: &Source<'a>, index: usize) -> Result<(Stated<'a>, Bytes<'a>), SceneError> {
    let document = source.document;
    let image = &document.root.images[index];
    let stated = image.mime_type.as_ref().map(|kind| (".mimeType", kind.0.as_str()));
    let fault = |field, reason, remedy| fault(source, index, field, reason, remedy);
    match (&image.uri, image.buffer_view) {
        (Some(uri), None) if is_data(uri) => {
            let (kind, bytes) = decode_data(uri).map_err(|reason| fault(".uri", reason, EXPORT_AGAIN))?;
            let in_uri = Some((".uri", kind)).filter(|_| kind.starts_with("image/"));
            Ok((stated.or(in_uri), Bytes::Shared(Arc::new(bytes))))
        }
        (Some(uri), None) => {
            let file = locate(&document.path, uri).map_err(|reason| fault(".uri", reason, INSIDE_FOLDER))?;
            let bytes = document.files.read(&file).map_err(|error| {
                let reason = format!("cannot read {}: {error}", file.display());
                fault(
                    ".uri",
                    reason,
                    "put the image where the scene looks for it, or export the scene as .glb",
                )
            })?;
            Ok((stated, bytes))
        }
        (None, Some(view)) => {
            let bytes = source.bytes(view.value(), &format!("images[{index}].bufferView"))?;
            Ok((stated, Bytes::Part(bytes)))
        }
        (None, None) => Err(fault("", "it has neither uri nor bufferView".to_owned(), EXPORT_AGAIN)),
        (Some(_), Some(_)) => Err(fault("", "it has both uri and bufferView".to_owned(), EXPORT_AGAIN)),
    }
}
