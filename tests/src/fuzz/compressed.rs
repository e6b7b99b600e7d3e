//! Fuzzing of compressed buffer views and primitives: damaged streams in otherwise valid scenes.

use std::path::PathBuf;

use photoncard_driver::scene::gltf;
use tempfile::TempDir;

use super::gltf::{glb, split_glb};
use super::mutation;
use super::random::Random;
use super::target::{Target, bound, write_anew};

/// Scenes with buffer views of every mode and filter, in both versions of meshopt's format.
const MESHOPT: [&[u8]; 2] = [
    include_bytes!("../../../driver/scene/tests/it/compressed/meshopt-0.glb"),
    include_bytes!("../../../driver/scene/tests/it/compressed/meshopt-1.glb"),
];

/// Scenes with a primitive that has every attribute, encoded by either method of Draco.
const DRACO: [&[u8]; 2] = [
    include_bytes!("../../../driver/scene/tests/it/compressed/draco-edgebreaker.glb"),
    include_bytes!("../../../driver/scene/tests/it/compressed/draco-sequential.glb"),
];

/// Target for compressed streams. An input is a scene in GLB.
pub(super) struct Streams {
    name: &'static str,
    /// Maximum number of bytes that are allocated per byte of a stream.
    expansion: usize,
    /// JSON and binary chunk of each scene.
    scenes: Vec<(Vec<u8>, Vec<u8>)>,
    streams: Vec<Vec<u8>>,
    folder: TempDir,
}

impl Streams {
    pub(super) fn meshopt() -> Self {
        Self::new("meshopt", MESHOPT, 1024)
    }

    pub(super) fn draco() -> Self {
        // The scenes' accessors have few elements, which bounds what a stream decodes to.
        Self::new("draco", DRACO, 0)
    }

    fn new(name: &'static str, seeds: [&[u8]; 2], expansion: usize) -> Self {
        let scenes: Vec<_> = seeds.into_iter().filter_map(split_glb).collect();
        let streams = scenes.iter().map(|(_, streams)| streams.clone()).collect();
        let folder = tempfile::tempdir().expect("there is room for a folder");
        Self { name, expansion, scenes, streams, folder }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("scene.glb")
    }
}

impl Target for Streams {
    fn name(&self) -> &'static str {
        self.name
    }

    fn allocation_bound(&self, input: usize) -> usize {
        bound(input, self.expansion)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let (text, streams) = random.pick(&self.scenes);
        let mut edited = streams.clone();
        mutation::edit(&mut edited, &self.streams, random);
        // The JSON states the ranges of the streams, so that the binary chunk must keep its length.
        edited.resize(streams.len(), 0);
        glb(text, &edited)
    }

    fn read(&self, input: &[u8]) -> bool {
        write_anew(&self.path(), input);
        gltf::load(&self.path()).inspect_err(|error| drop(error.to_string())).is_ok()
    }
}
