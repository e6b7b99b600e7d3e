//! Prints checksums of pictures and of counted work, to compare two builds of the command:
//!
//! ```text
//! cargo run --release -p photoncard-tests --example pixels -- PHOTONCARD [--card ADDRESS] [ONLY]
//! ```
//!
//! Each shipped scene with each technique has a line: the CRC-64 of the samples of all layers, the CRC-64 of
//! the counters of `--stats --counters`, and the options. Attributes of the EXR file, times and bytes on
//! links are left out, so that builds of different versions can be compared. `--card` states the card that
//! renders; then no work is counted.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use crc::{CRC_64_XZ, Crc};
use serde_json::Value;

/// Scene files, each with options for all its pictures.
const SCENES: [(&str, &[&str]); 10] = [
    ("cornell.gltf", &[]),
    ("cornell-glossy.gltf", &["--camera", "floor"]),
    ("cornell-uplight.gltf", &[]),
    ("cornell-spheres.glb", &["--caustic-photons", "20000"]),
    ("furnace.gltf", &[]),
    ("atrium.glb", &["--camera", "court"]),
    ("atrium.glb", &["--camera", "gallery"]),
    ("atrium-open.glb", &["--environment", "scenes/sky.exr"]),
    ("room.glb", &[]),
    ("roughness.glb", &["--shadow-rays", "3"]),
];

/// Options of each technique, and of several together.
const TECHNIQUES: [&[&str]; 9] = [
    &["--order", "naive", "--sampling", "brdf", "--photon-map", "jensen"],
    &["--order", "tiled", "--sampling", "photon"],
    &["--order", "dirbin", "--sampling", "mixture"],
    &["--order", "hash", "--queue", "100"],
    &["--order", "sort", "--bins", "7"],
    &["--irradiance-cache", "on", "--ic-error", "0.1", "--spp", "2"],
    &["--radiance", "precomputed"],
    &["--irradiance-cache", "on", "--radiance", "precomputed", "--aov", "all", "--tile", "8"],
    &["--card", "emulated-micro:2", "--neighbors", "50", "--tile", "8"],
];

/// Options of each picture. It is so small that all pictures take a minute or two, and so large that gather
/// queues are filled.
const SIZE: [&str; 8] = ["--size", "48x48", "--photons", "20000", "--gather-rays", "20", "--aov", "all"];

/// Statistics that count work, and depend neither on the machine nor on links.
const COUNTED: [&str; 14] = [
    "rays",
    "lost_paths",
    "caustic_gathers",
    "gathers",
    "tables",
    "records",
    "photons_tested",
    "photons_taken",
    "photons_selected",
    "photons_found",
    "lookups",
    "points_tested",
    "drains",
    "memory",
];

const CHECKSUM: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

struct Build {
    command: PathBuf,
    card: Option<String>,
    folder: tempfile::TempDir,
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let (mut card, mut words) = (None, Vec::new());
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--card" => card = arguments.next(),
            _ => words.push(argument),
        }
    }
    let Some(command) = words.first().map(PathBuf::from) else {
        eprintln!("usage: pixels PHOTONCARD [--card ADDRESS] [ONLY]");
        return ExitCode::from(2);
    };
    let only = words.get(1).map_or("", String::as_str);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let build = Build { command, card, folder };
    for (scene, of_scene) in SCENES {
        for technique in TECHNIQUES {
            let label = format!("{scene} {} {}", of_scene.join(" "), technique.join(" "));
            if !label.contains(only) || build.card.is_some() && technique.contains(&"--card") {
                continue;
            }
            match build.checksums(scene, of_scene, technique) {
                Ok((picture, work)) => println!("{picture:016x} {work:016x} {label}"),
                Err(reason) => {
                    eprintln!("{label}: {reason}");
                    return ExitCode::FAILURE;
                }
            }
        }
    }
    ExitCode::SUCCESS
}

impl Build {
    /// Renders a picture. Returns the checksums of its samples and of its counters.
    fn checksums(
        &self,
        scene: &str,
        of_scene: &[&str],
        technique: &[&str],
    ) -> Result<(u64, u64), Box<dyn std::error::Error>> {
        let [picture, statistics] = ["a.exr", "a.json"].map(|name| self.folder.path().join(name));
        let mut command = Command::new(&self.command);
        command.args(["render", "--quiet", "-o"]).arg(&picture).arg("--stats").arg(&statistics);
        command.arg(Path::new("scenes").join(scene)).args(with_last_of_each(&[&SIZE, of_scene, technique]));
        match &self.card {
            Some(card) => command.args(["--card", card, "--neighbors", "50", "--tile", "8"]),
            None => command.arg("--counters"),
        };
        let output = command.output()?;
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into());
        }
        let statistics: Value = serde_json::from_slice(&std::fs::read(&statistics)?)?;
        Ok((samples(&picture)?, work(&statistics)))
    }
}

/// Options with values from several lists. Of equal options the last one stays.
fn with_last_of_each<'a>(lists: &[&[&'a str]]) -> Vec<&'a str> {
    let mut options: Vec<(&str, &str)> = Vec::new();
    for pair in lists.iter().flat_map(|list| list.chunks_exact(2)) {
        options.retain(|(name, _)| *name != pair[0]);
        options.push((pair[0], pair[1]));
    }
    options.into_iter().flat_map(|(name, value)| [name, value]).collect()
}

/// CRC-64 of the names and samples of all channels.
fn samples(path: &Path) -> Result<u64, exr::error::Error> {
    use exr::prelude::{ReadChannels, ReadLayers, read};
    let image = read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    let image = image.from_file(path)?;
    let mut checksum = CHECKSUM.digest();
    for layer in &image.layer_data {
        for channel in &layer.channel_data.list {
            checksum.update(format!("{:?} {}", layer.attributes.layer_name, channel.name).as_bytes());
            for sample in channel.sample_data.values_as_f32() {
                checksum.update(&sample.to_le_bytes());
            }
        }
    }
    Ok(checksum.finalize())
}

/// CRC-64 of the counters [`COUNTED`].
fn work(statistics: &Value) -> u64 {
    let mut checksum = CHECKSUM.digest();
    for key in COUNTED {
        checksum.update(format!("{key}: {}", statistics[key]).as_bytes());
    }
    checksum.finalize()
}
