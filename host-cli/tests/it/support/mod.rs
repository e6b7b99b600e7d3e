//! Runs the command in a temporary folder, on small scenes.

#[cfg(unix)]
pub(crate) mod board;

use std::fmt::Write;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

/// Options of a minimal render. A test may replace them or add others.
const SMALL: [(&str, &str); 6] = [
    ("--quality", "paper"),
    ("--size", "8x8"),
    ("--photons", "200"),
    ("--gather-rays", "8"),
    ("--neighbors", "5"),
    ("--shadow-rays", "1"),
];

/// Prints that something is not tested. Panics in continuous integration, where all tools are installed.
pub(crate) fn skip(what: &str) {
    assert!(std::env::var_os("CI").is_none(), "{what}");
    eprintln!("SKIPPED: {what}");
}

/// Status and output of a finished command.
pub(crate) struct Outcome {
    pub(crate) status: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Outcome {
    /// Returns the outcome of a process, which must not have panicked.
    pub(crate) fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        let outcome =
            Self { status: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) };
        assert!(!outcome.stderr.contains("panicked"), "{}", outcome.stderr);
        outcome
    }
}

/// Temporary folder that commands run in.
pub(crate) struct Room(TempDir);

impl Room {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    pub(crate) fn write_scene(&self, name: &str, scene: &Value) {
        self.write(name, serde_json::to_vec(scene).unwrap());
    }

    /// Names of all entries of the folder, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_photoncard"));
        command.current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    pub(crate) fn run(&self, arguments: &[&str]) -> Outcome {
        Outcome::of(&self.command().args(arguments).output().unwrap())
    }

    /// Renders a small picture. `options` replace those of [`SMALL`] or are added to them.
    pub(crate) fn render(&self, scene: &str, options: &[&str]) -> Outcome {
        self.run(&small_render(scene, options))
    }

    /// Renders a small picture, which must succeed.
    pub(crate) fn rendered(&self, scene: &str, options: &[&str]) -> Outcome {
        let outcome = self.render(scene, options);
        assert_eq!(outcome.status, Some(0), "{options:?}: {}", outcome.stderr);
        assert_eq!(outcome.stdout, "");
        outcome
    }
}

/// Process of `photoncard emulate`, which serves a card. Dropping it ends the process.
pub(crate) struct Emulator {
    pub(crate) process: Child,
    pub(crate) address: String,
}

impl Emulator {
    pub(crate) fn start(room: &Room, listen: &str, options: &[&str]) -> Self {
        let mut command = room.command();
        command.args(["emulate", "--listen", listen]).args(options);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut address = String::new();
        BufReader::new(process.stdout.as_mut().unwrap()).read_line(&mut address).unwrap();
        assert!(address.ends_with('\n'), "{address:?}");
        Self { process, address: address.trim_end().to_owned() }
    }

    /// Sends a signal to the process.
    pub(crate) fn signal(&self, signal: &str) {
        let id = self.process.id().to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
    }

    /// Ends the process by a signal. Returns its exit status and its standard error.
    pub(crate) fn end(mut self, signal: &str) -> (Option<i32>, String) {
        self.signal(signal);
        let status = self.process.wait().unwrap().code();
        let mut said = String::new();
        self.process.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        (status, said)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // Both calls fail if the process has ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Arguments of a small render. `options` replace those of [`SMALL`] or are added to them.
pub(crate) fn small_render<'a>(scene: &'a str, options: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec!["render", scene];
    for (option, value) in SMALL {
        if !options.iter().any(|given| given.split('=').next() == Some(option)) {
            arguments.extend([option, value]);
        }
    }
    arguments.extend(options);
    arguments
}

/// Path of a shipped scene.
pub(crate) fn shipped(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name);
    path.to_str().unwrap().to_owned()
}

/// Cornell box whose large block is a mirror, which has caustics.
pub(crate) fn mirrored_cornell() -> Value {
    let mut scene: Value = serde_json::from_slice(&fs::read(shipped("cornell.gltf")).unwrap()).unwrap();
    let materials = scene["materials"].as_array_mut().unwrap();
    let mirror = materials.len();
    materials.push(json!({"pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": 0.0}}));
    let block = scene["meshes"].as_array_mut().unwrap().iter_mut().find(|mesh| mesh["name"] == "large-box");
    block.unwrap()["primitives"][0]["material"] = json!(mirror);
    scene
}

/// Buffer of [`scene`]: positions of the floor's four corners and the lamp's three, and six indices of the
/// floor.
pub(crate) fn scene_bytes() -> Vec<u8> {
    let floor = [-1f32, 0., 1., 1., 0., 1., 1., 0., -1., -1., 0., -1.];
    let lamp = [0f32, 1., 0., 0.5, 1., 0., 0., 1., 0.5];
    let mut bytes: Vec<u8> = floor.iter().chain(&lamp).flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    bytes
}

/// Scene of a floor (two triangles) under a lamp (one triangle), seen by the camera `eye`.
pub(crate) fn scene() -> Value {
    scene_of(&scene_bytes())
}

/// [`scene`] with another buffer.
pub(crate) fn scene_of(bytes: &[u8]) -> Value {
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular"],
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0.0, 0.5, 3.0]}],
        "cameras": [{"name": "eye", "type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "meshes": [{"name": "room", "primitives": [
            {"attributes": {"POSITION": 0}, "indices": 2, "material": 0},
            {"attributes": {"POSITION": 1}, "material": 1}
        ]}],
        "materials": [material("floor", [0.0; 3]), material("lamp", [1.0; 3])],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [-1, 0, -1], "max": [1, 0, 1]},
            {"bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 3, "type": "VEC3",
             "min": [0, 1, 0], "max": [0.5, 1, 0.5]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 84},
            {"buffer": 0, "byteOffset": 84, "byteLength": 12}
        ],
        "buffers": [{"uri": data_uri(bytes), "byteLength": bytes.len()}]
    })
}

fn material(name: &str, emission: [f32; 3]) -> Value {
    json!({
        "name": name,
        "emissiveFactor": emission,
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0},
        "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}}
    })
}

fn data_uri(bytes: &[u8]) -> String {
    bytes.iter().fold("data:,".to_owned(), |mut uri, byte| {
        write!(uri, "%{byte:02x}").unwrap();
        uri
    })
}

/// GLB file of a JSON chunk and a binary chunk.
pub(crate) fn glb(text: &[u8], bytes: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], padding: u8| {
        let mut chunk = bytes.to_vec();
        chunk.resize(chunk.len().next_multiple_of(4), padding);
        chunk
    };
    let chunks = [(b"JSON", padded(text, b' ')), (b"BIN\0", padded(bytes, 0))];
    let length = 12 + chunks.iter().map(|(_, data)| 8 + data.len()).sum::<usize>();
    let mut file = [&b"glTF"[..], &2_u32.to_le_bytes(), &(length as u32).to_le_bytes()].concat();
    for (kind, data) in &chunks {
        file.extend([&(data.len() as u32).to_le_bytes()[..], &kind[..], data].concat());
    }
    file
}
