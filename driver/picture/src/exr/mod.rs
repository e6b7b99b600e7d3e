//! `OpenEXR` files: writes films, and reads radiance for comparisons.
//!
//! A file has one part. Radiance is in the unnamed layer, in the channels `R G B`, which every viewer shows.
//! Layers are in channels such as `albedo.R albedo.G albedo.B`, `N.X N.Y N.Z` and `Z` ([`crate::layer`]). The
//! light of a light group is in a layer such as `light_key` ([`mix`]). The data window is the film's crop
//! window, the display window the full picture. A transparent picture has the channel `A` beside them:
//! radiance is premultiplied. The picture's provenance is JSON in the attribute `photoncard`; mattes have
//! attributes of their own ([`crate::cryptomatte`]). The `exr` crate keeps these attributes in a hash map;
//! `attributes` sorts them. The standard attribute `comments` contains the file's checksum, by which
//! [`is_intact`] recognises a truncated or damaged file.

mod attributes;
mod dwa;
pub mod mix;

use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use exr::image::read::specific_channels::ReadSpecificChannel as _;
use exr::meta::BlockDescription;
use exr::meta::header::Header;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Compression, Encoding, FlatSamples, Image, ImageAttributes,
    IntegerBounds, Layer, LayerAttributes, LineOrder, MetaData, ReadChannels, ReadLayers, SampleType,
    SmallVec, SpecificChannels, Text, Vec2, WritableImage, f16, read as reader,
};
use thiserror::Error;

use crate::allocation::{self, OutOfMemory};
use crate::choice::choices;
use crate::cryptomatte::{self, Identities, Matte};
use crate::film::Film;
use crate::foreign;
use crate::intact::{self, BLANK};
use crate::layer::{COLOUR_ALPHA, Channel, Layers};
use crate::output::{self, OutputError};

/// Name of the attribute that holds the picture's provenance.
pub const PROVENANCE: &str = "photoncard";

/// Maximum number of pixels of a picture that is read.
pub const MAX_READ_PIXELS: u64 = 1 << 28;

/// Pixel type of the stored samples. The layers `Z`, `gathers` and `position` and the mattes are always
/// [`SampleFormat::Float`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleFormat {
    /// `HALF`, 16 bits: three decimal digits, up to 65504. Larger finite values are stored as 65504.
    #[default]
    Half,
    /// `FLOAT`, 32 bits: exactly as rendered.
    Float,
}

choices!(SampleFormat { Half = "half", Float = "float" });

/// Linear RGB radiance of a file's data window, premultiplied if there is alpha.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbImage {
    /// Columns of the data window.
    pub width: usize,
    /// Rows of the data window.
    pub height: usize,
    /// First column and row of the data window in the full picture.
    pub data_window_origin: [i32; 2],
    /// The pixels, row by row from the top.
    pub pixels: Vec<[f32; 3]>,
    /// Alpha of the pixels, the channel `A`; `None` if the file has no such channel beside the radiance.
    pub alpha: Option<Vec<f32>>,
    /// JSON of the attribute [`PROVENANCE`]; `None` if the file has no such attribute, or it is not JSON.
    pub provenance: Option<String>,
}

impl RgbImage {
    /// Columns and rows of the data window, each at most [`MAX_READ_PIXELS`].
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height].map(|side| side as u32)
    }
}

