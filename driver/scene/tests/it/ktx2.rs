//! Textures in KTX2 (`KHR_texture_basisu`) equal the output of the reference transcoder. Files that are no
//! picture in one of the extension's two formats are left out.
//!
//! The files in `images` were encoded by Basis Universal 2.5 (ktx2-encoder 0.6 of npm).

use photoncard_scene::Image;
use proptest::prelude::*;
use serde_json::json;

use crate::support::{check_left_out, embedded, push};

/// File with the texels (10 x, 16 y, 200 - 8 x), and mipmaps.
const ETC1S: &[u8] = include_bytes!("images/etc1s.ktx2");
/// File with an alpha of 255 - 5 y.
const ETC1S_ALPHA: &[u8] = include_bytes!("images/etc1s-alpha.ktx2");
/// File of 22 x 13 texels.
const UASTC: &[u8] = include_bytes!("images/uastc.ktx2");
/// File with an alpha of 255 - 5 y, and mipmaps.
const UASTC_ZSTANDARD: &[u8] = include_bytes!("images/uastc-zstd.ktx2");

/// Positions of header fields, bytes.
const VK_FORMAT: usize = 12;
const WIDTH: usize = 20;
const HEIGHT: usize = 24;
const DEPTH: usize = 28;
const LAYERS: usize = 32;
const FACES: usize = 36;
const LEVELS: usize = 40;
const SCHEME: usize = 44;
const DESCRIPTOR_OFFSET: usize = 48;
const METADATA_OFFSET: usize = 56;
const GLOBAL_OFFSET: usize = 64;
const GLOBAL_LENGTH: usize = 72;
const LEVEL_OFFSET: usize = 80;
const LEVEL_LENGTH: usize = 88;
const PLAIN_LENGTH: usize = 96;

fn word(file: &[u8], at: usize) -> usize {
    u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize
}

/// Copy of the file with other bytes at position `at`.
fn changed(file: &[u8], at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut file = file.to_vec();
    file[at..at + bytes.len()].copy_from_slice(bytes);
    file
}

