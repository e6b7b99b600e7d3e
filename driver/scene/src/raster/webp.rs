//! Decoding of WebP: lossy or lossless, with or without alpha.

use std::io::Cursor;

use image_webp::WebPDecoder;

use super::fault::Fault;

/// Size of the header of the file, and of a chunk, bytes.
const FILE_HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

/// Mask of the bits of a width or height in the headers of both codecs.
const SIDE: u32 = 0x3fff;

pub(super) fn is_webp(bytes: &[u8]) -> bool {
    bytes.starts_with(b"RIFF") && bytes.get(8..FILE_HEADER) == Some(b"WEBP")
}

fn decoder(bytes: &[u8]) -> Result<WebPDecoder<Cursor<&[u8]>>, Fault> {
    let decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(Fault::damaged)?;
    if decoder.is_animated() {
        return Err(Fault::unreadable("the WebP is animated", "store one picture of the animation"));
    }
    Ok(decoder)
}

/// Width and height, and `u64::MAX`: the length of the file does not limit the number of texels, because
/// texels of one colour may take no bits.
pub(super) fn size(bytes: &[u8]) -> Result<([u32; 2], u64), Fault> {
    let size = decoder(bytes)?.dimensions().into();
    // The decoder allocates by the size in the codec's header before it compares that size with the file's.
    if frame_size(bytes) != Some(size) {
        return Err(Fault::damaged("its headers contradict each other"));
    }
    Ok((size, u64::MAX))
}

/// Width and height in the codec's header of the first picture.
fn frame_size(bytes: &[u8]) -> Option<[u32; 2]> {
    let mut rest = bytes.get(FILE_HEADER..)?;
    loop {
        let (header, data) = rest.split_at_checked(CHUNK_HEADER)?;
        let (kind, length) = header.split_first_chunk::<4>()?;
        let length = u32::from_le_bytes(*length.first_chunk()?) as usize;
        match kind {
            b"VP8 " => {
                let side = |at| Some(u32::from(u16::from_le_bytes(*data.get(at..)?.first_chunk()?)) & SIDE);
                return Some([side(6)?, side(8)?]);
            }
            b"VP8L" => {
                let sides = u32::from_le_bytes(*data.get(1..)?.first_chunk()?);
                return Some([(sides & SIDE) + 1, (sides >> 14 & SIDE) + 1]);
            }
            _ => rest = data.get(length.next_multiple_of(2)..)?,
        }
    }
}

pub(super) fn decode(bytes: &[u8], [width, height]: [u32; 2]) -> Result<Vec<[u8; 4]>, Fault> {
    let mut decoder = decoder(bytes)?;
    if decoder.dimensions() != (width, height) {
        return Err(Fault::damaged("its headers contradict each other"));
    }
    let length = decoder.output_buffer_size().ok_or_else(|| Fault::damaged("it is too large"))?;
    let mut samples = vec![0; length];
    decoder.read_image(&mut samples).map_err(Fault::damaged)?;
    Ok(if decoder.has_alpha() {
        samples.as_chunks().0.to_vec()
    } else {
        samples.as_chunks().0.iter().map(|&[red, green, blue]| [red, green, blue, 255]).collect()
    })
}
