//! Inputs: damaged copies of real files.

use std::fs;
use std::path::Path;

use super::Kind;
use crate::fuzz::{Random, environment, gltf, mutation, picture, png, texture};

/// Maximum length of the range that one edit changes, bytes.
const WINDOW: usize = 1 << 12;

/// Undamaged file, by suffix and bytes.
struct Seed {
    extension: String,
    bytes: Vec<u8>,
}

/// Undamaged files of one kind, from which inputs are made.
pub struct Inputs {
    kind: Kind,
    seeds: Vec<Seed>,
}

const SCENES: [&str; 14] = [
    "scenes/cornell.gltf",
    "scenes/cornell-glossy.gltf",
    "scenes/cornell-uplight.gltf",
    "scenes/furnace.gltf",
    "host-cli/tests/scenes/painted.gltf",
    "scenes/room.glb",
    "scenes/roughness.glb",
    "scenes/cornell-spheres.glb",
    "scenes/cornell-moving.glb",
    "scenes/atrium.glb",
    "driver/scene/tests/it/compressed/meshopt-0.glb",
    "driver/scene/tests/it/compressed/meshopt-1.glb",
    "driver/scene/tests/it/compressed/draco-edgebreaker.glb",
    "driver/scene/tests/it/compressed/draco-sequential.glb",
];

const IMAGES: [&str; 18] = [
    "driver/scene/tests/it/images/texel.png",
    "driver/scene/tests/it/images/palette.png",
    "driver/scene/tests/it/images/deep.png",
    "driver/scene/tests/it/images/interlaced.png",
    "docs/atrium.png",
    "driver/scene/tests/it/images/colour.jpg",
    "driver/scene/tests/it/images/progressive.jpg",
    "driver/scene/tests/it/images/grey.jpg",
    "driver/scene/tests/it/images/cmyk.jpg",
    "driver/scene/tests/it/images/lossy.webp",
    "driver/scene/tests/it/images/lossless.webp",
    "driver/scene/tests/it/images/alpha.webp",
    "driver/scene/tests/it/images/etc1s.ktx2",
    "driver/scene/tests/it/images/etc1s-alpha.ktx2",
    "driver/scene/tests/it/images/uastc.ktx2",
    "driver/scene/tests/it/images/uastc-zstd.ktx2",
    "scenes/sky.exr",
    "tests/references/cornell-spheres-caustics.exr",
];

impl Inputs {
    /// Reads files of the repository, and generates pictures. There are no inputs of [kept](Kind::Kept)
    /// files.
    ///
    /// # Panics
    /// If a file is missing.
    pub fn new(kind: Kind) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let shipped = |name: &&str| Seed {
            extension: name.rsplit('.').next().unwrap_or_default().to_owned(),
            bytes: fs::read(root.join(name)).expect("the file ships"),
        };
        let mut seeds: Vec<_> = match kind {
            Kind::Images => IMAGES.iter().map(shipped).collect(),
            Kind::Scenes => SCENES.iter().map(shipped).collect(),
            Kind::Kept(_) => Vec::new(),
        };
        if kind == Kind::Images {
            let of = |extension: &str, files: Vec<Vec<u8>>| {
                let extension = extension.to_owned();
                files.into_iter().map(move |bytes| Seed { extension: extension.clone(), bytes })
            };
            seeds.extend(of("hdr", environment::pictures()));
            seeds.extend(of("exr", picture::pictures()));
        } else if kind == Kind::Scenes {
            seeds.push(Seed { extension: "gltf".to_owned(), bytes: gltf::rich() });
        }
        Self { kind, seeds }
    }

    /// Makes input `number`: the suffix of its file, and its bytes.
    pub fn make(&self, seed: u64, number: u64) -> (&str, Vec<u8>) {
        let mut random = Random::new(self.kind.name(), seed, number);
        let chosen = random.pick(&self.seeds);
        let mut bytes = chosen.bytes.clone();
        for _ in 0..random.edits() {
            self.edit(&mut bytes, &chosen.extension, &mut random);
        }
        (&chosen.extension, bytes)
    }

    /// Makes one edit. Half of the edits keep to the structure of the format, such as chunks of PNG.
    fn edit(&self, bytes: &mut Vec<u8>, extension: &str, random: &mut Random) {
        match (random.below(8), extension) {
            (0..=3, "png") => png::edit_chunks(bytes, random),
            (4, "png") => {
                edit_window(bytes, random);
                png::mend_checksums(bytes);
            }
            (0..=4, "gltf") => mutation::edit_json(bytes, random),
            (0..=4, "glb") => edit_glb(bytes, random),
            (0..=3, "exr" | "hdr" | "jpg" | "webp" | "ktx2") => edit_header(bytes, random),
            (5, _) => self.splice(bytes, extension, random),
            (6, _) if random.once_in(4) => bytes.truncate(random.below(bytes.len())),
            _ => edit_window(bytes, random),
        }
    }

    /// Replaces a range of the file by a range of another file of its format.
    fn splice(&self, bytes: &mut Vec<u8>, extension: &str, random: &mut Random) {
        let others: Vec<_> = self.seeds.iter().filter(|seed| seed.extension == extension).collect();
        let other = &random.pick(&others).bytes;
        let [from, to] = [random.below(other.len()), random.below(bytes.len())];
        let length = random.below(other.len() - from + 1);
        let end = if random.once_in(2) { bytes.len() } else { (to + length).min(bytes.len()) };
        bytes.splice(to..end, other[from..from + length].iter().copied());
    }
}

/// File that is read for an input, with its suffix: a texture is embedded in a scene.
pub(super) fn as_file(extension: &str, bytes: Vec<u8>) -> (&str, Vec<u8>) {
    match extension {
        "png" | "jpg" | "webp" | "ktx2" => ("glb", texture::textured(&bytes)),
        _ => (extension, bytes),
    }
}

/// Edits a range of a file; the length may change.
pub(super) fn edit_window(bytes: &mut Vec<u8>, random: &mut Random) {
    let start = random.below(bytes.len());
    let end = (start + WINDOW).min(bytes.len());
    let mut window = bytes[start..end].to_vec();
    mutation::edit_bytes(&mut window, &[], random);
    bytes.splice(start..end, window);
}

/// Edits a word, a bit or a byte in the first 600 bytes, where sizes and counts are.
fn edit_header(bytes: &mut [u8], random: &mut Random) {
    let place = random.below(bytes.len().min(600));
    match random.below(3) {
        0 => mutation::put_word(bytes, place, random),
        1 if !bytes.is_empty() => bytes[place] ^= 1 << random.below(8),
        _ if !bytes.is_empty() => bytes[place] = random.next() as u8,
        _ => {}
    }
}

/// Edits the JSON or the binary chunk of a GLB, and states the new lengths in its headers.
fn edit_glb(bytes: &mut Vec<u8>, random: &mut Random) {
    let Some((mut text, mut data)) = gltf::split_glb(bytes) else { return };
    if random.below(4) < 3 {
        mutation::edit_json(&mut text, random);
    } else {
        edit_window(&mut data, random);
    }
    *bytes = gltf::glb(&text, &data);
}
