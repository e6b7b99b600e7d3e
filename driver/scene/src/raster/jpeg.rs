//! Decoding of JPEG: baseline and progressive, grey or colour.

use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::fault::Fault;
use crate::texture::MAX_SIDE;

pub(super) const MAGIC: &[u8] = b"\xff\xd8\xff";

/// Maximum number of texels per byte. A block of samples takes at least one bit, and there is a block for
/// each 128 texels at the coarsest subsampling.
const TEXELS_OF_A_BYTE: u64 = 8 * 128;

type Decoder<'a> = JpegDecoder<ZCursor<&'a [u8]>>;

fn decoder(bytes: &[u8]) -> Decoder<'_> {
    let side = MAX_SIDE as usize;
    // Strict mode reports a truncated file. Without it, the missing part would be grey.
    let options = DecoderOptions::new_safe().set_strict_mode(true).set_max_width(side).set_max_height(side);
    JpegDecoder::new_with_options(ZCursor::new(bytes), options)
}

/// Width and height, and the maximum number of texels in a file of this length.
pub(super) fn size(bytes: &[u8]) -> Result<([u32; 2], u64), Fault> {
    let frame = frame_header(bytes).ok_or_else(|| Fault::damaged("it has no frame header"))?;
    Ok((frame, TEXELS_OF_A_BYTE * bytes.len() as u64))
}

/// Width and height in the frame header (ITU-T T.81, B.2.2). The decoder reports them only within its own
/// limits.
fn frame_header(bytes: &[u8]) -> Option<[u32; 2]> {
    let mut rest = bytes.get(2..)?;
    loop {
        let start = rest.iter().position(|&byte| byte == 0xff)?;
        let marker = *rest.get(start + 1)?;
        rest = rest.get(start + 1..)?;
        match marker {
            // Fill bytes, stuffed bytes, and markers without a segment.
            0xff => {}
            0x00 | 0x01 | 0xd0..=0xd8 => rest = rest.get(1..)?,
            // The frame header precedes scans and the end of the image.
            0xd9 | 0xda => return None,
            _ => {
                let length = u16::from_be_bytes(*rest.get(1..)?.first_chunk()?);
                let segment = rest.get(1..1 + length as usize)?;
                // Frames are C0 to CF except tables (C4), an extension (C8) and arithmetic conditioning (CC).
                if matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) {
                    let side = |at: usize| Some(u16::from_be_bytes(*segment.get(at..)?.first_chunk()?));
                    return Some([side(5)?.into(), side(3)?.into()]);
                }
                rest = rest.get(1 + length as usize..)?;
            }
        }
    }
}

pub(super) fn decode(bytes: &[u8], [width, height]: [u32; 2]) -> Result<Vec<[u8; 4]>, Fault> {
    let mut decoder = decoder(bytes);
    decoder.decode_headers().map_err(|error| Fault::damaged(format!("{error:?}")))?;
    if decoder.dimensions() != Some((width as usize, height as usize)) {
        return Err(Fault::damaged("its headers contradict each other"));
    }
    let colours = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => ColorSpace::Luma,
        Some(ColorSpace::YCbCr | ColorSpace::RGB) => ColorSpace::RGB,
        Some(ColorSpace::CMYK | ColorSpace::YCCK) => {
            let reason = "the JPEG is of CMYK, colours of ink, which stand for no light";
            return Err(Fault::unreadable(reason, "convert the image to RGB"));
        }
        _ => {
            let reason = "the JPEG has neither one channel nor three";
            return Err(Fault::unreadable(reason, "convert the image to RGB"));
        }
    };
    decoder.set_options(decoder.options().jpeg_set_out_colorspace(colours));
    let samples = decoder.decode().map_err(|error| Fault::damaged(format!("{error:?}")))?;
    Ok(match colours {
        ColorSpace::Luma => samples.iter().map(|&grey| [grey, grey, grey, 255]).collect(),
        _ => samples.as_chunks().0.iter().map(|&[red, green, blue]| [red, green, blue, 255]).collect(),
    })
}
