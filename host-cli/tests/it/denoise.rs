//! Denoised pictures, on machines that have Open Image Denoise.

use std::path::Path;

use exr::prelude::read_first_flat_layer_from_file;
use photoncard_driver::exr::{Shown, read};
use serde_json::Value;

use crate::support::{Room, shipped, skip};

/// Options of a picture with much noise: one sample a pixel, four gather rays, no irradiance cache.
const NOISY: [&str; 9] = [
    "--size=64x64",
    "--photons=5000",
    "--spp=1",
    "--gather-rays=4",
    "--adaptive=off",
    "--irradiance-cache=off",
    "--shadow-rays=1",
    "--quiet",
    "--neighbors=24",
];

/// Renders the Cornell box with [`NOISY`] and `options`. `None`, with a notice, if Open Image Denoise is
/// missing.
fn rendered(room: &Room, options: &[&str]) -> Option<()> {
    rendered_of("cornell.gltf", room, options)
}

fn rendered_of(scene: &str, room: &Room, options: &[&str]) -> Option<()> {
    let scene = shipped(scene);
    let outcome = room.run(&[&["render", &scene], &NOISY[..], options].concat());
    if outcome.stderr.contains("is not on this machine") {
        skip("denoised pictures are not tested: Open Image Denoise is missing (pip install pyoidn)");
        return None;
    }
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    Some(())
}

/// Returns whether the machine has Open Image Denoise. Prints a notice if not.
pub(crate) fn is_there(room: &Room) -> bool {
    rendered(room, &["-o", "there.png", "--denoise"]).is_some()
}

/// Time of the denoiser in a statistics file, seconds.
fn seconds(room: &Room, name: &str) -> Option<f64> {
    let statistics: Value = serde_json::from_slice(&room.read(name)).unwrap();
    statistics["time_s"]["denoise"].as_f64()
}

/// Radiance of the layer `denoised` of an EXR.
fn denoised(path: &Path) -> Vec<[f32; 3]> {
    let picture = read_first_flat_layer_from_file(path).unwrap();
    let channel = |name: &str| {
        let channel = picture.layer_data.channel_data.list.iter().find(|channel| channel.name == *name);
        channel.unwrap().sample_data.values_as_f32().collect::<Vec<_>>()
    };
    let [red, green, blue] = ["denoised.R", "denoised.G", "denoised.B"].map(channel);
    (0..red.len()).map(|index| [red[index], green[index], blue[index]]).collect()
}

fn squared_error(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[test]
fn a_denoised_picture_has_less_noise_and_keeps_the_rendered_one() {
    let room = Room::new();
    let both = ["-o", "a.exr", "-o", "a.png", "--denoise", "--stats", "a.json"];
    let Some(()) = rendered(&room, &both) else { return };
    rendered(&room, &["-o", "b.exr", "-o", "b.png", "--stats", "b.json"]);
    assert!(seconds(&room, "a.json") > Some(0.0) && seconds(&room, "b.json") == Some(0.0));
    let scene = shipped("cornell.gltf");
    let clean = ["--size=64x64", "--quality=draft", "--photons=5000", "--spp=16", "--quiet"];
    let outcome = room.run(&[&["render", &scene, "-o", "clean.exr"], &clean[..]].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    let [raw, without, clean] =
        ["a.exr", "b.exr", "clean.exr"].map(|name| read(&room.path(name), Shown::Rendered).unwrap().pixels);
    assert_eq!(raw, without);
    let [before, after] =
        [&raw, &denoised(&room.path("a.exr"))].map(|picture| squared_error(picture, &clean));
    assert!(after < 0.6 * before, "{after} {before}");
    assert_ne!(room.read("a.png"), room.read("b.png"));
    let outcome = room.run(&["tonemap", "a.exr", "-o", "c.png"]);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert!(room.read("c.png") == room.read("a.png"));
}

#[test]
fn parts_are_denoised_when_they_are_merged() {
    let room = Room::new();
    let Some(()) = rendered(&room, &["-o", "whole.exr", "-o", "whole.png", "--denoise"]) else { return };
    rendered(&room, &["-o", "1.part", "--part=1/2", "--denoise"]);
    rendered(&room, &["-o", "2.part", "--part=2/2"]);
    let outcome =
        room.run(&["merge", "1.part", "2.part", "-o", "merged.exr", "-o", "merged.png", "--denoise"]);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    for [merged, whole] in [["merged.exr", "whole.exr"], ["merged.png", "whole.png"]] {
        assert!(room.read(merged) == room.read(whole), "{merged}");
    }
}

/// With `--denoise`, a quality chooses other settings for the prepared scene.
#[test]
fn a_scene_is_prepared_for_pictures_that_are_denoised() {
    let room = Room::new();
    if !is_there(&room) {
        return;
    }
    let cornell = shipped("cornell.gltf");
    let picture = ["--size=24x24", "--quiet"];
    let run = |own: &[&str]| {
        let outcome = room.run(&[own, &picture].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    };
    let notices = |own: &[&str]| room.run(&[own, &["--size=8x8"]].concat()).stderr;
    let options = ["--quality=draft", "--photons=5000"];
    run(&[&["render", &cornell, "-o", "whole.exr", "--denoise"], &options[..]].concat());
    run(&[&["prepare", &cornell, "-o", "it.card", "--denoise"], &options[..]].concat());
    run(&["render", "--prepared", "it.card", "-o", "prepared.exr", "--denoise"]);
    assert!(room.read("prepared.exr") == room.read("whole.exr"));
    run(&[&["prepare", &cornell, "-o", "other.card"], &options[..]].concat());
    run(&["render", "--prepared", "other.card", "-o", "other.exr", "--denoise"]);
    assert!(room.read("other.exr") != room.read("whole.exr"));
    let of_other = |stderr: &str| stderr.contains("add --denoise") || stderr.contains("with --denoise");
    for (scene, other) in [("it.card", false), ("other.card", true)] {
        let rendered = ["render", "--prepared", scene, "-o", "small.png"];
        assert_eq!(of_other(&notices(&rendered)), !other);
        assert_eq!(of_other(&notices(&[&rendered[..], &["--denoise"]].concat())), other);
    }
}

#[test]
fn a_finished_frame_is_rendered_again_if_it_is_to_be_denoised() {
    let room = Room::new();
    let render = |options: &[&str]| rendered_of("cornell-moving.glb", &room, options);
    let frames = ["-o", "f#.exr", "--frames=1", "--resume"];
    let Some(()) = render(&[&frames[..], &["--denoise"]].concat()) else { return };
    let first = room.read("f1.exr");
    render(&[&frames[..], &["--denoise"]].concat());
    assert!(room.read("f1.exr") == first);
    render(&frames);
    assert!(room.read("f1.exr") != first);
}

#[test]
fn without_its_library_a_denoised_render_ends_before_the_work() {
    let room = Room::new();
    room.write("library", "no library");
    let scene = shipped("cornell.gltf");
    for (stated, named) in [("absent", "absent"), ("library", "library")] {
        let mut command = room.command();
        command.args(["render", &scene, "-o", "a.png", "--denoise"]).env("PHOTONCARD_OIDN", stated);
        let outcome = crate::support::Outcome::of(&command.output().unwrap());
        assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
        assert!(
            outcome.stderr.contains(named) && outcome.stderr.contains("Open Image Denoise"),
            "{}",
            outcome.stderr
        );
        assert_eq!(room.names(), ["library"]);
    }
}
