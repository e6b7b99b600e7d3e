//! Pictures by passes: `--time`, `--noise`, and further samples of a finished picture.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::support::{Outcome, Room, shipped};
use serde_json::Value;

/// Size of the picture, and settings that otherwise a pilot would choose.
const STATED: [&str; 12] = [
    "--size",
    "24x20",
    "--photons",
    "2000",
    "--gather-rays",
    "4",
    "--shadow-rays",
    "1",
    "--irradiance-cache",
    "off",
    "--adaptive",
    "off",
];

fn render(room: &Room, picture: &str, options: &[&str]) -> Outcome {
    room.run(&[&["render", &shipped("cornell.gltf"), "-o", picture][..], &STATED, options].concat())
}

fn render_or_panic(room: &Room, picture: &str, options: &[&str]) -> Outcome {
    let outcome = render(room, picture, options);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    outcome
}

/// Number of samples per pixel that a render prints at its end.
fn samples(outcome: &Outcome) -> String {
    let (before, _) = outcome.stderr.rsplit_once(" a pixel, ").expect("the number of samples");
    let mut words = before.rsplit(' ');
    assert!(words.next().unwrap().starts_with("sample"));
    words.next().unwrap().to_owned()
}

#[test]
fn a_picture_of_stated_noise_or_time_equals_the_render_of_its_samples() {
    let room = Room::new();
    for (options, said) in [(["--noise", "0.2"], "estimated noise"), (["--time", "0.3s"], "pass")] {
        let outcome = render_or_panic(&room, "passes.exr", &options);
        assert!(outcome.stderr.contains(said), "{}", outcome.stderr);
        render_or_panic(&room, "once.exr", &["--spp", &samples(&outcome)]);
        assert!(room.read("passes.exr") == room.read("once.exr"), "{options:?}");
        assert_eq!(room.names(), ["once.exr", "passes.exr"]);
    }
}

#[test]
fn a_picture_with_added_samples_equals_that_of_one_render() {
    let room = Room::new();
    render_or_panic(&room, "a.exr", &["--spp", "3", "--keep-samples"]);
    assert_eq!(room.names(), ["a.exr", "a.exr.partial"]);
    let kept = room.read("a.exr.partial");
    render_or_panic(&room, "a.exr", &["--spp", "5", "--resume"]);
    assert_eq!(room.names(), ["a.exr"]);
    render_or_panic(&room, "once.exr", &["--spp", "5"]);
    assert!(room.read("a.exr") == room.read("once.exr"));
    // Fewer samples than are kept, or another setting, are refused.
    room.write("a.exr.partial", &kept);
    for (options, word) in [(["--spp", "2"], "spp was 3"), (["--seed", "9"], "seed was 0 and is 9")] {
        let outcome = render(&room, "a.exr", &[&["--resume"], &options[..]].concat());
        assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(word), "{}", outcome.stderr);
    }
    assert!(room.read("a.exr.partial") == kept);
}

/// Options that leave samples, photons and rays to a pilot.
const CHOSEN: [&str; 4] = ["--quality", "draft", "--size", "16x12"];

/// Renders the Cornell box with settings that a pilot chooses.
fn chosen(room: &Room, picture: &str, options: &[&str]) -> Outcome {
    room.run(&[&["render", &shipped("cornell.gltf"), "-o", picture][..], &CHOSEN, options].concat())
}

