//! Fuzzing of scenes: glTF as text and as GLB, which are loaded and packed.

use std::path::{Path, PathBuf};

use photoncard_driver::error::SceneError;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::scene::Scene;
use photoncard_driver::scene::gltf::{LoadSettings, Moment, SceneFile};
use tempfile::TempDir;

use super::mutation;
use super::random::Random;
use super::target::{Target, bound, write_anew};

/// Maximum number of triangles of a scene that is packed; a larger one is only loaded.
const MAX_PACKED: usize = 2000;

/// Target for scenes.
pub(super) struct Scenes {
    texts: Vec<Vec<u8>>,
    /// JSON and binary chunk of each scene in GLB form.
    binaries: Vec<(Vec<u8>, Vec<u8>)>,
    /// All scenes as whole files.
    files: Vec<Vec<u8>>,
    folder: TempDir,
}

/// Scene with every feature that the loader reads: a node hierarchy, sparse positions, normals, texture
/// coordinates, colours, a skin, instances, a strip, textures, a Phong lobe, glass, a specular-glossiness
/// material, variants, lights, an orthographic camera, animations, morph targets.
const RICH: &[u8] = include_bytes!("../../fuzz/rich.gltf");
const SHIPPED: [&[u8]; 3] = [
    include_bytes!("../../../scenes/furnace.gltf"),
    include_bytes!("../../../scenes/cornell.gltf"),
    include_bytes!("../../../scenes/cornell-glossy.gltf"),
];

/// Image files, which follow the triangle's data in the buffer, aligned to four bytes.
const PNG: &[u8] = include_bytes!("../../../driver/scene/tests/it/images/texel.png");
const JPEG: &[u8] = include_bytes!("../../../driver/scene/tests/it/images/grey.jpg");

/// Buffer of a triangle: vertices; indices; index and position of a sparse accessor; texture coordinates;
/// colours; joints; weights; a matrix; images; times, rotations and weights of keyframes.
fn triangle_bytes() -> Vec<u8> {
    let vertices = [0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    let indices = [0_u16, 1, 2, 1].map(u16::to_le_bytes);
    let replaced = [1.0_f32, 0.5, 0.0].map(f32::to_le_bytes);
    let coordinates = [0_f32, 0.0, 1.0, 0.0, 0.0, 1.0].map(f32::to_le_bytes);
    let colours = [[255_u8, 128, 0, 255], [0, 128, 255, 128], [9, 9, 9, 9]];
    let joints = [[0_u8, 1, 0, 0]; 3];
    let weights = [[255_u8, 0, 0, 0], [128, 127, 0, 0], [0, 255, 0, 0]];
    let mut matrix = [0_f32; 16];
    [0, 5, 10, 15].into_iter().for_each(|place| matrix[place] = 1.0);
    let matrix = matrix.map(f32::to_le_bytes);
    let mut bytes = [
        vertices.as_flattened(),
        indices.as_flattened(),
        replaced.as_flattened(),
        coordinates.as_flattened(),
        colours.as_flattened(),
        joints.as_flattened(),
        weights.as_flattened(),
        matrix.as_flattened(),
        matrix.as_flattened(),
    ]
    .concat();
    for image in [PNG, JPEG] {
        bytes.extend(image);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    let keyframes =
        [[0.25_f32, 1.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.6], [0.0, 0.8, 0.0, 1.0], [0.0, 0.5, 0.25, 0.0]];
    bytes.extend(keyframes.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// glTF text with its buffer as a data URI.
fn with_data(text: &[u8], bytes: &[u8]) -> Vec<u8> {
    let data: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    let text = String::from_utf8_lossy(text);
    let stated = format!("\"byteLength\": {}", bytes.len());
    assert!(text.contains(&stated), "the scene states as many bytes as there are");
    text.replace(&stated, &format!("{stated}, \"uri\": \"data:,{data}\"")).into_bytes()
}

/// GLB of a JSON and a binary chunk, with correct lengths.
pub(crate) fn glb(text: &[u8], bytes: &[u8]) -> Vec<u8> {
    let mut text = text.to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = b"glTF".to_vec();
    for word in [2, 12 + 8 + text.len() + 8 + bytes.len(), text.len()] {
        file.extend((word as u32).to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(&text);
    file.extend((bytes.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bytes);
    file
}

/// Splits a GLB of two chunks into its JSON and its binary chunk.
pub(crate) fn split_glb(file: &[u8]) -> Option<(Vec<u8>, Vec<u8>)> {
    let chunk = |at: usize| {
        let length = u32::from_le_bytes(*file.get(at..)?.first_chunk()?) as usize;
        file.get(at + 8..at + 8 + length)
    };
    let text = chunk(12)?;
    Some((text.to_vec(), chunk(12 + 8 + text.len())?.to_vec()))
}

/// Scene [`RICH`] as text.
pub(crate) fn rich() -> Vec<u8> {
    with_data(RICH, &triangle_bytes())
}

impl Scenes {
    pub(super) fn new() -> Self {
        let rich = rich();
        let texts: Vec<_> = SHIPPED.iter().map(|text| text.to_vec()).chain([rich]).collect();
        let binaries = vec![(RICH.to_vec(), triangle_bytes())];
        let mut files = texts.clone();
        files.extend(binaries.iter().map(|(text, bytes)| glb(text, bytes)));
        let folder = tempfile::tempdir().expect("there is room for a folder");
        Self { texts, binaries, files, folder }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("scene")
    }
}

/// Makes few edits of a scene's JSON, because most single edits already make the scene invalid.
fn edit_json(text: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..1 + random.edits() / 3 {
        mutation::edit_json(text, random);
    }
}

/// Loads a scene at rest and at 1 s of its animations. Returns it at rest.
pub(crate) fn load(path: &Path) -> Result<Scene, SceneError> {
    let file = SceneFile::open(path, &LoadSettings::default())?;
    let scene = file.at_rest()?;
    let moment = Moment { animations: Vec::new(), seconds: 1.0 };
    file.animations()?;
    file.cameras_at(&moment)?;
    file.at(&moment)?;
    Ok(scene)
}

impl Target for Scenes {
    fn name(&self) -> &'static str {
        "gltf"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        // A node takes a few bytes of JSON, and some hundreds in memory.
        bound(input, 1024)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        match random.below(8) {
            0..=2 => {
                let mut text = random.pick(&self.texts).clone();
                edit_json(&mut text, random);
                text
            }
            3..=5 => {
                let (mut text, mut bytes) = random.pick(&self.binaries).clone();
                edit_json(&mut text, random);
                if random.once_in(2) {
                    mutation::edit(&mut bytes, &[], random);
                }
                let mut file = glb(&text, &bytes);
                if random.once_in(8) {
                    mutation::edit(&mut file, &self.files, random);
                }
                file
            }
            _ => {
                let mut file = random.pick(&self.files).clone();
                mutation::edit(&mut file, &self.files, random);
                file
            }
        }
    }

    fn read(&self, input: &[u8]) -> bool {
        write_anew(&self.path(), input);
        let scene = match load(&self.path()) {
            Ok(scene) => scene,
            Err(error) => {
                let _ = error.to_string();
                return false;
            }
        };
        if scene.triangles.len() <= MAX_PACKED
            && let Err(error) = PackedScene::new(&scene)
        {
            let _ = error.to_string();
        }
        true
    }
}