/// Error of [`write()`] and [`read()`].
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExrError {
    /// The file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The encoder refused the picture.
    #[error("cannot encode {} as OpenEXR: {reason}", path.display())]
    Encode {
        /// Path of the output file.
        path: PathBuf,
        /// The encoder's error.
        reason: String,
    },
    /// The file cannot be read.
    #[error("cannot read {}; check that the path names a file and that it may be read", path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        #[source]
        source: io::Error,
    },
    /// The file is not an `OpenEXR` picture, or it is damaged.
    #[error("{} is not a readable OpenEXR picture: {reason}; render or copy it again", path.display())]
    Malformed {
        /// Path of the file.
        path: PathBuf,
        /// Error of the decoder, or a contradiction in the file.
        reason: String,
    },
    /// The picture has no channels `R G B` in the unnamed layer.
    #[error("{} has no channels R, G and B, only {channels}; write the picture as plain RGB", path.display())]
    NoColour {
        /// Path of the file.
        path: PathBuf,
        /// Names of the file's channels.
        channels: String,
    },
    /// The file has a compression that cannot be read safely.
    #[error("{} has {compression}, which is not read; store the picture with ZIP compression", path.display())]
    Compression {
        /// Path of the file.
        path: PathBuf,
        /// Name of the compression.
        compression: String,
    },
    /// The process cannot allocate the memory for reading.
    #[error("reading {} takes {bytes} bytes of memory, which the system does not give; {}", path.display(), allocation::REMEDY)]
    Memory {
        /// Path of the file.
        path: PathBuf,
        /// Size of the memory, bytes.
        bytes: u64,
    },
    /// The picture is too large to be read at once.
    #[error("{} has {width} x {height} pixels, more than {MAX_READ_PIXELS}; take crops of it", path.display())]
    TooLarge {
        /// Path of the file.
        path: PathBuf,
        /// Width of the data window, pixels.
        width: usize,
        /// Height of the data window, pixels.
        height: usize,
    },
}

/// Contents of an EXR file.
#[derive(Clone, Copy)]
pub struct Content<'a> {
    /// Film with the radiance and the layers.
    pub film: &'a Film,
    /// Layers besides radiance.
    pub layers: &'a Layers,
    /// Denoised radiance of the film's pixels, W/(sr m^2), row by row: the layer `denoised`.
    pub denoised: Option<&'a [[f32; 3]]>,
    /// True if the file has alpha in the unnamed layer, for a picture in which eye rays see no environment.
    pub is_transparent: bool,
    /// Names for the mattes; `None` leaves mattes out.
    pub identities: Option<&'a Identities>,
    /// Illuminance of the film's pixels, lx, row by row: the layer `illuminance`, in single precision.
    pub illuminance: Option<&'a [f32]>,
}

impl<'a> Content<'a> {
    /// Contents of a picture with a background, without a denoised layer or mattes.
    pub fn new(film: &'a Film, layers: &'a Layers) -> Self {
        Self { film, layers, denoised: None, is_transparent: false, identities: None, illuminance: None }
    }
}

/// Start of the names of the layers with a light group's light.
pub const GROUP_PREFIX: &str = "light_";
/// Channels of a colour.
const COLOUR: [&str; 3] = ["R", "G", "B"];
/// Channels of radiance.
const RENDERED: [&str; 3] = COLOUR;
/// Channels of the layer [`Content::denoised`].
const DENOISED: [&str; 3] = ["denoised.R", "denoised.G", "denoised.B"];

/// Channel of the layer [`Content::illuminance`].
const ILLUMINANCE: &str = "illuminance.Y";

/// Writes a picture to `path` in the format of [`bytes`], whole or not at all.
///
/// # Errors
/// If the file cannot be written, or the provenance is empty.
pub fn write(
    path: &Path,
    content: &Content,
    provenance_json: &str,
    format: SampleFormat,
) -> Result<(), ExrError> {
    Ok(output::write(path, &bytes(path, content, provenance_json, format)?)?)
}

/// Encodes a picture as `OpenEXR`. Equal contents give equal bytes. `path` is the file's name in errors.
///
/// Pixels that were never written are zero, and so are layers that the film does not have. `provenance_json`
/// is stored in the attribute [`PROVENANCE`], with characters beyond ASCII as JSON `\u` escapes.
///
/// # Errors
/// If the provenance is empty or cannot be stored as text.
pub fn bytes(
    path: &Path,
    content: &Content,
    provenance_json: &str,
    format: SampleFormat,
) -> Result<Vec<u8>, ExrError> {
    let fault = |reason: String| ExrError::Encode { path: path.to_owned(), reason };
    if provenance_json.is_empty() {
        return Err(fault("the provenance is empty".to_owned()));
    }
    let image = image_of(content, provenance_json, format)
        .ok_or_else(|| fault("the provenance is not text".to_owned()))?;
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).map_err(|error| fault(error.to_string()))?;
    let mut bytes = bytes.into_inner();
    attributes::sort(&mut bytes, |name| name == PROVENANCE || name.starts_with(cryptomatte::PREFIX));
    intact::seal_exr(&mut bytes);
    Ok(bytes)
}

