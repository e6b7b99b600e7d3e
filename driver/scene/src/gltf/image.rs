//! Images of textures, decoded in parallel.

use std::iter::Peekable;
use std::sync::Arc;

use rayon::prelude::*;

use super::accessor::Source;
use super::files::Bytes;
use super::origin::Origin;
use super::room::Room;
use super::specular_glossiness::{Conversion, Grid};
use super::uri::{decode_data, is_data, locate};
use crate::error::SceneError;
use crate::raster::{Deep, Fault, Kind};
use crate::reduction::reduced;
use crate::{Encoding, Image};

const EXPORT_AGAIN: &str = "export the scene again, with its images";
const CONVERT: &str = "convert the image to PNG, JPEG or WebP";

/// Maximum number of texels of all images before they are scaled down. It bounds the time of decoding.
const MAX_TEXELS: u64 = 1 << 31;
/// Maximum number of texels of several images that are decoded in parallel, before they are scaled down.
const TEXELS_AT_ONCE: u64 = 1 << 28;

/// Image that a texture requests, with its encoding.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    pub(super) origin: Origin,
    /// Encoding of an image of 8 bits per channel.
    pub(super) encoding: Encoding,
    /// Encoding that keeps more than 8 bits of an image of 16 bits per channel; `None` to reduce the image to
    /// 8 bits.
    pub(super) deep: Option<Deep>,
}

/// Image file whose header was read.
struct File<'a> {
    origin: Origin,
    kind: Kind,
    size: [u32; 2],
    bytes: Bytes<'a>,
}

/// Image whose file was found, before it is decoded.
enum Found<'a> {
    File(File<'a>),
    /// Image that is computed from up to two others. Sources that cannot be read are `None`.
    Converted(&'a Conversion, [Option<File<'a>>; 2]),
}

/// Decoded image: its texels, which are `None` if it cannot be read, and the faults of its files.
struct Decoded {
    size: [u32; 2],
    texels: Option<Vec<[u8; 4]>>,
    encoding: Encoding,
    faults: Vec<(Origin, Fault)>,
}

/// Failure to read an image.
enum Failure {
    /// Fault of the image alone. The scene can be loaded without the image.
    Image(Fault),
    /// Fault of a buffer, which other parts of the scene need as well.
    Scene(SceneError),
}

impl From<Fault> for Failure {
    fn from(fault: Fault) -> Self {
        Self::Image(fault)
    }
}

/// Takes the next images that may be decoded at once: one of any size, or several of up to [`TEXELS_AT_ONCE`]
/// texels in all.
fn take_together<'a, 'w>(
    found: &mut Peekable<impl Iterator<Item = (Option<Found<'a>>, &'w Wanted)>>,
) -> Vec<(Option<Found<'a>>, &'w Wanted)> {
    let mut texels = 0;
    let mut fits = |image: &Option<Found<'_>>| {
        let before = texels;
        texels += image.as_ref().map_or(0, Found::texels);
        before == 0 || texels <= TEXELS_AT_ONCE
    };
    std::iter::from_fn(|| found.next_if(|(image, _)| fits(image))).collect()
}

/// Decodes images, whose indices must exist. Images that cannot be read are `None` in the result, and are
/// described in `unreadable`.
///
/// # Errors
/// If the images exceed a limit, or the memory of the process or card.
pub(super) fn load(
    source: &Source<'_>,
    wanted: &[Wanted],
    room: &mut Room,
    unreadable: &mut Vec<String>,
) -> Result<Vec<Option<Image>>, SceneError> {
    let (mut bytes, mut texels, limit) = (0, 0, room.image_file_bytes());
    let mut found = Vec::with_capacity(wanted.len());
    for &Wanted { origin, .. } in wanted {
        let image = find(source, origin, unreadable)?;
        if let Some(image) = &image {
            bytes += image.bytes();
            texels += image.texels();
            let (count, limit, unit) =
                if bytes > limit { (bytes, limit, "bytes") } else { (texels, MAX_TEXELS, "texels") };
            if count > limit {
                let reason = format!("the images up to this one have {count} {unit}, more than {limit}");
                return Err(error(source, origin, reason, "scale the images down, or use fewer"));
            }
            room.texels(image.size())?;
        }
        found.push(image);
    }
    let mut decoded = Vec::with_capacity(found.len());
    let mut found = found.into_iter().zip(wanted).peekable();
    while found.peek().is_some() {
        let together = take_together(&mut found);
        decoded.par_extend(
            together.into_par_iter().map(|(image, wanted)| Some(image?.decode(wanted).reduced(room))),
        );
    }
    // The first error in the order of the file is returned, whichever thread failed first.
    let images = decoded.into_iter().zip(wanted).map(|(decoded, &Wanted { origin, .. })| {
        let Some(Decoded { size: [width, height], texels, encoding, faults }) = decoded else {
            return Ok(None);
        };
        for (origin, fault) in faults {
            unreadable.push(description(source, origin, fault)?);
        }
        Ok(texels.map(|texels| Image { name: name(source, origin), width, height, texels, encoding }))
    });
    images.collect()
}

