//! Images that textures refer to, decoded in parallel.

use std::sync::Arc;

use rayon::prelude::*;

use super::accessor::Source;
use super::files::Bytes;
use super::room::Room;
use super::uri::{decode_data, is_data, locate};
use crate::error::SceneError;
use crate::scene::raster::{Fault, Kind};
use crate::scene::{Encoding, Image, MAX_TEXELS};

const EXPORT_AGAIN: &str = "export the scene again, with its images";
const CONVERT: &str = "convert the image to PNG, JPEG or WebP";

/// An image whose header is read.
struct Found<'a> {
    kind: Kind,
    size: [u32; 2],
    bytes: Bytes<'a>,
}

/// Maximum size of all image files together, bytes: in every format a texel takes at most eight.
const MAX_FILE_BYTES: u64 = 8 * MAX_TEXELS;

/// Image that a texture refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Origin {
    /// Image of the index.
    Image(usize),
    /// None in a format that is read, for the texture of the index.
    Absent(usize),
}

/// Decodes images; those that cannot be read are descriptions of the fault. All indices exist.
///
/// # Errors
/// If the images exceed a limit, or the memory of process or card.
pub(super) fn load(
    source: &Source<'_>,
    wanted: &[(Origin, Encoding)],
    room: &mut Room,
) -> Result<Vec<Result<Image, String>>, SceneError> {
    let (mut texels, mut bytes) = (0, 0);
    let mut found = Vec::with_capacity(wanted.len());
    for &(origin, _) in wanted {
        let image = match find(source, origin) {
            Ok(image) => image,
            Err(failure) => {
                found.push(Err(failure.description(source, origin)?));
                continue;
            }
        };
        texels += u64::from(image.size[0]) * u64::from(image.size[1]);
        bytes += image.bytes.len() as u64;
        let (count, limit, unit) = if texels > MAX_TEXELS {
            (texels, MAX_TEXELS, "texels")
        } else {
            (bytes, MAX_FILE_BYTES, "bytes")
        };
        if count > limit {
            let reason = format!("the images up to this one have {count} {unit}, more than {limit}");
            return Err(error(source, origin, reason, "scale the images down, or use fewer"));
        }
        room.texels(image.size)?;
        found.push(Ok(image));
    }
    let decode = |image: Found<'_>| (image.size, image.kind.decode(&image.bytes, image.size));
    let decoded: Vec<_> = found.into_par_iter().map(|image| image.map(decode)).collect();
    // The first error in the order of the file is returned, whichever thread failed first.
    let images = decoded.into_iter().zip(wanted).map(|(decoded, &(origin, encoding))| match decoded {
        Ok(([width, height], Ok(texels))) => {
            Ok(Ok(Image { name: name(source, origin), width, height, texels, encoding }))
        }
        Ok((_, Err(fault))) => Failure::Image(fault).description(source, origin).map(Err),
        Err(description) => Ok(Err(description)),
    });
    images.collect()
}

/// Failure to read an image.
enum Failure {
    /// Fault of the image.
    Image(Fault),
    /// Fault of the buffers, which other parts of the scene need.
    Scene(SceneError),
}

impl From<Fault> for Failure {
    fn from(fault: Fault) -> Self {
        Self::Image(fault)
    }
}

impl Failure {
    /// Description of an image that cannot be read; an error for one beyond a limit.
    fn description(self, source: &Source<'_>, origin: Origin) -> Result<String, SceneError> {
        match self {
            Self::Image(Fault { reason, remedy, is_limit: true }) => {
                Err(error(source, origin, reason, remedy))
            }
            Self::Image(Fault { reason, .. }) => Ok(format!("'{}' ({reason})", name(source, origin))),
            Self::Scene(error) => Err(error),
        }
    }
}

fn error(source: &Source<'_>, origin: Origin, reason: String, remedy: &'static str) -> SceneError {
    let item = match origin {
        Origin::Image(index) => format!("images[{index}]"),
        Origin::Absent(texture) => format!("textures[{texture}]"),
    };
    SceneError::Image { location: source.document.location(item), reason, remedy }
}

/// Name of the image, or of its file, or `image N`.
fn name(source: &Source<'_>, origin: Origin) -> String {
    let Origin::Image(index) = origin else { return "none".to_owned() };
    let image = &source.document.root.images[index];
    let file = image.uri.as_ref().filter(|uri| !is_data(uri));
    image.name.as_ref().or(file).cloned().unwrap_or_else(|| format!("image {index}"))
}

fn find<'a>(source: &Source<'a>, origin: Origin) -> Result<Found<'a>, Failure> {
    let Origin::Image(index) = origin else {
        return Err(Fault::unreadable("the texture has no image in a format that is read", CONVERT).into());
    };
    let bytes = bytes(source, index)?;
    // The format follows from the bytes: exporters state wrong media types.
    let kind = Kind::of(&bytes)?;
    let size = kind.size(&bytes)?;
    Ok(Found { kind, size, bytes })
}

/// Bytes of an image.
fn bytes<'a>(source: &Source<'a>, index: usize) -> Result<Bytes<'a>, Failure> {
    let document = source.document;
    let image = &document.root.images[index];
    let unreadable = |reason: String| Failure::Image(Fault::unreadable(reason, EXPORT_AGAIN));
    match (&image.uri, image.buffer_view) {
        (Some(uri), None) if is_data(uri) => {
            let (_, bytes) = decode_data(uri).map_err(unreadable)?;
            Ok(Bytes::Shared(Arc::new(bytes)))
        }
        (Some(uri), None) => {
            let file = locate(&document.path, uri).map_err(unreadable)?;
            let read = document.files.read(&file);
            read.map_err(|error| unreadable(format!("cannot read {}: {error}", file.display())))
        }
        (None, Some(view)) => {
            let bytes = source.bytes(view.value(), &format!("images[{index}].bufferView"));
            bytes.map(Bytes::Part).map_err(Failure::Scene)
        }
        (None, None) => Err(unreadable("it has neither uri nor bufferView".to_owned())),
        (Some(_), Some(_)) => Err(unreadable("it has both uri and bufferView".to_owned())),
    }
}
