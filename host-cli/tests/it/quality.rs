//! Option `--quality`: the settings that it chooses for a scene are printed and stored.

use crate::support::{Outcome, Room, shipped};
use serde_json::Value;

/// Settings that a quality chooses, by their keys in the provenance.
const FOUND: [&str; 5] = ["spp", "photons", "gather-rays", "shadow-rays", "ic-error"];

/// Renders the Cornell box at 12x12 pixels with the quality `draft`. Returns the outcome and the statistics.
fn drafted(room: &Room, picture: &str, options: &[&str]) -> (Outcome, Value) {
    let (cornell, stats) = (shipped("cornell.gltf"), format!("{picture}.json"));
    let fixed =
        ["render", &cornell, "-o", picture, "--stats", &stats, "--quality", "draft", "--size", "12x12"];
    let outcome = room.run(&[&fixed, options].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    (outcome, serde_json::from_slice(&room.read(&stats)).expect("JSON"))
}

#[test]
fn the_found_settings_reproduce_the_picture_without_a_pilot() {
    let room = Room::new();
    let (outcome, found) = drafted(&room, "a.exr", &[]);
    let settings = &found["provenance"]["pixels"];
    let line = format!("{} photons, {} a gather", settings["photons"], settings["neighbors"]);
    assert!(outcome.stderr.contains(&line), "{line}: {}", outcome.stderr);
    assert!(found["provenance"]["work"]["pilot"]["gather_ray"].as_f64().is_some_and(|noise| noise > 0.0));
    assert!(
        settings["adaptive"].is_f64(),
        "the pixels at the lamp's edge have most of the noise: {settings}"
    );
    let stated: Vec<String> =
        FOUND.iter().chain(&["adaptive"]).map(|name| format!("--{name}={}", settings[name])).collect();
    let stated: Vec<&str> = stated.iter().map(String::as_str).collect();
    let (outcome, again) = drafted(&room, "b.exr", &stated);
    assert_eq!(again["provenance"]["work"]["pilot"], Value::Null);
    assert!(!outcome.stderr.contains("quality draft"), "{}", outcome.stderr);
    assert!(room.read("a.exr") == room.read("b.exr"), "{stated:?}");
}

#[test]
fn a_stated_option_is_not_changed() {
    let room = Room::new();
    let (_, found) = drafted(&room, "a.exr", &[]);
    for (option, name, value) in [
        ("--photons=3000", "photons", 3000.0),
        ("--gather-rays=9", "gather-rays", 9.0),
        ("--shadow-rays=7", "shadow-rays", 7.0),
        ("--ic-error=0.5", "ic-error", 0.5),
        ("--spp=7", "spp", 7.0),
    ] {
        let (_, stated) = drafted(&room, "b.exr", &[option]);
        let of = |statistics: &Value, name: &str| statistics["provenance"]["pixels"][name].as_f64();
        assert_eq!(of(&stated, name), Some(value), "{option}");
        // The number of shadow rays depends on that of samples, and the number of gather rays on the error of
        // interpolated irradiance, which determines how many records there are.
        let pairs = [("spp", "shadow-rays"), ("ic-error", "gather-rays")];
        let follows = |other: &str| other == name || pairs.contains(&(name, other));
        for other in FOUND.into_iter().filter(|other| !follows(other)) {
            assert_eq!(of(&stated, other), of(&found, other), "{option}");
        }
    }
}