/// Encodes a square picture of `size * size` pixels as `OpenEXR`, float samples. `pixels` are rows from the
/// top; those that are missing are black. Equal pixels give equal bytes. `path` is the file's name in errors.
///
/// # Errors
/// If the encoder refuses the picture.
pub fn square_bytes(path: &Path, size: u32, pixels: &[[f32; 3]]) -> Result<Vec<u8>, ExrError> {
    let side = size as usize;
    let at = |Vec2(x, y): Vec2<usize>| {
        let [red, green, blue] = pixels.get(y * side + x).copied().unwrap_or_default();
        (red, green, blue)
    };
    let encoding = Encoding { line_order: LineOrder::Increasing, ..Encoding::SMALL_LOSSLESS };
    let layer = Layer::new((side, side), LayerAttributes::default(), encoding, SpecificChannels::rgb(at));
    let mut bytes = Cursor::new(Vec::new());
    let written = Image::from_layer(layer).write().to_buffered(&mut bytes);
    written.map_err(|error| ExrError::Encode { path: path.to_owned(), reason: error.to_string() })?;
    Ok(bytes.into_inner())
}

fn image_of(
    content: &Content,
    provenance: &str,
    format: SampleFormat,
) -> Option<Image<Layer<AnyChannels<FlatSamples>>>> {
    let film = content.film;
    let window = film.window();
    let provenance = Text::new_or_none(ascii(provenance))?;
    let mut attributes =
        ImageAttributes::new(IntegerBounds::from_dimensions((film.width() as usize, film.height() as usize)));
    attributes.other.insert(Text::new_or_none(PROVENANCE)?, AttributeValue::Text(provenance));
    for (matte, identities) in mattes(content) {
        for (name, value) in matte.attributes(identities) {
            let value = AttributeValue::Text(Text::new_or_none(ascii(&value))?);
            attributes.other.insert(Text::new_or_none(name)?, value);
        }
    }
    let size = Vec2(window.width() as usize, window.height() as usize);
    let position = Vec2(i32::try_from(window.x0).ok()?, i32::try_from(window.y0).ok()?);
    let comments = Text::new_or_none(BLANK);
    let own = LayerAttributes { comments, ..LayerAttributes::default() }.with_position(position);
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: exr::image::Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    Some(Image { attributes, layer_data: Layer::new(size, own, encoding, channels(content, format)) })
}

fn channels(content: &Content, format: SampleFormat) -> AnyChannels<FlatSamples> {
    let Content { film, layers, denoised, is_transparent, identities: _, illuminance } = content;
    let mut asked: Vec<(Channel, SampleFormat)> = Vec::new();
    asked.extend(Layers::colour().iter().map(|channel| (*channel, format)));
    asked.extend(is_transparent.then_some((COLOUR_ALPHA, format)));
    for layer in layers.iter() {
        let format = if layer.is_always_single() { SampleFormat::Float } else { format };
        asked.extend(layer.channels().iter().map(|channel| (*channel, format)));
    }
    let mut list: SmallVec<_> = of_film(film, &asked).collect();
    for (matte, identities) in mattes(content) {
        let values = matte.values(film, identities).into_iter();
        list.extend(matte.channels().zip(values).map(|(name, values)| single(&name, values)));
    }
    list.extend(light_groups(film));
    list.extend(illuminance.map(|values| single(ILLUMINANCE, values.to_vec())));
    if let Some(radiance) = denoised {
        let of_channel = |(index, name)| any_channel(name, radiance.iter().map(|pixel| pixel[index]), format);
        list.extend(DENOISED.into_iter().enumerate().map(of_channel));
    }
    AnyChannels::sort(list)
}

/// Channels of a film's values. Each pixel is decoded once for all.
fn of_film<'a>(
    film: &Film,
    asked: &'a [(Channel, SampleFormat)],
) -> impl Iterator<Item = AnyChannel<FlatSamples>> + use<'a> {
    let empty = |format| match format {
        SampleFormat::Half => FlatSamples::F16(Vec::new()),
        SampleFormat::Float => FlatSamples::F32(Vec::new()),
    };
    let mut samples: Vec<FlatSamples> = asked.iter().map(|(_, format)| empty(*format)).collect();
    for pixel in film.all() {
        for ((channel, _), samples) in asked.iter().zip(&mut samples) {
            let value = (channel.value)(&pixel);
            match samples {
                FlatSamples::F16(halves) => halves.push(to_half(value)),
                FlatSamples::F32(floats) => floats.push(value),
                FlatSamples::U32(_) => {}
            }
        }
    }
    asked.iter().zip(samples).map(|((channel, _), samples)| AnyChannel::new(channel.name, samples))
}

