//! The triangle's file with animations.

use std::ops::Deref;

use glam::Vec3;
use photoncard_scene::Scene;
use photoncard_scene::error::SceneError;
use photoncard_scene::gltf::{LoadSettings, Moment, SceneFile};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::support::{Extended, push};

/// File of the triangle, to which tests add animations.
pub(crate) struct Animated(pub(crate) Extended);

impl Animated {
    pub(crate) fn new() -> Self {
        Self(Extended::new())
    }

    /// Adds an animation without channels, and returns its index.
    pub(crate) fn animation(&mut self, name: &str) -> usize {
        push(&mut self.0.json, "animations", json!({"name": name, "channels": [], "samplers": []}))
    }

    /// Adds a channel for property `path` of a node. `input` and `output` are accessors of times and values.
    pub(crate) fn channel(
        &mut self,
        animation: usize,
        (node, path): (usize, &str),
        [input, output]: [usize; 2],
        interpolation: &str,
    ) {
        let animation = &mut self.0.json["animations"][animation];
        let sampler = json!({"input": input, "output": output, "interpolation": interpolation});
        let sampler = push(animation, "samplers", sampler);
        push(animation, "channels", json!({"sampler": sampler, "target": {"node": node, "path": path}}));
    }

    /// Adds a channel for a property with `N` components.
    pub(crate) fn moved<const N: usize>(
        &mut self,
        animation: usize,
        target: (usize, &str),
        keys: &[(f32, [f32; N])],
        interpolation: &str,
    ) {
        let times: Vec<_> = keys.iter().map(|(time, _)| [*time]).collect();
        let values: Vec<_> = keys.iter().map(|(_, value)| *value).collect();
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        let accessors = [self.0.floats("SCALAR", &times), self.0.floats(kind, &values)];
        self.channel(animation, target, accessors, interpolation);
    }

    pub(crate) fn json(&mut self) -> &mut Value {
        &mut self.0.json
    }

    pub(crate) fn file(&self) -> Result<OpenFile, SceneError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.gltf");
        std::fs::write(folder.path().join("data.bin"), &self.0.bytes).unwrap();
        std::fs::write(&path, self.0.json.to_string()).unwrap();
        Ok(OpenFile { file: SceneFile::open(&path, &LoadSettings::default())?, _folder: folder })
    }

    pub(crate) fn at(&self, seconds: f64) -> Result<Scene, SceneError> {
        self.file()?.at(&all_at(seconds))
    }

    /// Corners of the only triangle at a time.
    pub(crate) fn corners(&self, seconds: f64) -> [Vec3; 3] {
        let scene = self.at(seconds).unwrap();
        assert_eq!(scene.triangles.len(), 1);
        scene.triangles[0].vertices
    }
}

/// Open file with the temporary folder that contains it.
pub(crate) struct OpenFile {
    file: SceneFile,
    _folder: TempDir,
}

impl Deref for OpenFile {
    type Target = SceneFile;

    fn deref(&self) -> &SceneFile {
        &self.file
    }
}

/// Moment at which all animations play.
pub(crate) fn all_at(seconds: f64) -> Moment {
    Moment { animations: Vec::new(), seconds }
}

pub(crate) fn close(found: [Vec3; 3], expected: [Vec3; 3]) {
    for (found, expected) in found.into_iter().zip(expected) {
        assert!(found.distance(expected) < 2e-6, "{found} is not {expected}");
    }
}
