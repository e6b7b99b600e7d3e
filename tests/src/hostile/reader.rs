//! Process that reads inputs one after another.

use std::fs;
use std::io::{Write as _, stdout};
use std::path::Path;

use photoncard_driver::difference::compare;
use photoncard_driver::exr::{self, Shown};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings, Unobserved, render};
use photoncard_driver::scene::{Environment, Scene, gltf};

use super::inputs::as_file;
use super::{Inputs, Settings};
use crate::fuzz::gltf::load;

/// Maximum number of triangles of a scene that is always rendered. Larger scenes are only loaded, except that
/// one in fifty is also packed.
const MAX_RENDERED: usize = 3000;

/// Maximum number of pixels of a picture that is compared; a larger one is only read.
const MAX_COMPARED: usize = 1 << 18;

/// Reads inputs. Prints the number of each before it is read, and then whether the input is valid.
///
/// # Panics
/// If a reader under test panics, which is a finding.
pub fn read_batch(settings: &Settings) {
    let inputs = Inputs::new(settings.kind);
    for number in settings.first..settings.first + settings.inputs {
        let (extension, bytes) = inputs.make(settings.seed, number);
        say(format_args!("at {number}"));
        let is_sound = read(&settings.folder, extension, bytes, number);
        say(format_args!("{} {number}", if is_sound { "sound" } else { "refused" }));
    }
}

/// Prints a line. Errors are ignored: the supervisor may have ended.
fn say(line: std::fmt::Arguments) {
    let mut out = stdout().lock();
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}

/// Reads an input in the format of its suffix. Returns whether it is valid.
fn read(folder: &Path, extension: &str, bytes: Vec<u8>, number: u64) -> bool {
    let (kind, file) = as_file(extension, bytes);
    let path = folder.join(format!("input.{kind}"));
    fs::write(&path, file).expect("there is room for an input");
    match extension {
        "png" | "jpg" | "webp" | "ktx2" => {
            told(gltf::load(&path)).is_some_and(|scene| !scene.images.is_empty())
        }
        "hdr" => told(Environment::load(&path)).is_some(),
        "exr" => {
            let environment = told(Environment::load(&path));
            let picture = told(exr::read(&path, Shown::Rendered));
            if let Some(picture) = picture.filter(|picture| picture.pixels.len() <= MAX_COMPARED) {
                told(compare(&picture, &picture, 16, None));
            }
            environment.is_some()
        }
        _ => told(load(&path)).map(|scene| use_scene(scene, number)).is_some(),
    }
}

/// Value of a result. Errors are formatted too, which must not panic.
fn told<T, E: std::fmt::Display>(result: Result<T, E>) -> Option<T> {
    result.inspect_err(|error| drop(error.to_string())).ok()
}

fn use_scene(mut scene: Scene, number: u64) {
    if scene.triangles.len() > MAX_RENDERED {
        if number.is_multiple_of(50) {
            told(PackedScene::new(&scene));
        }
        return;
    }
    if scene.check_light().is_err() {
        scene.environment = Some(Environment::constant(glam::Vec3::ONE));
    }
    let settings = RenderSettings {
        picture: Picture { width: 4, height: 4, ..Picture::default() },
        photons: PhotonMaps { count: 200, neighbors: 10, caustic_photons: Some(50), ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 8, shadow_rays: 1, samples: 1, ..Integrator::default() },
        ..RenderSettings::default()
    };
    told(render(&scene, &settings, &Unobserved));
}
