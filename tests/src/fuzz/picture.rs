//! Fuzzing of `OpenEXR` pictures of every compression, which are read and compared.

use std::io::Cursor;
use std::path::PathBuf;

use exr::image::Blocks;
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, LayerAttributes, LineOrder, Vec2,
    WritableImage, f16,
};
use photoncard_driver::difference::compare;
use photoncard_driver::exr::{Shown, read};
use tempfile::TempDir;

use super::mutation;
use super::random::Random;
use super::target::{Target, bound, write_anew};

/// Width and height of the pictures, pixels.
const SIZE: [usize; 2] = [20, 36];
/// Maximum number of pixels of a picture that is compared; a larger one is only read.
const MAX_COMPARED: usize = 1 << 16;

/// Target for pictures.
pub(super) struct Pictures {
    seeds: Vec<Vec<u8>>,
    folder: TempDir,
}

fn picture(compression: Compression, blocks: Blocks, is_half: bool) -> Option<Vec<u8>> {
    let [width, height] = SIZE;
    let values = |phase: usize| (0..width * height).map(move |i| ((i + phase) * 7 % 64) as f32 / 16.0);
    let channels = ["R", "G", "B", "Z"].into_iter().enumerate().map(|(phase, name)| {
        let samples = if is_half {
            FlatSamples::F16(values(phase).map(f16::from_f32).collect())
        } else {
            FlatSamples::F32(values(phase).collect())
        };
        AnyChannel::new(name, samples)
    });
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    let channels = AnyChannels::sort(channels.collect());
    let layer = exr::prelude::Layer::new(Vec2(width, height), LayerAttributes::default(), encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).ok()?;
    Some(bytes.into_inner())
}

/// Pictures with each compression that the encoder has, in scanlines and in tiles.
pub(crate) fn pictures() -> Vec<Vec<u8>> {
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
        Compression::DWAA(None),
        Compression::DWAB(None),
    ];
    let mut seeds = Vec::new();
    for compression in compressions {
        for (blocks, is_half) in
            [(Blocks::ScanLines, true), (Blocks::ScanLines, false), (Blocks::Tiles(Vec2(8, 8)), true)]
        {
            seeds.extend(picture(compression, blocks, is_half));
        }
    }
    seeds
}

impl Pictures {
    pub(super) fn new() -> Self {
        Self { seeds: pictures(), folder: tempfile::tempdir().expect("there is room for a folder") }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("picture.exr")
    }
}

impl Target for Pictures {
    fn name(&self) -> &'static str {
        "exr"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        // Deflate expands a byte to at most 1032. Halves of three channels are read as floats, of twice the
        // size, and three blocks are decoded at once.
        bound(input, 8192)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut file = random.pick(&self.seeds).clone();
        // Half of the edits are in the header: it is short, but all else depends on it.
        let header = 400.min(file.len());
        for _ in 0..random.edits() {
            let place = random.below(header);
            match random.below(4) {
                0 => mutation::put_word(&mut file, place, random),
                1 => file[place] ^= 1 << random.below(8),
                _ => mutation::edit_bytes(&mut file, &self.seeds, random),
            }
            if file.len() < header {
                break;
            }
        }
        file
    }

    fn read(&self, input: &[u8]) -> bool {
        write_anew(&self.path(), input);
        let image = match read(&self.path(), Shown::Rendered) {
            Ok(image) => image,
            Err(error) => {
                let _ = error.to_string();
                return false;
            }
        };
        assert_eq!(image.pixels.len(), image.width * image.height);
        if image.pixels.len() <= MAX_COMPARED {
            let _ = compare(&image, &image, 8, Some(2.0));
        }
        true
    }
}
