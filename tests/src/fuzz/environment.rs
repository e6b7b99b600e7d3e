//! Fuzzing of environment maps in Radiance format; `picture` covers those in `OpenEXR`.

use std::path::PathBuf;

use photoncard_driver::scene::Environment;
use tempfile::TempDir;

use super::mutation;
use super::random::Random;
use super::target::{Target, bound, write_anew};

/// Target for environment maps.
pub(super) struct Environments {
    seeds: Vec<Vec<u8>>,
    folder: TempDir,
}

/// Width of the run-length encoded picture, pixels.
const WIDTH: u8 = 12;

/// Radiance pictures, one with plain and one with run-length encoded scanlines.
pub(crate) fn pictures() -> Vec<Vec<u8>> {
    let header = b"#?RADIANCE\nSOFTWARE=any\nEXPOSURE=2.0\nFORMAT=32-bit_rle_rgbe\n\n";
    let mut flat = [&header[..], b"-Y 2 +X 3\n"].concat();
    flat.extend((0..24).map(|byte| if byte % 4 == 3 { 128 } else { byte * 9 }));
    let mut encoded = [&header[..], b"+Y 3 -X 12\n"].concat();
    for row in 0..3 {
        encoded.extend([2, 2, 0, WIDTH]);
        for channel in 0..4 {
            // A scanline of a channel is a run of 8 bytes, and 4 literal bytes.
            encoded.extend([128 + WIDTH - 4, 120 + channel, 4, row, 2 * row, 3, 128]);
        }
    }
    vec![flat, encoded]
}

impl Environments {
    pub(super) fn new() -> Self {
        Self { seeds: pictures(), folder: tempfile::tempdir().expect("there is room for a folder") }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("sky.hdr")
    }
}

impl Target for Environments {
    fn name(&self) -> &'static str {
        "environments"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        // Two bytes encode up to 127 values of one of four channels; a texel takes twelve bytes.
        bound(input, 16 * 12)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut file = random.pick(&self.seeds).clone();
        mutation::edit(&mut file, &self.seeds, random);
        file
    }

    fn read(&self, input: &[u8]) -> bool {
        write_anew(&self.path(), input);
        match Environment::load(&self.path()) {
            Ok(map) => {
                assert_eq!(map.texels.len(), map.width as usize * map.height as usize);
                assert!(map.texels.iter().flatten().all(|radiance| radiance.is_finite() && *radiance >= 0.0));
                true
            }
            Err(error) => {
                let _ = error.to_string();
                false
            }
        }
    }
}
