//! PNG.

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, Transformations};

use super::Fault;

pub(super) const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// A byte of Deflate stands for 1032 at most; a byte of texels for 8 at most, of one bit each.
const TEXELS_OF_A_BYTE: u64 = 1032 * 8;

/// What the decoder may hold besides rows: chunks of text or colour profiles.
const ANCILLARY_BYTES: usize = 16 << 20;

/// Bytes of 256 entries of a palette.
const MAX_PALETTE: usize = 3 * 256;

/// Bytes after the data of a chunk.
const CHECKSUM: usize = 4;

fn decoder(bytes: &[u8]) -> Decoder<Cursor<&[u8]>> {
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    // Palettes, transparent colours and less than 8 bits become channels of 8 bits; 16 bits stay.
    decoder.set_transformations(Transformations::EXPAND);
    decoder
}

/// Width and height, and the most texels that a file of this length can hold.
pub(super) fn size(bytes: &[u8]) -> Result<([u32; 2], u64), Fault> {
    let mut decoder = decoder(bytes);
    let info = decoder.read_header_info().map_err(Fault::damaged)?;
    if info.color_type == ColorType::Indexed {
        check_palette(bytes)?;
    }
    Ok(([info.width, info.height], TEXELS_OF_A_BYTE * bytes.len() as u64))
}

/// Refuses a palette of other than 1 to 256 entries of three bytes, which the decoder indexes beyond
/// (image-rs/image-png issue 682).
fn check_palette(bytes: &[u8]) -> Result<(), Fault> {
    let palette = chunks(bytes).take_while(|(kind, _)| kind != b"IDAT").find(|(kind, _)| kind == b"PLTE");
    match palette {
        Some((_, length)) if !(3..=MAX_PALETTE).contains(&length) || !length.is_multiple_of(3) => {
            Err(Fault::damaged(format!("a palette of {length} bytes is not one of 1 to 256 colours")))
        }
        // The decoder refuses an image without its palette.
        _ => Ok(()),
    }
}

/// The type and the stated length of each chunk.
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

pub(super) fn decode(bytes: &[u8], [width, height]: [u32; 2]) -> Result<Vec<[u8; 4]>, Fault> {
    let mut decoder = decoder(bytes);
    // A row before and after its filter, each of up to eight bytes a texel.
    decoder.set_limits(png::Limits { bytes: ANCILLARY_BYTES + 64 * width as usize });
    let mut reader = decoder.read_info().map_err(Fault::damaged)?;
    let mut texels = Vec::new();
    texels.try_reserve_exact(width as usize * height as usize).map_err(Fault::damaged)?;
    if reader.info().interlaced {
        let mut rows = vec![0; reader.output_buffer_size().ok_or_else(|| Fault::damaged("it is too large"))?];
        reader.next_frame(&mut rows).map_err(Fault::damaged)?;
        append(&mut texels, &rows, reader.output_color_type());
    } else {
        let format = reader.output_color_type();
        while let Some(row) = reader.next_row().map_err(Fault::damaged)? {
            append(&mut texels, row.data(), format);
        }
    }
    Ok(texels)
}

/// Appends rows as the reader's transformations have left them.
fn append(texels: &mut Vec<[u8; 4]>, rows: &[u8], (colour, depth): (ColorType, BitDepth)) {
    let samples = colour.samples();
    match depth {
        BitDepth::Sixteen => {
            let pixels = rows.chunks_exact(2 * samples);
            texels.extend(pixels.map(|pixel| {
                let mut rounded = [0; 4];
                for (value, bytes) in rounded.iter_mut().zip(pixel.as_chunks().0) {
                    *value = to_8_bits(u16::from_be_bytes(*bytes));
                }
                rgba(colour, rounded)
            }));
        }
        // `EXPAND` leaves nothing below 8 bits.
        _ => texels.extend(rows.chunks_exact(samples).map(|pixel| {
            let mut values = [0; 4];
            values.iter_mut().zip(pixel).for_each(|(value, &sample)| *value = sample);
            rgba(colour, values)
        })),
    }
}

/// The nearest of 8 bits.
fn to_8_bits(value: u16) -> u8 {
    ((u32::from(value) * 255 + 32_767) / 65_535) as u8
}

fn rgba(colour: ColorType, [a, b, c, d]: [u8; 4]) -> [u8; 4] {
    match colour {
        ColorType::Grayscale => [a, a, a, 255],
        ColorType::GrayscaleAlpha => [a, a, a, b],
        ColorType::Rgb => [a, b, c, 255],
        // `EXPAND` leaves no index.
        ColorType::Rgba | ColorType::Indexed => [a, b, c, d],
    }
}

#[cfg(test)]
mod tests {
    use png::{Compression, Encoder};

    use super::super::Kind;
    use super::*;

    fn file(
        size: [u32; 2],
        colour: ColorType,
        depth: BitDepth,
        data: &[u8],
        palette: Option<&[u8]>,
    ) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.set_compression(Compression::Fast);
        if let Some(palette) = palette {
            encoder.set_palette(palette.to_vec());
            encoder.set_trns(vec![255, 128]);
        }
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    fn decoded(bytes: &[u8]) -> Vec<[u8; 4]> {
        let kind = Kind::of(bytes).unwrap();
        kind.decode(bytes, kind.size(bytes).unwrap()).unwrap()
    }