/// Name of a channel, `R`, `G` or `B`, of a light group.
fn name_of_group(group: &str, channel: &str) -> String {
    format!("{GROUP_PREFIX}{group}.{channel}")
}

/// Channels of a film's light groups, always in single precision: they add up to the radiance.
fn light_groups(film: &Film) -> Vec<AnyChannel<FlatSamples>> {
    let names = film.light_groups().iter();
    let names: Vec<String> =
        names.flat_map(|group| COLOUR.map(|channel| name_of_group(group, channel))).collect();
    let mut values = vec![Vec::new(); names.len()];
    if !names.is_empty() {
        for pixel in film.all() {
            values
                .iter_mut()
                .zip(pixel.light_groups.as_flattened())
                .for_each(|(list, value)| list.push(*value));
        }
    }
    names.iter().zip(values).map(|(name, values)| single(name, values)).collect()
}

/// Mattes of a picture with names.
fn mattes<'a>(content: &Content<'a>) -> impl Iterator<Item = (Matte, &'a Identities)> {
    let identities = content.identities;
    Matte::of(content.layers).filter_map(move |matte| Some((matte, identities?)))
}

fn single(name: &str, values: Vec<f32>) -> AnyChannel<FlatSamples> {
    AnyChannel::new(name, FlatSamples::F32(values))
}

fn any_channel(
    name: &str,
    values: impl Iterator<Item = f32>,
    format: SampleFormat,
) -> AnyChannel<FlatSamples> {
    let samples = match format {
        SampleFormat::Half => FlatSamples::F16(values.map(to_half).collect()),
        SampleFormat::Float => FlatSamples::F32(values.collect()),
    };
    AnyChannel::new(name, samples)
}

/// Nearest half. Finite values beyond the range of halves become plus or minus 65504.
fn to_half(value: f32) -> f16 {
    let half = f16::from_f32(value);
    if half.is_infinite() && value.is_finite() { f16::MAX.copysign(half) } else { half }
}

/// Escapes every character beyond ASCII of a JSON text as `\u`, because the attribute is ASCII. In JSON only
/// strings contain such characters.
pub(crate) fn ascii(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for character in json.chars() {
        if character.is_ascii() {
            text.push(character);
        } else {
            let units = character
                .encode_utf16(&mut [0; 2])
                .iter()
                .map(|unit| format!("\\u{unit:04x}"))
                .collect::<String>();
            text.push_str(&units);
        }
    }
    text
}

/// Radiance to read from a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// The channels `R G B` of the unnamed layer.
    Rendered,
    /// The layer [`Content::denoised`], which tone-mapped pictures show; in a file without that layer the
    /// same as [`Self::Rendered`].
    Denoised,
    /// The layer [`Content::illuminance`], lx, in each of the three channels.
    Illuminance,
}

/// Reads the three channels that `shown` selects, from the first part that has them. Their samples can be
/// half, float or unsigned integers.
///
/// # Errors
/// If the file cannot be read, is malformed, lacks the channels, or has more than [`MAX_READ_PIXELS`]. A file
/// too short for the size that it states is refused before memory for its pixels is allocated.
pub fn read(path: &Path, shown: Shown) -> Result<RgbImage, ExrError> {
    decode_walled(path, &bytes_of(path)?, MAX_READ_PIXELS, shown)
}