impl Found<'_> {
    fn size(&self) -> [u32; 2] {
        match self {
            Self::File(file) => file.size,
            Self::Converted(_, files) => {
                Conversion::size(files.each_ref().map(|file| Some(file.as_ref()?.size)))
            }
        }
    }

    fn texels(&self) -> u64 {
        let [width, height] = self.size();
        u64::from(width) * u64::from(height)
    }

    /// Size of the files, bytes.
    fn bytes(&self) -> u64 {
        match self {
            Self::File(file) => file.bytes.len() as u64,
            Self::Converted(_, files) => files.iter().flatten().map(|file| file.bytes.len() as u64).sum(),
        }
    }

    /// Decodes the texels. An image of more than 8 bits per channel has the encoding [`Wanted::deep`].
    fn decode(&self, wanted: &Wanted) -> Decoded {
        let size = self.size();
        let deep = match self {
            Self::File(file) => wanted.deep.filter(|_| file.kind.is_deep(&file.bytes)),
            Self::Converted(..) => None,
        };
        let mut faults = Vec::new();
        let mut decode = |file: &File<'_>| {
            let texels = file.kind.decode(&file.bytes, file.size, deep);
            texels.map_err(|fault| faults.push((file.origin, fault))).ok()
        };
        let texels = match self {
            Self::File(file) => decode(file),
            Self::Converted(conversion, files) => {
                let decoded = files.each_ref().map(|file| {
                    let file = file.as_ref()?;
                    Some((file.size, decode(file)?))
                });
                let grids = decoded.each_ref().map(|grid| {
                    let (size, texels) = grid.as_ref()?;
                    Some(Grid { size: *size, texels })
                });
                Some(conversion.texels(size, grids))
            }
        };
        Decoded { size, texels, encoding: deep.map_or(wanted.encoding, Deep::encoding), faults }
    }
}

impl Decoded {
    /// Scales texels down to the size in which they are stored.
    fn reduced(self, room: &Room) -> Self {
        let size = room.image_size(self.size);
        if size == self.size {
            return self;
        }
        let texels = self.texels.map(|texels| reduced(&texels, self.encoding, self.size, size));
        Self { size, texels, ..self }
    }
}

fn error(source: &Source<'_>, origin: Origin, reason: String, remedy: &'static str) -> SceneError {
    let item = match origin {
        Origin::Image(index) => format!("images[{index}]"),
        Origin::Absent(texture) => format!("textures[{texture}]"),
    };
    SceneError::Image { location: source.document.location(item), reason, remedy }
}

/// Describes an image that cannot be read.
///
/// # Errors
/// If the image exceeds a limit.
fn description(source: &Source<'_>, origin: Origin, fault: Fault) -> Result<String, SceneError> {
    let Fault { reason, remedy, is_limit } = fault;
    if is_limit {
        return Err(error(source, origin, reason, remedy));
    }
    Ok(format!("'{}' ({reason})", name(source, origin)))
}

/// Name of the image, or of its file, or `image N`.
fn name(source: &Source<'_>, origin: Origin) -> String {
    let Origin::Image(index) = origin else { return "none".to_owned() };
    let image = &source.document.root.images[index];
    let file = image.uri.as_ref().filter(|uri| !is_data(uri));
    image.name.as_ref().or(file).cloned().unwrap_or_else(|| format!("image {index}"))
}

fn find<'a>(
    source: &Source<'a>,
    origin: Origin,
    unreadable: &mut Vec<String>,
) -> Result<Option<Found<'a>>, SceneError> {
    let mut file = |origin| match find_file(source, origin) {
        Ok(file) => Ok(Some(file)),
        Err(Failure::Scene(error)) => Err(error),
        Err(Failure::Image(fault)) => {
            unreadable.push(description(source, origin, fault)?);
            Ok(None)
        }
    };
    let conversion = match origin {
        Origin::Image(index) => source.document.conversions.images.get(&index),
        Origin::Absent(_) => None,
    };
    let Some(conversion) = conversion else { return Ok(file(origin)?.map(Found::File)) };
    let [diffuse, specular] = conversion.sources.map(|origin| origin.map_or(Ok(None), &mut file));
    Ok(Some(Found::Converted(conversion, [diffuse?, specular?])))
}

fn find_file<'a>(source: &Source<'a>, origin: Origin) -> Result<File<'a>, Failure> {
    let Origin::Image(index) = origin else {
        return Err(Fault::unreadable("the texture has no image in a format that is read", CONVERT).into());
    };
    let bytes = bytes(source, index)?;
    // The format follows from the bytes: exporters state wrong media types.
    let kind = Kind::of(&bytes)?;
    let size = kind.size(&bytes)?;
    Ok(File { origin, kind, size, bytes })
}
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
