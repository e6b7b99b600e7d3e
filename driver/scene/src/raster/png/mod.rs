//! Decoding of PNG.

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, Transformations};

use super::deep::Deep;
use super::fault::Fault;

pub(super) const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Maximum number of texels per byte. Deflate expands a byte to at most 1032, and a byte holds at most 8
/// texels of one bit.
const TEXELS_OF_A_BYTE: u64 = 1032 * 8;

/// Maximum memory of the decoder, besides rows, for chunks such as text and colour profiles, bytes.
const ANCILLARY_BYTES: usize = 16 << 20;

/// Maximum size of a palette, bytes: 256 entries.
const MAX_PALETTE: usize = 3 * 256;

/// Size of the CRC after a chunk's data, bytes.
const CHECKSUM: usize = 4;

fn decoder(bytes: &[u8]) -> Decoder<Cursor<&[u8]>> {
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    // Expands palettes, transparent colours and depths below 8 bits to channels of 8 bits; 16 bits stay.
    decoder.set_transformations(Transformations::EXPAND);
    decoder
}

/// Width and height, and the maximum number of texels in a file of this length.
pub(super) fn size(bytes: &[u8]) -> Result<([u32; 2], u64), Fault> {
    let mut decoder = decoder(bytes);
    let info = decoder.read_header_info().map_err(Fault::damaged)?;
    if info.color_type == ColorType::Indexed {
        check_palette(bytes)?;
    }
    Ok(([info.width, info.height], TEXELS_OF_A_BYTE * bytes.len() as u64))
}

/// Checks that a palette has 1 to 256 entries of three bytes. With another palette the decoder would index
/// out of bounds (image-rs/image-png issue 682).
fn check_palette(bytes: &[u8]) -> Result<(), Fault> {
    let palette = chunks(bytes).take_while(|(kind, _)| kind != b"IDAT").find(|(kind, _)| kind == b"PLTE");
    match palette {
        Some((_, length)) if !(3..=MAX_PALETTE).contains(&length) || !length.is_multiple_of(3) => {
            Err(Fault::damaged(format!(
                "a palette of {length} bytes: three for each of 1 to 256 colours are possible"
            )))
        }
        // The decoder itself rejects an indexed image without a palette.
        _ => Ok(()),
    }
}

/// Type and stated length of each chunk.
fn chunks(bytes: &[u8]) -> impl Iterator<Item = ([u8; 4], usize)> {
    let mut rest = bytes.get(MAGIC.len()..).unwrap_or_default();
    std::iter::from_fn(move || {
        let (length, after) = rest.split_first_chunk()?;
        let length = u32::from_be_bytes(*length) as usize;
        let kind = *after.first_chunk()?;
        rest = after.get((kind.len() + length).saturating_add(CHECKSUM)..).unwrap_or_default();
        Some((kind, length))
    })
}

/// Encoder of a texel of 16 bits per channel.
type Store<'a> = &'a dyn Fn([u16; 4]) -> [u8; 4];

/// Returns whether an image has 16 bits a channel.
pub(super) fn is_deep(bytes: &[u8]) -> bool {
    decoder(bytes).read_header_info().is_ok_and(|info| info.bit_depth == BitDepth::Sixteen)
}

/// Decodes an image. Texels of 16 bits per channel are encoded as `deep` or, if it is `None`, reduced to 8
/// bits.
pub(super) fn decode(
    bytes: &[u8],
    [width, height]: [u32; 2],
    deep: Option<Deep>,
) -> Result<Vec<[u8; 4]>, Fault> {
    let store: Store<'_> = match deep {
        Some(deep) => &move |texel| deep.texel(texel),
        None => &|texel| texel.map(to_8_bits),
    };
    let mut decoder = decoder(bytes);
    // The limit contains a row before and a row after filtering, each of up to eight bytes per texel.
    decoder.set_limits(png::Limits { bytes: ANCILLARY_BYTES + 64 * width as usize });
    let mut reader = decoder.read_info().map_err(Fault::damaged)?;
    let mut texels = Vec::new();
    texels.try_reserve_exact(width as usize * height as usize).map_err(Fault::damaged)?;
    if reader.info().interlaced {
        let mut rows = vec![0; reader.output_buffer_size().ok_or_else(|| Fault::damaged("it is too large"))?];
        reader.next_frame(&mut rows).map_err(Fault::damaged)?;
        append(&mut texels, &rows, reader.output_color_type(), store);
    } else {
        let format = reader.output_color_type();
        while let Some(row) = reader.next_row().map_err(Fault::damaged)? {
            append(&mut texels, row.data(), format, store);
        }
    }
    Ok(texels)
}

/// Converts rows in the decoder's output format to texels, and appends them to `texels`. `store` encodes
/// texels of 16 bits per channel.
fn append(texels: &mut Vec<[u8; 4]>, rows: &[u8], (colour, depth): (ColorType, BitDepth), store: Store<'_>) {
    let samples = colour.samples();
    match depth {
        BitDepth::Sixteen => {
            let pixels = rows.chunks_exact(2 * samples);
            texels.extend(pixels.map(|pixel| {
                let mut values = [0; 4];
                for (value, bytes) in values.iter_mut().zip(pixel.as_chunks().0) {
                    *value = u16::from_be_bytes(*bytes);
                }
                store(rgba(colour, values, u16::MAX))
            }));
        }
        // `EXPAND` leaves no depth below 8 bits.
        _ => texels.extend(rows.chunks_exact(samples).map(|pixel| {
            let mut values = [0; 4];
            values.iter_mut().zip(pixel).for_each(|(value, &sample)| *value = sample);
            rgba(colour, values, u8::MAX)
        })),
    }
}

/// Rounds a 16-bit value to the nearest 8-bit one.
fn to_8_bits(value: u16) -> u8 {
    ((u32::from(value) * 255 + 32_767) / 65_535) as u8
}

fn rgba<T: Copy>(colour: ColorType, [a, b, c, d]: [T; 4], opaque: T) -> [T; 4] {
    match colour {
        ColorType::Grayscale => [a, a, a, opaque],
        ColorType::GrayscaleAlpha => [a, a, a, b],
        ColorType::Rgb => [a, b, c, opaque],
        // `EXPAND` leaves no indexed colour.
        ColorType::Rgba | ColorType::Indexed => [a, b, c, d],
    }
}

#[cfg(test)]
mod tests;