#[test]
fn the_options_that_an_aim_ends_with_render_its_picture_at_once() {
    let room = Room::new();
    for (aim, others) in [
        (["--noise", "0.15"], &[][..]),
        (["--time", "0.5"], &[]),
        (["--time", "0.2"], &["--planned-spp", "9", "--photons", "3000"]),
        (["--time", "0.2"], &["--irradiance-cache", "off", "--shadow-rays", "1"]),
    ] {
        let outcome = chosen(&room, "passes.exr", &[&aim, others].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        assert!(outcome.stderr.contains("quality draft: planned for "), "{}", outcome.stderr);
        let (_, at_once) = outcome.stderr.split_once("this picture in one render: ").expect("the options");
        let at_once: Vec<&str> = at_once.lines().next().unwrap().split(' ').collect();
        let once = chosen(&room, "once.exr", &[&at_once, others].concat());
        assert_eq!(once.status, Some(0), "{}", once.stderr);
        assert!(room.read("passes.exr") == room.read("once.exr"), "{aim:?} {at_once:?}");
    }
}

#[test]
fn a_time_too_short_for_records_and_caustics_names_the_settings_without_them() {
    let room = Room::new();
    let scene = shipped("cornell-spheres.glb");
    let render = |output: &str, options: &[&str]| {
        let picture = ["render", &scene, "-o", output, "--quality", "draft", "--size", "16x12"];
        let outcome = room.run(&[&picture, options].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        outcome.stderr
    };
    let said = render("passes.exr", &["--time", "0.001"]);
    let (_, at_once) = said.split_once("this picture in one render: ").expect("the options");
    let at_once: Vec<&str> = at_once.lines().next().unwrap().split(' ').collect();
    // The 6250 caustic photons are an eighth of 50,000.
    for [option, value] in
        [["--irradiance-cache", "off"], ["--caustic-photons", "6250"], ["--gather-rays", "1"]]
    {
        assert!(at_once.windows(2).any(|words| words == [option, value]), "{option} {value}: {at_once:?}");
    }
    render("once.exr", &at_once);
    assert!(room.read("passes.exr") == room.read("once.exr"), "{at_once:?}");
    let stated =
        render("stated.exr", &["--time", "0.001", "--gather-rays", "16", "--caustic-photons", "900"]);
    assert!(
        stated.contains("irradiance interpolated") && !stated.contains("--irradiance-cache off"),
        "{stated}"
    );
}

#[test]
fn samples_are_added_with_the_settings_that_a_pilot_chose() {
    let room = Room::new();
    let first = chosen(&room, "a.exr", &["--spp", "3", "--keep-samples"]);
    assert_eq!(first.status, Some(0), "{}", first.stderr);
    let kept = room.read("a.exr.partial");
    // A stated setting that differs from the kept samples' is refused; the message names this setting alone.
    for (options, difference) in [
        (["--planned-spp", "5"], "planned-spp was 3 and is 5"),
        (["--shadow-rays", "15"], "shadow-rays was "),
        (["--photons", "2345"], " and is 2345"),
        (["--ic-error", "0.3"], " and is 0.3"),
        (["--irradiance-cache", "off"], "ic-error was "),
    ] {
        let outcome = chosen(&room, "a.exr", &[&["--spp", "7", "--resume"], &options[..]].concat());
        assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(difference), "{}", outcome.stderr);
        assert!(outcome.stderr.matches(" was ").count() <= 2, "{}", outcome.stderr);
    }
    assert!(room.read("a.exr.partial") == kept);
    let more = chosen(&room, "a.exr", &["--spp", "7", "--resume", "--stats", "a.json"]);
    assert_eq!(more.status, Some(0), "{}", more.stderr);
    assert!(more.stderr.contains("kept samples: 7 samples a pixel"), "{}", more.stderr);
    let statistics: Value = serde_json::from_slice(&room.read("a.json")).expect("JSON");
    let pixels = &statistics["provenance"]["pixels"];
    assert_eq!(pixels["planned-spp"], 3);
    let names = ["spp", "planned-spp", "photons", "gather-rays", "shadow-rays", "ic-error"];
    let stated = names.map(|name| format!("--{name}={}", pixels[name]));
    let once = chosen(&room, "once.exr", &stated.each_ref().map(String::as_str));
    assert_eq!(once.status, Some(0), "{}", once.stderr);
    assert!(room.read("a.exr") == room.read("once.exr"), "{stated:?}");
}

#[test]
fn a_missed_aim_is_reported() {
    let room = Room::new();
    let outcome = room.run(
        &[
            &["render", &shipped("cornell.gltf"), "-o", "a.exr", "--size", "2x2"][..],
            &STATED[2..],
            &["--noise", "0.000001"],
        ]
        .concat(),
    );
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert!(
        outcome.stderr.contains("the aim of 0.0001 % is not reached: 4096 is the maximum"),
        "{}",
        outcome.stderr
    );
    // In a picture that is black everywhere, noise is undefined.
    let away = ["--noise", "0.1", "--look-at", "0,1,100"];
    let outcome = render_or_panic(&room, "black.exr", &away);
    assert!(
        outcome.stderr.contains("5 passes, noise of a black picture has no measure"),
        "{}",
        outcome.stderr
    );
    assert_eq!(samples(&outcome), "16");
}

#[test]
fn an_interrupt_writes_the_picture_of_the_complete_passes() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let mut command = room.command();
    command.args(["render", &cornell, "-o", "a.exr", "--noise", "0.000001"]).args(STATED);
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    // A line about tiles follows: the first pass has begun.
    assert!(lines.any(|line| line.starts_with("photoncard: tiles ")));
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest:?}");
    assert!(rest.last().is_some_and(|line| line.contains("ended before the aim")), "{rest:?}");
    let outcome = Outcome { status: Some(0), stdout: String::new(), stderr: rest.join("\n") };
    render_or_panic(&room, "once.exr", &["--spp", &samples(&outcome)]);
    assert!(room.read("a.exr") == room.read("once.exr"));
}

#[test]
fn invalid_aims_and_options_that_passes_lack_are_refused() {
    let room = Room::new();
    for (options, word) in [
        (&["--time", "0"][..], "a time is a number of seconds"),
        (&["--noise", "0"], "noise is a share"),
        (&["--noise", "0.1", "--spp", "4"], "cannot be used with"),
        (&["--time", "1s", "--resume"], "cannot be used with"),
        (&["--time", "1s", "--trace", "a.gz"], "cannot be used with"),
        (&["--noise", "0.1", "--keep-samples"], "cannot be used with"),
    ] {
        let outcome = render(&room, "a.exr", options);
        assert_eq!(outcome.status, Some(2), "{options:?}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(word), "{options:?}: {}", outcome.stderr);
        assert!(room.names().is_empty());
    }
}