/// FNV-1a of texels.
fn checksum(image: &Image) -> u64 {
    let bytes = image.texels.as_flattened();
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |sum, &byte| (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

fn loaded(file: &[u8]) -> Image {
    embedded(file, "image/ktx2").load().unwrap().images.remove(0)
}

fn check_refused(file: &[u8], part: &str) {
    check_left_out(&embedded(file, "image/ktx2").load().unwrap(), &[part]);
}

/// Texels equal those of the reference transcoder, and are close to the encoded picture.
#[test]
fn both_codecs_are_decoded() {
    let cases = [
        (ETC1S, [24, 16], 0, 27, 0xd87b_a605_6bc5_08c7),
        (ETC1S_ALPHA, [24, 16], 5, 27, 0xe0e6_131d_971c_d73f),
        (UASTC, [22, 13], 0, 1, 0xd16f_1a85_2360_0110),
        (UASTC_ZSTANDARD, [24, 16], 5, 11, 0xf60d_d06d_138c_3c91),
    ];
    for (file, size, rows, error, reference) in cases {
        let image = loaded(file);
        assert_eq!([image.width, image.height], size);
        for (index, texel) in image.texels.iter().enumerate() {
            let (x, y) = (index as i32 % size[0] as i32, index as i32 / size[0] as i32);
            let expected = [10 * x, 16 * y, 200 - 8 * x, 255 - rows * y];
            let errors = texel.iter().zip(expected).map(|(&found, e)| (i32::from(found) - e).abs());
            assert!(errors.max() <= Some(error), "{texel:?} is not {expected:?}");
        }
        assert_eq!(checksum(&image), reference);
    }
}

/// The extension may be required. Its image is used only if the texture has no other.
#[test]
fn a_textures_own_image_precedes_that_of_the_extension() {
    let mut scene = embedded(UASTC, "image/ktx2");
    scene.json["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    scene.json["textures"] = json!([{"extensions": {"KHR_texture_basisu": {"source": 0}}}]);
    assert_eq!(scene.load().unwrap().images, [loaded(UASTC)]);
    let view = scene.view(include_bytes!("images/texel.png"));
    let own = push(&mut scene.json, "images", json!({"bufferView": view}));
    scene.json["textures"][0]["source"] = json!(own);
    assert_eq!(scene.load().unwrap().images[0].width, 1);
}

/// UASTC file whose blocks have one colour each, in rows from the top. `level` is the content of level 0.
fn file(size: [u32; 2], level: &[u8]) -> Vec<u8> {
    let descriptor = word(UASTC, DESCRIPTOR_OFFSET);
    let mut file = UASTC[..descriptor + 44].to_vec();
    let offset = file.len() as u64;
    for (at, value) in [(WIDTH, size[0]), (HEIGHT, size[1]), (METADATA_OFFSET, 0), (METADATA_OFFSET + 4, 0)] {
        file[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    for (at, value) in
        [(LEVEL_OFFSET, offset), (LEVEL_LENGTH, level.len() as u64), (PLAIN_LENGTH, level.len() as u64)]
    {
        file[at..at + 8].copy_from_slice(&value.to_le_bytes());
    }
    file.extend(level);
    file
}

/// UASTC block of one colour: the code of mode 8, the colour, and hints for transcoding.
fn block(colour: [u8; 4]) -> [u8; 16] {
    (0x17 | u128::from(u32::from_le_bytes(colour)) << 5).to_le_bytes()
}

/// [`file`] with level 0 in Zstandard: one frame of a single segment, with raw blocks of at most 2^17 bytes.
fn in_zstandard(size: [u32; 2], level: &[u8]) -> Vec<u8> {
    let mut frame = b"\x28\xb5\x2f\xfd\xa0".to_vec();
    frame.extend((level.len() as u32).to_le_bytes());
    let mut chunks = level.chunks(1 << 17).peekable();
    while let Some(chunk) = chunks.next() {
        let header = (chunk.len() as u32) << 3 | u32::from(chunks.peek().is_none());
        frame.extend(&header.to_le_bytes()[..3]);
        frame.extend(chunk);
    }
    let file = changed(&file(size, &frame), SCHEME, &[2]);
    changed(&file, PLAIN_LENGTH, &(level.len() as u64).to_le_bytes())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Checks sizes that are no multiples of four as well.
    #[test]
    fn blocks_of_one_colour_are_exact(
        (width, height) in (1..20_u32, 1..20_u32),
        colours in prop::collection::vec(any::<[u8; 4]>(), 25),
    ) {
        let columns = width.div_ceil(4);
        let blocks = &colours[..(columns * height.div_ceil(4)) as usize];
        let level: Vec<u8> = blocks.iter().flat_map(|colour| block(*colour)).collect();
        for file in [file([width, height], &level), in_zstandard([width, height], &level)] {
            let image = loaded(&file);
            prop_assert_eq!([image.width, image.height], [width, height]);
            for (index, texel) in (0..).zip(&image.texels) {
                let (x, y) = (index % width, index / width);
                prop_assert_eq!(*texel, blocks[(x / 4 + columns * (y / 4)) as usize]);
            }
        }
    }
}

#[test]
fn files_that_are_not_one_picture_of_the_two_formats_are_left_out() {
    let descriptor = word(UASTC, DESCRIPTOR_OFFSET);
    let (model, channel) = (descriptor + 12, descriptor + 31);
    let cases: [(usize, &[u8], &str); 12] = [
        (HEIGHT, &[0], "not one two-dimensional picture"),
        (DEPTH, &[1], "not one two-dimensional picture"),
        (LAYERS, &[2], "not one two-dimensional picture"),
        (FACES, &[6], "not one two-dimensional picture"),
        (VK_FORMAT, &[37], "the Vulkan format 37"),
        (model, &[167], "HDR"),
        (model, &[168], "HDR"),
        (model, &[162], "colour model 162"),
        (model, &[163], "supercompression scheme 0"),
        (SCHEME, &[3], "supercompression scheme 3"),
        (channel, &[5], "other channels"),
        (WIDTH, &[0], "no texels"),
    ];
    for (at, bytes, part) in cases {
        check_refused(&changed(UASTC, at, bytes), part);
    }
    check_refused(b"\xabKTX 11\xbb\r\n\x1a\n", "KTX 1");
    check_refused(b"sB\x13\0\x4d\0", ".basis");
}

/// The key/value data may state the orientation, a swizzle, or an animation.
#[test]
fn metadata_that_change_the_picture_are_refused() {
    let with = |entry: &[u8]| {
        let mut file = UASTC.to_vec();
        let offset = file.len() as u32;
        // The entry follows one whose length is not a multiple of four.
        for entry in [b"KTXwriter\0tests", entry] {
            file.extend((entry.len() as u32).to_le_bytes());
            file.extend(entry);
            file.resize(file.len().next_multiple_of(4), 0);
        }
        let length = file.len() as u32 - offset;
        let file = changed(&file, METADATA_OFFSET, &offset.to_le_bytes());
        changed(&file, METADATA_OFFSET + 4, &length.to_le_bytes())
    };
    for entry in
        [&b"KTXorientation\0rd\0"[..], b"KTXorientation\0rd", b"KTXswizzle\0rgba\0", b"KTXswizzled\0a"]
    {
        assert_eq!(loaded(&with(entry)), loaded(UASTC));
    }
    check_refused(&with(b"KTXorientation\0ru\0"), "KTXorientation is not 'rd'");
    check_refused(&with(b"KTXswizzle\0rrr1\0"), "KTXswizzle is not 'rgba'");
    check_refused(&with(b"KTXanimData\0............"), "video");
}

/// Changes sizes, lengths and offsets of a header so that they contradict the file or exceed a limit.
#[test]
fn headers_that_contradict_the_file_are_refused() {
    for length in [12, 40, 103, 130, 200, UASTC.len() - 1] {
        check_refused(&UASTC[..length], "cannot be decoded");
    }
    for at in [DESCRIPTOR_OFFSET, METADATA_OFFSET, METADATA_OFFSET + 4, LEVEL_OFFSET, LEVEL_LENGTH] {
        check_refused(&changed(UASTC, at, &[0xff; 4]), "beyond its end");
    }
    check_refused(&changed(UASTC, LEVEL_OFFSET, &[0xff; 16]), "beyond its end");
    check_refused(&changed(UASTC, DESCRIPTOR_OFFSET + 4, &[12]), "descriptor is cut off");
    check_refused(&changed(UASTC, WIDTH, &[26]), "bytes instead of");
    check_refused(&changed(UASTC, WIDTH, &[0, 1]), "256 x 13 texels do not fit");
    check_refused(&changed(UASTC_ZSTANDARD, WIDTH, &[28]), "384 bytes instead of 448");
    check_refused(&changed(UASTC_ZSTANDARD, WIDTH, &[0, 0x30, 0]), "bytes instead of");
    check_refused(&changed(UASTC_ZSTANDARD, PLAIN_LENGTH, &[0xff; 8]), "bytes instead of 384");
    let error = embedded(&changed(ETC1S, HEIGHT, &[1, 64]), "image/ktx2").load().unwrap_err().to_string();
    assert!(error.contains("24 x 16385 texels, more than 16384"), "{error}");
    check_refused(&ETC1S[..ETC1S.len() - 40], "beyond its end");
}

#[test]
fn codebooks_that_contradict_their_lengths_are_refused() {
    let global = word(ETC1S, GLOBAL_OFFSET);
    check_refused(&changed(ETC1S, GLOBAL_OFFSET, &[0xff; 8]), "beyond its end");
    check_refused(&changed(ETC1S, GLOBAL_LENGTH, &[30, 0]), "codebooks are cut off");
    for (at, bytes) in [(LEVELS, &[4][..]), (GLOBAL_LENGTH, &[41, 0]), (global + 4, &[0xff; 12])] {
        check_refused(&changed(ETC1S, at, bytes), "codebooks contradict");
    }
    check_refused(&changed(ETC1S, global + 28, &[0]), "level 0 is empty");
    // Codebooks without colours, and pictures that lie beyond the file.
    check_refused(&changed(ETC1S, global, &[0, 0]), "blocks are invalid");
    check_refused(&changed(ETC1S, global + 24, &[0xff; 4]), "blocks are invalid");
}

/// Tries frames that expand to more or less than the texels take, and frames with too large a window.
#[test]
fn zstandard_is_bounded_by_the_size() {
    let blocks = [block([1, 2, 3, 4]); 6].concat();
    assert_eq!(loaded(&in_zstandard([12, 8], &blocks)).texels, [[1, 2, 3, 4]; 96]);
    let stated = |frame: &[u8]| {
        let file = changed(&file([12, 8], frame), SCHEME, &[2]);
        changed(&file, PLAIN_LENGTH, &96_u64.to_le_bytes())
    };
    // A window of 2^k bytes, and blocks that repeat a byte 2^17 times.
    let frame = |window: u8, blocks: usize| {
        let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0, (window - 10) << 3];
        (0..blocks).for_each(|_| frame.extend([0x02, 0x00, 0x10, 0x17]));
        frame.extend([1, 0, 0]);
        frame
    };
    check_refused(&stated(&frame(17, 1)), "cannot be decoded");
    check_refused(&stated(&frame(23, 20_000)), "cannot be decoded");
    check_refused(&stated(&frame(24, 0)), "cannot be decoded");
    check_refused(&stated(&frame(41, 20_000)), "cannot be decoded");
    check_refused(&stated(&frame(17, 0)), "0 bytes instead of 96");
    check_refused(&stated(b"no frame"), "cannot be decoded");
}
