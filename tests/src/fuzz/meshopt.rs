//! Fuzzing of compressed buffer views: damaged streams in valid scenes.

use std::fs;
use std::path::PathBuf;

use photoncard_driver::scene::gltf;
use tempfile::TempDir;

use super::gltf::{glb, split_glb};
use super::mutation;
use super::random::Random;
use super::target::{Target, bound};

/// Scenes with streams of every mode and filter, in both versions.
pub(crate) const SEEDS: [&[u8]; 2] = [
    include_bytes!("../../../driver/tests/compressed/meshopt-0.glb"),
    include_bytes!("../../../driver/tests/compressed/meshopt-1.glb"),
];

/// Target of compressed buffer views. An input is a scene.
pub(super) struct Streams {
    /// JSON and streams of each scene.
    scenes: Vec<(Vec<u8>, Vec<u8>)>,
    streams: Vec<Vec<u8>>,
    folder: TempDir,
}

impl Streams {
    pub(super) fn new() -> Self {
        let scenes: Vec<_> = SEEDS.into_iter().filter_map(split_glb).collect();
        let streams = scenes.iter().map(|(_, streams)| streams.clone()).collect();
        Self { scenes, streams, folder: tempfile::tempdir().expect("there is room for a folder") }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("scene.glb")
    }
}

impl Target for Streams {
    fn name(&self) -> &'static str {
        "meshopt"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        // A byte of a stream stands for at most 1024.
        bound(input, 1024)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let (text, streams) = random.pick(&self.scenes);
        let mut edited = streams.clone();
        mutation::edit(&mut edited, &self.streams, random);
        // The JSON states the places of all streams: bytes that an edit removed are missing at the end.
        edited.resize(streams.len(), 0);
        glb(text, &edited)
    }

    fn read(&self, input: &[u8]) -> bool {
        fs::write(self.path(), input).expect("there is room for a scene");
        gltf::load(&self.path()).inspect_err(|error| drop(error.to_string())).is_ok()
    }
}
