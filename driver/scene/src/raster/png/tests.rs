//! Decodes PNG files of every colour type, and damaged ones.

use png::{Compression, Encoder};

use super::super::Kind;
use super::*;

fn file(size: [u32; 2], colour: ColorType, depth: BitDepth, data: &[u8], palette: Option<&[u8]>) -> Vec<u8> {
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
    kind.decode(bytes, kind.size(bytes).unwrap(), None).unwrap()
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
        assert_eq!(decoded(&file([2, 1], colour, depth, data, palette)), expected, "{colour:?} {depth:?}");
    }
}

#[test]
fn sixteen_bits_are_rounded_to_the_nearest_of_eight() {
    for value in 0..=u16::MAX {
        let exact = f64::from(value) * 255.0 / 65_535.0;
        assert!((f64::from(to_8_bits(value)) - exact).abs() <= 0.5, "{value}");
    }
}

/// Decodes a picture of 2 x 2 texels, interlaced by Adam7.
#[test]
fn interlaced_rows_come_in_order() {
    const INTERLACED: &[u8] = &[
        0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 0x0d, 0x49, 0x48, 0x44, 0x52, 0, 0, 0, 2, 0,
        0, 0, 2, 8, 0, 0, 0, 1,
    ];
    let mut bytes = INTERLACED.to_vec();
    bytes.extend(crc32(&INTERLACED[12..]).to_be_bytes());
    // Passes 1, 6 and 7 of a picture of 2 x 2 texels; each row follows its filter byte, 0 for none.
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

/// File of one texel with a palette of `length` bytes.
fn of_palette(length: usize) -> Vec<u8> {
    let mut file = MAGIC.to_vec();
    let header = [0, 0, 0, 1, 0, 0, 0, 1, 8, 3, 0, 0, 0];
    let row = [0x78, 0x01, 0x01, 2, 0, 0xfd, 0xff, 0, 0, 0, 2, 0, 1];
    for (kind, data) in [(b"IHDR", &header[..]), (b"PLTE", &vec![9; length]), (b"IDAT", &row), (b"IEND", &[])]
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
        let read = Kind::Png.size(&file).and_then(|size| decode(&file, size, None));
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
        let result = Kind::Png.size(bytes).and_then(|size| Kind::Png.decode(bytes, size, None));
        assert!(result.is_err(), "{length}");
    }
    // The header's checksum is right, but no file of this length can hold 16384 x 16384 texels.
    let mut large = whole;
    large[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let sum = crc32(&large[12..29]);
    large[29..33].copy_from_slice(&sum.to_be_bytes());
    let fault = Kind::Png.size(&large).unwrap_err();
    assert!(fault.reason.contains("do not fit into"), "{fault:?}");
}
