//! Fuzzing of textures: PNG, JPEG, WebP and KTX2 files in an otherwise valid scene.

use std::path::PathBuf;

use photoncard_driver::scene::gltf::{self, LoadSettings};
use tempfile::TempDir;

use super::gltf::glb;
use super::random::Random;
use super::target::{Target, bound, write_anew};
use super::{mutation, png};

/// Target for textures. An input is an image file.
pub(super) struct Textures {
    seeds: Vec<Vec<u8>>,
    folder: TempDir,
}

/// Image files. The PNG files have several colour types, because no edit of a byte would add a palette.
const SEEDS: [&[u8]; 14] = [
    include_bytes!("../../../driver/scene/tests/it/images/texel.png"),
    include_bytes!("../../../driver/scene/tests/it/images/palette.png"),
    include_bytes!("../../../driver/scene/tests/it/images/deep.png"),
    include_bytes!("../../../driver/scene/tests/it/images/interlaced.png"),
    include_bytes!("../../../driver/scene/tests/it/images/colour.jpg"),
    include_bytes!("../../../driver/scene/tests/it/images/progressive.jpg"),
    include_bytes!("../../../driver/scene/tests/it/images/grey.jpg"),
    include_bytes!("../../../driver/scene/tests/it/images/lossy.webp"),
    include_bytes!("../../../driver/scene/tests/it/images/lossless.webp"),
    include_bytes!("../../../driver/scene/tests/it/images/alpha.webp"),
    include_bytes!("../../../driver/scene/tests/it/images/etc1s.ktx2"),
    include_bytes!("../../../driver/scene/tests/it/images/etc1s-alpha.ktx2"),
    include_bytes!("../../../driver/scene/tests/it/images/uastc.ktx2"),
    include_bytes!("../../../driver/scene/tests/it/images/uastc-zstd.ktx2"),
];

/// Memory of the card, bytes. It limits the number of texels, because a texel of WebP, or of KTX2 with ETC1S,
/// may take no bytes of the file.
const DRAM_BYTES: u64 = 2 << 20;

/// glTF of a triangle whose base colour is the image in the second buffer view, of `image_bytes` bytes.
fn scene(image_bytes: usize) -> String {
    let length = TRIANGLE_BYTES + image_bytes;
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "material": 0}}]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
        "textures": [{{"source": 0}}], "images": [{{"bufferView": 1}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}},
                      {{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": {TRIANGLE_BYTES}}},
                        {{"buffer": 0, "byteOffset": {TRIANGLE_BYTES}, "byteLength": {image_bytes}}}],
        "buffers": [{{"byteLength": {length}}}]}}"#
    )
}

const TRIANGLE_BYTES: usize = 36;

/// GLB of a triangle whose base colour is an image file.
pub(crate) fn textured(image: &[u8]) -> Vec<u8> {
    let triangle = [0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    let bytes = [triangle.as_flattened(), image].concat();
    glb(scene(image.len()).as_bytes(), &bytes)
}

impl Textures {
    pub(super) fn new() -> Self {
        let seeds = SEEDS.map(<[u8]>::to_vec).to_vec();
        Self { seeds, folder: tempfile::tempdir().expect("there is room for a folder") }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("scene.glb")
    }
}

impl Target for Textures {
    fn name(&self) -> &'static str {
        "textures"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        // Deflate expands a byte to at most 1032, each of them up to eight texels of one bit. Decoding
        // allocates at most 17 bytes a texel.
        bound(input, 1032 * 8 * 17)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut file = random.pick(&self.seeds).clone();
        if file.starts_with(png::MAGIC) && random.once_in(2) {
            (0..random.edits()).for_each(|_| png::edit_chunks(&mut file, random));
            return file;
        }
        mutation::edit(&mut file, &self.seeds, random);
        if file.starts_with(png::MAGIC) && !random.once_in(8) {
            png::mend_checksums(&mut file);
        }
        file
    }

    fn read(&self, input: &[u8]) -> bool {
        write_anew(&self.path(), &textured(input));
        let settings = LoadSettings { dram_bytes: DRAM_BYTES, ..LoadSettings::default() };
        match gltf::load_with(&self.path(), &settings) {
            Ok(scene) => match &scene.images[..] {
                [image] => {
                    assert_eq!(image.texels.len(), image.width as usize * image.height as usize);
                    true
                }
                _ => {
                    assert!(
                        scene.notices.iter().any(|notice| notice.contains("left out")),
                        "{:?}",
                        scene.notices
                    );
                    false
                }
            },
            Err(error) => {
                let _ = error.to_string();
                false
            }
        }
    }
}
