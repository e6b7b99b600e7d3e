//! Decoding of KTX2 with Basis Universal, as `KHR_texture_basisu` defines it: ETC1S with `BasisLZ`, or UASTC
//! with or without Zstandard.
//!
//! The transcoder allocates what a file's header states, and decodes more formats than glTF allows. The
//! header is therefore checked here first. Zstandard is decoded here as well; the image's size determines the
//! decoded length.

use std::array;
use std::borrow::Cow;

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use ruzstd::decoding::FrameDecoder;

use super::fault::Fault;

pub(super) const MAGIC: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Length of the header with the first entry of the level index, 32-bit words.
const HEADER_WORDS: usize = 26;

/// Positions in the file's header, bytes: supercompression scheme, offset of level 0, length of level 0.
const SCHEME: usize = 44;
const LEVEL_OFFSET: usize = 80;
const LEVEL_LENGTH: usize = 88;

/// Size of a sample's description at the end of the data format descriptor, and position of the channel in
/// it, bytes.
const SAMPLE: usize = 16;
const CHANNEL: usize = 3;

/// Side of a block, texels, and size of a UASTC block, bytes.
const BLOCK_SIDE: u32 = 4;
const UASTC_BLOCK: u64 = 16;

/// Maximum number of texels per byte of Zstandard. Four bytes repeat a byte 2^17 times, and UASTC takes one
/// byte per texel.
const ZSTANDARD_TEXELS_OF_A_BYTE: u64 = 1 << 15;

/// Window size that decoders of Zstandard should support (RFC 8878, 3.1.1.1.2), bytes. An encoder that knows
/// the length of its data takes no window larger than this length.
const ZSTANDARD_WINDOW: u64 = 8 << 20;

const ENCODE_AGAIN: &str = "encode the image again for glTF, or convert it to PNG, JPEG or WebP";

/// Compression of the texels.
#[derive(Clone, Copy)]
enum Codec {
    Etc1s,
    Uastc,
    UastcInZstandard,
}

/// Header of a file whose texels can be decoded.
struct Header<'a> {
    size: [u32; 2],
    codec: Codec,
    /// Bytes of level 0, possibly compressed by Zstandard.
    level: &'a [u8],
    /// Stated length of level 0 after Zstandard is removed, bytes.
    plain_length: u64,
}

impl<'a> Header<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self, Fault> {
        let words = words::<HEADER_WORDS>(bytes).ok_or_else(|| Fault::damaged("its header is cut off"))?;
        let [_, _, _, vk_format, _, width, height, depth, layers, faces, levels, scheme, ref rest @ ..] =
            words;
        let &[format, format_length, metadata, metadata_length, ..] = rest;
        let [global, global_length, offset, length, uncompressed] =
            [16, 18, 20, 22, 24].map(|word| u64::from(words[word]) | u64::from(words[word + 1]) << 32);
        if height == 0 || depth != 0 || layers > 1 || faces != 1 {
            return Err(unreadable("the KTX2 is not one two-dimensional picture"));
        }
        let codec = Codec::of(vk_format, part(bytes, format.into(), format_length.into())?, scheme)?;
        check_metadata(part(bytes, metadata.into(), metadata_length.into())?)?;
        if matches!(codec, Codec::Etc1s) {
            check_global(part(bytes, global, global_length)?, levels)?;
        }
        let plain_length = if matches!(codec, Codec::UastcInZstandard) { uncompressed } else { length };
        Ok(Self { size: [width, height], codec, level: part(bytes, offset, length)?, plain_length })
    }
}

impl Codec {
    /// Determines the codec from `vkFormat`, the data format descriptor and the supercompression scheme.
    fn of(vk_format: u32, descriptor: &[u8], scheme: u32) -> Result<Self, Fault> {
        const ETC1S: u8 = 163;
        const UASTC: u8 = 166;
        const HDR: [u8; 2] = [167, 168];
        let model = descriptor.get(12);
        let channel = descriptor.len().checked_sub(SAMPLE).map(|sample| descriptor[sample + CHANNEL] & 15);
        let (Some(&model), Some(channel)) = (model, channel) else {
            return Err(Fault::damaged("its data format descriptor is cut off"));
        };
        match (vk_format, model, scheme, channel) {
            // The channel of the last sample: RGB, one channel as grey, or alpha.
            (0, ETC1S, 1, 0 | 3 | 15) => Ok(Self::Etc1s),
            // RGB, RGBA, or one channel as grey.
            (0, UASTC, 0, 0 | 3 | 4) => Ok(Self::Uastc),
            (0, UASTC, 2, 0 | 3 | 4) => Ok(Self::UastcInZstandard),
            (0, ETC1S, 1, _) | (0, UASTC, 0 | 2, _) => {
                Err(unreadable("the KTX2 has other channels than RGB or RGBA"))
            }
            (0, ETC1S | UASTC, ..) => Err(unreadable(&format!(
                "the KTX2 has the supercompression scheme {scheme}, which glTF does not allow for its format"
            ))),
            _ if HDR.contains(&model) => Err(unreadable("the KTX2 holds HDR texels, not ETC1S or UASTC")),
            (0, ..) => {
                Err(unreadable(&format!("the KTX2 holds neither ETC1S nor UASTC, but colour model {model}")))
            }
            _ => {
                Err(unreadable(&format!("the KTX2 holds the Vulkan format {vk_format}, not Basis Universal")))
            }
        }
    }
}