/// Bytes of a regular file.
fn bytes_of(path: &Path) -> Result<Vec<u8>, ExrError> {
    let unreadable = |source| ExrError::Unreadable { path: path.to_owned(), source };
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() {
        return Err(unreadable(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")));
    }
    std::fs::read(path).map_err(unreadable)
}

/// Reads the provenance of a picture and the type of its samples, without its pixels; `None` if this program
/// did not write the file.
pub fn read_form(path: &Path) -> Option<(String, SampleFormat)> {
    let meta = || MetaData::read_from_file(path, false).map_err(drop);
    let meta = foreign::decode(meta, || ()).ok()?;
    let [header] = &meta.headers[..] else { return None };
    let format = match header.channels.find_index_of_channel(&Text::new_or_none("R")?) {
        Some(red) => match header.channels.list.get(red)?.sample_type {
            SampleType::F16 => SampleFormat::Half,
            SampleType::F32 => SampleFormat::Float,
            SampleType::U32 => return None,
        },
        None => return None,
    };
    Some((provenance(&header.own_attributes)?, format))
}

/// Returns whether a file has exactly the bytes that [`write()`] wrote; false if it cannot be read.
pub fn is_intact(path: &Path) -> bool {
    std::fs::read(path).is_ok_and(|bytes| intact::is_intact_exr(&bytes))
}

/// Decodes the rendered radiance from the bytes of a file, as [`read()`] does. A picture with more than
/// `most_pixels` pixels is refused. `path` is the file's name in errors.
pub fn decode_rgb(path: &Path, bytes: &[u8], most_pixels: u64) -> Result<RgbImage, ExrError> {
    decode_walled(path, bytes, most_pixels, Shown::Rendered)
}

fn decode_walled(path: &Path, bytes: &[u8], most_pixels: u64, shown: Shown) -> Result<RgbImage, ExrError> {
    // The `exr` crate does not check every number of a file: sums of window sizes, offsets of blocks.
    foreign::decode(
        || decode(path, bytes, most_pixels, shown),
        || ExrError::Malformed {
            path: path.to_owned(),
            reason: "its structure contradicts itself".to_owned(),
        },
    )
}

fn decode(path: &Path, bytes: &[u8], most_pixels: u64, shown: Shown) -> Result<RgbImage, ExrError> {
    let malformed =
        |error: exr::error::Error| ExrError::Malformed { path: path.to_owned(), reason: error.to_string() };
    let meta = checked(path, bytes, most_pixels)?;
    let is_denoised = meta.headers.iter().any(|header| has_channels(header, &DENOISED));
    let [red, green, blue] = match shown {
        Shown::Denoised if is_denoised => DENOISED,
        Shown::Rendered | Shown::Denoised => RENDERED,
        // The reader takes each channel once.
        Shown::Illuminance => [ILLUMINANCE, "R", "G"],
    };
    if !meta.headers.iter().any(|header| has_channels(header, &[red, green, blue])) {
        let names = meta.headers.iter().flat_map(|header| header.channels.list.iter());
        let names: Vec<_> = names.take(20).map(|channel| channel.name.to_string()).collect();
        return Err(ExrError::NoColour { path: path.to_owned(), channels: names.join(", ") });
    }
    let image = reader()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required(red)
        .required(green)
        .required(blue)
        .optional("A", 1.0_f32)
        .collect_pixels(
            |size, (.., alpha)| {
                let alpha = alpha.as_ref().map(|_| vec![1.0; size.area()]);
                ReadPixels { width: size.width(), colours: vec![[0.0; 3]; size.area()], alpha }
            },
            |read: &mut ReadPixels, position, (red, green, blue, alpha): (f32, f32, f32, f32)| {
                let index = position.y() * read.width + position.x();
                read.colours[index] = [red, green, blue];
                if let Some(all) = &mut read.alpha {
                    all[index] = alpha;
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        // A panic on a worker thread would end the process.
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(malformed)?;
    let layer = image.layer_data;
    let provenance = provenance(&layer.attributes);
    let Vec2(x, y) = layer.attributes.layer_position;
    let ReadPixels { width, colours: mut pixels, alpha } = layer.channel_data.pixels;
    if shown == Shown::Illuminance {
        pixels.iter_mut().for_each(|pixel| *pixel = [pixel[0]; 3]);
    }
    Ok(RgbImage { width, height: layer.size.height(), data_window_origin: [x, y], pixels, alpha, provenance })
}

/// Reads the headers of a file, and checks that decoding its pixels is safe.
fn checked(path: &Path, bytes: &[u8], most_pixels: u64) -> Result<MetaData, ExrError> {
    let malformed =
        |error: exr::error::Error| ExrError::Malformed { path: path.to_owned(), reason: error.to_string() };
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(malformed)?;
    MetaData::validate(&meta.headers, false).map_err(malformed)?;
    for header in &meta.headers {
        check_size(path, header, bytes.len() as u64, most_pixels)?;
    }
    let has_dwa = meta.headers.iter().any(|header| dwa::is_dwa(header.compression));
    if has_dwa && !dwa::states_possible_sizes(bytes).map_err(malformed)? {
        let reason = "a block states more samples than it has".to_owned();
        return Err(ExrError::Malformed { path: path.to_owned(), reason });
    }
    Ok(meta)
}

/// Pixels of a part of a file while they are read, row by row.
struct ReadPixels {
    width: usize,
    colours: Vec<[f32; 3]>,
    alpha: Option<Vec<f32>>,
}

/// Value of the attribute [`PROVENANCE`], if it is JSON.
fn provenance(attributes: &LayerAttributes) -> Option<String> {
    let AttributeValue::Text(text) = attributes.other.get(&Text::new_or_none(PROVENANCE)?)? else {
        return None;
    };
    let text = text.to_string();
    serde_json::from_str::<serde::de::IgnoredAny>(&text).is_ok().then_some(text)
}

fn has_channels(header: &Header, names: &[&str]) -> bool {
    names.iter().all(|name| header.channels.list.iter().any(|channel| channel.name.eq(name)))
}

/// Refuses sizes that are too large, or that a file of `length` bytes cannot hold at any compression ratio.
fn check_size(path: &Path, header: &Header, length: u64, most_pixels: u64) -> Result<(), ExrError> {
    const CHUNK_OVERHEAD: u64 = 16;
    let Vec2(width, height) = header.layer_size;
    let pixels = (width as u64).checked_mul(height as u64).filter(|&pixels| pixels <= most_pixels);
    let pixels = pixels.ok_or_else(|| ExrError::TooLarge { path: path.to_owned(), width, height })?;
    let contradiction = |reason: String| Err(ExrError::Malformed { path: path.to_owned(), reason });
    if (header.chunk_count as u64).saturating_mul(CHUNK_OVERHEAD) > length {
        return contradiction(format!("{} blocks do not fit into {length} bytes", header.chunk_count));
    }
    let Some(most) = most_compressed(header.compression) else {
        return Err(ExrError::Compression {
            path: path.to_owned(),
            compression: header.compression.to_string(),
        });
    };
    let held = length.saturating_mul(most);
    // A picture of one colour may exceed the ratio, so small pictures with DWA are read at any ratio.
    let held = if dwa::is_dwa(header.compression) { held.max(dwa::PLAIN_BYTES) } else { held };
    let stated = pixels.saturating_mul(header.channels.bytes_per_pixel as u64);
    if stated > held {
        return contradiction(format!("{width} x {height} pixels do not fit into {length} bytes"));
    }
    // Memory of the picture, and of one block while it is unpacked and reordered.
    let block = stated.min(header.max_block_byte_size() as u64);
    let transform = if dwa::is_dwa(header.compression) { dwa::transform_bytes(header) } else { 0 };
    let unpacked = transform.saturating_add(3 * block);
    allocation::check(pixels.saturating_mul(size_of::<[f32; 4]>() as u64).saturating_add(unpacked))
        .map_err(|OutOfMemory { bytes }| ExrError::Memory { path: path.to_owned(), bytes })?;
    let BlockDescription::Tiles(tiles) = header.blocks else { return Ok(()) };
    let tile = (tiles.tile_size.width() as u64).saturating_mul(tiles.tile_size.height() as u64);
    if tile > MAX_READ_PIXELS {
        return contradiction(format!("a tile of {tile} pixels is not possible"));
    }
    Ok(())
}

/// Upper bound of the compression ratio; `None` for compressions that are not supported.
fn most_compressed(compression: Compression) -> Option<u64> {
    match compression {
        Compression::Uncompressed => Some(1),
        Compression::RLE => Some(64),
        // Deflate reaches 1032 to 1; the others stay below.
        Compression::ZIP1 | Compression::ZIP16 | Compression::PXR24 => Some(1100),
        Compression::PIZ | Compression::B44 | Compression::B44A => Some(1100),
        // 64 samples of two bytes take at least one bit, 1024 to 1, except runs of equal codes.
        Compression::DWAA(_) | Compression::DWAB(_) => Some(1100),
        _ => None,
    }
}