    #[test]
    fn every_colour_type_becomes_rgba() {
        use BitDepth::{Eight, One, Sixteen};
        let palette = [10, 20, 30, 40, 50, 60];
        type Case<'a> = (ColorType, BitDepth, &'a [u8], Option<&'a [u8]>, [[u8; 4]; 2]);
        let cases: [Case<'_>; 8] = [
            (ColorType::Grayscale, Eight, &[1, 2], None, [[1, 1, 1, 255], [2, 2, 2, 255]]),
            (ColorType::Grayscale, One, &[0x40], None, [[0, 0, 0, 255], [255; 4]]),
            (ColorType::GrayscaleAlpha, Eight, &[1, 2, 3, 4], None, [[1, 1, 1, 2], [3, 3, 3, 4]]),
            (ColorType::Rgb, Eight, &[1, 2, 3, 4, 5, 6], None, [[1, 2, 3, 255], [4, 5, 6, 255]]),
            (ColorType::Rgba, Eight, &[1, 2, 3, 4, 5, 6, 7, 8], None, [[1, 2, 3, 4], [5, 6, 7, 8]]),
            (ColorType::Indexed, Eight, &[1, 0], Some(&palette), [[40, 50, 60, 128], [10, 20, 30, 255]]),
            (ColorType::Grayscale, Sixteen, &[0, 128, 0xff, 0x7f], None, [[0, 0, 0, 255], [255; 4]]),
            (
                ColorType::GrayscaleAlpha,
                Sixteen,
                &[0, 129, 0x80, 0x80, 0x7f, 0xff, 0, 0],
                None,
                [[1, 1, 1, 128], [127, 127, 127, 0]],
            ),
        ];
        for (colour, depth, data, palette, expected) in cases {
            assert_eq!(
                decoded(&file([2, 1], colour, depth, data, palette)),
                expected,
                "{colour:?} {depth:?}"
            );
        }
    }

    #[test]
    fn sixteen_bits_are_rounded_to_the_nearest_of_eight() {
        for value in 0..=u16::MAX {
            let exact = f64::from(value) * 255.0 / 65_535.0;
            assert!((f64::from(to_8_bits(value)) - exact).abs() <= 0.5, "{value}");
        }
    }

    /// Adam7: one texel a pass would be read in another order.
    #[test]
    fn interlaced_rows_come_in_order() {
        const INTERLACED: &[u8] = &[
            0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 0x0d, 0x49, 0x48, 0x44, 0x52, 0, 0, 0,
            2, 0, 0, 0, 2, 8, 0, 0, 0, 1,
        ];
        let mut bytes = INTERLACED.to_vec();
        bytes.extend(crc32(&INTERLACED[12..]).to_be_bytes());
        // Passes 1, 6 and 7 of a picture of 2 x 2 texels, each row behind its filter, stored as it is.
        let rows = [0, 1, 0, 2, 0, 3, 4];
        let mut stream = vec![0x78, 0x01, 0x01, rows.len() as u8, 0, !(rows.len() as u8), 0xff];
        stream.extend(rows);
        stream.extend(adler32(&rows).to_be_bytes());
        for (kind, data) in [(b"IDAT", &stream[..]), (b"IEND", &[])] {
            bytes.extend((data.len() as u32).to_be_bytes());
            let chunk = [&kind[..], data].concat();
            bytes.extend(&chunk);
            bytes.extend(crc32(&chunk).to_be_bytes());
        }
        assert_eq!(decoded(&bytes), [1, 2, 3, 4].map(|value| [value, value, value, 255]));
    }

    /// A file of one texel with a palette of so many bytes.
    fn of_palette(length: usize) -> Vec<u8> {
        let mut file = MAGIC.to_vec();
        let header = [0, 0, 0, 1, 0, 0, 0, 1, 8, 3, 0, 0, 0];
        let row = [0x78, 0x01, 0x01, 2, 0, 0xfd, 0xff, 0, 0, 0, 2, 0, 1];
        for (kind, data) in
            [(b"IHDR", &header[..]), (b"PLTE", &vec![9; length]), (b"IDAT", &row), (b"IEND", &[])]
        {
            let chunk = [&kind[..], data].concat();
            file.extend((data.len() as u32).to_be_bytes());
            file.extend(&chunk);
            file.extend(crc32(&chunk).to_be_bytes());
        }
        file
    }

    #[test]
    fn palettes_of_whole_colours_are_read_and_others_refused() {
        for length in 0..800 {
            let file = of_palette(length);
            let read = Kind::Png.size(&file).and_then(|size| decode(&file, size));
            if (3..=768).contains(&length) && length % 3 == 0 {
                assert_eq!(read, Ok(vec![[9, 9, 9, 255]]), "{length}");
            } else {
                let fault = read.unwrap_err();
                assert!(fault.reason.contains(&format!("palette of {length} bytes")), "{length}: {fault:?}");
            }
        }
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |sum, &byte| {
            (0..8).fold(sum ^ u32::from(byte), |sum, _| (sum >> 1) ^ ((sum & 1) * 0xedb8_8320))
        })
    }

    fn adler32(bytes: &[u8]) -> u32 {
        let (a, b) = bytes.iter().fold((1, 0), |(a, b), &byte| {
            let a = (a + u32::from(byte)) % 65_521;
            (a, (b + a) % 65_521)
        });
        b << 16 | a
    }

    #[test]
    fn cut_files_and_false_sizes_are_refused() {
        let whole = file([4, 4], ColorType::Rgba, BitDepth::Eight, &[7; 64], None);
        for length in 8..whole.len() - 12 {
            let bytes = &whole[..length];
            let result = Kind::Png.size(bytes).and_then(|size| Kind::Png.decode(bytes, size));
            assert!(result.is_err(), "{length}");
        }
        // The header's checksum is right, and 16384 x 16384 texels are in reach of no file of this length.
        let mut large = whole;
        large[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
        let sum = crc32(&large[12..29]);
        large[29..33].copy_from_slice(&sum.to_be_bytes());
        let fault = Kind::Png.size(&large).unwrap_err();
        assert!(fault.reason.contains("do not fit into"), "{fault:?}");
    }
}