fn unreadable(reason: &str) -> Fault {
    Fault::unreadable(reason, ENCODE_AGAIN)
}

/// First `N` little-endian words of a file.
fn words<const N: usize>(bytes: &[u8]) -> Option<[u32; N]> {
    let bytes = bytes.get(..4 * N)?;
    Some(array::from_fn(|word| u32::from_le_bytes(array::from_fn(|byte| bytes[4 * word + byte]))))
}

/// Returns `length` bytes of a file from `offset`; an error if they exceed the file.
fn part(bytes: &[u8], offset: u64, length: u64) -> Result<&[u8], Fault> {
    let part = || bytes.get(usize::try_from(offset).ok()?..)?.get(..usize::try_from(length).ok()?);
    part().ok_or_else(|| Fault::damaged("its header refers to bytes beyond its end"))
}

/// Checks the lengths in the supercompression global data of ETC1S: header, image descriptions, codebooks and
/// tables.
fn check_global(global: &[u8], levels: u32) -> Result<(), Fault> {
    let Some([_, endpoints, selectors, tables, extended, _, _, colour_length, ..]) = words::<10>(global)
    else {
        return Err(Fault::damaged("its codebooks are cut off"));
    };
    let parts = [endpoints, selectors, tables, extended].map(u64::from);
    if parts.iter().sum::<u64>() + 20 * (1 + u64::from(levels)) != global.len() as u64 {
        return Err(Fault::damaged("the lengths of its codebooks contradict each other"));
    }
    if colour_length == 0 {
        return Err(Fault::damaged("its level 0 is empty"));
    }
    Ok(())
}

/// Checks that the first texel is the upper left one, that channels are not swizzled, and that the file is no
/// video.
fn check_metadata(metadata: &[u8]) -> Result<(), Fault> {
    for (key, required) in [("KTXorientation", "rd"), ("KTXswizzle", "rgba")] {
        if value(metadata, key).is_some_and(|value| value != required.as_bytes()) {
            return Err(unreadable(&format!("the KTX2's {key} is not '{required}', as glTF requires")));
        }
    }
    match value(metadata, "KTXanimData") {
        Some(_) => Err(unreadable("the KTX2 is a video")),
        None => Ok(()),
    }
}

/// Value of a key in the key/value data, without the terminating NUL.
fn value<'a>(mut metadata: &'a [u8], key: &str) -> Option<&'a [u8]> {
    loop {
        let (length, rest) = metadata.split_first_chunk()?;
        let length = u32::from_le_bytes(*length) as usize;
        let entry = rest.get(..length)?;
        if let Some(value) = entry.strip_prefix(key.as_bytes()).and_then(|rest| rest.strip_prefix(b"\0")) {
            return Some(value.strip_suffix(b"\0").unwrap_or(value));
        }
        metadata = rest.get(length.next_multiple_of(4)..)?;
    }
}

/// Width and height, and the maximum number of texels in a file of this length. The maximum is `u64::MAX` for
/// ETC1S, whose blocks may take no bits.
pub(super) fn size(bytes: &[u8]) -> Result<([u32; 2], u64), Fault> {
    let header = Header::read(bytes)?;
    let level = header.level.len() as u64;
    let most_texels = match header.codec {
        Codec::Etc1s => u64::MAX,
        Codec::Uastc => level,
        Codec::UastcInZstandard => ZSTANDARD_TEXELS_OF_A_BYTE * level,
    };
    Ok((header.size, most_texels))
}

pub(super) fn decode(bytes: &[u8], size: [u32; 2]) -> Result<Vec<[u8; 4]>, Fault> {
    let header = Header::read(bytes)?;
    let [columns, rows] = size.map(|side| u64::from(side.div_ceil(BLOCK_SIDE)));
    let length = UASTC_BLOCK * columns * rows;
    if !matches!(header.codec, Codec::Etc1s) && header.plain_length != length {
        let found = header.plain_length;
        return Err(Fault::damaged(format!("its level 0 has {found} bytes instead of {length}")));
    }
    let file = match header.codec {
        Codec::Etc1s | Codec::Uastc => Cow::Borrowed(bytes),
        Codec::UastcInZstandard => Cow::Owned(without_zstandard(bytes, header.level, length as usize)?),
    };
    let transcoder = Transcoder::new(&file).map_err(|_| Fault::damaged("its header contradicts itself"))?;
    let texels = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE);
    let texels = texels.map_err(|_| Fault::damaged("its blocks are invalid"))?;
    Ok(texels.as_chunks().0.to_vec())
}

/// Copy of a file with an uncompressed level 0 appended, and the header changed accordingly.
fn without_zstandard(bytes: &[u8], level: &[u8], length: usize) -> Result<Vec<u8>, Fault> {
    let offset = bytes.len();
    let mut file = vec![0; offset + length];
    let (copy, plain) = file.split_at_mut(offset);
    let mut decoder = FrameDecoder::new();
    decoder.set_max_window_size(ZSTANDARD_WINDOW.max(length as u64));
    let decoded = decoder.decode_all(level, plain).map_err(Fault::damaged)?;
    if decoded != length {
        return Err(Fault::damaged(format!("its level 0 is {decoded} bytes instead of {length}")));
    }
    copy.copy_from_slice(bytes);
    copy[SCHEME..SCHEME + 4].fill(0);
    for (place, value) in [(LEVEL_OFFSET, offset), (LEVEL_LENGTH, length)] {
        copy[place..place + 8].copy_from_slice(&(value as u64).to_le_bytes());
    }
    Ok(file)
}
