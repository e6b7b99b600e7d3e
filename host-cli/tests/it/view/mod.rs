//! Command `photoncard view`: what its pages see and do, and what others cannot.

mod connections;
mod page;

use std::process::Command;
use std::time::Duration;

use crate::support::{Emulator, Room, scene, shipped};
use page::{View, camera};
use photoncard_driver::exr::{Shown, read};
use serde_json::{Value, json};

/// Options of a small picture.
const SMALL: [&str; 14] = [
    "--quality",
    "paper",
    "--size",
    "20x12",
    "--photons",
    "200",
    "--gather-rays",
    "4",
    "--neighbors",
    "5",
    "--shadow-rays",
    "1",
    "--card",
    "emulated:1",
];

fn small_view(room: &Room, more: &[&str]) -> View {
    room.write_scene("scene.gltf", &scene());
    View::start(room, "scene.gltf", &[&SMALL, more].concat())
}

/// Runs the command that a page shows, with the output `picture`.
fn run_shown(room: &Room, state: &Value, picture: &str) {
    let shown = state["command"].as_str().unwrap();
    let line =
        shown.replacen("photoncard", env!("CARGO_BIN_EXE_photoncard"), 1).replace("picture.exr", picture);
    let output = Command::new("sh").arg("-c").arg(&line).current_dir(room.path(".")).output().unwrap();
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_page_is_greeted_with_the_scene() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let hello = view.connect().wait_for("hello");
    assert_eq!(
        (&hello["scene"]["name"], &hello["steers"], &hello["out"]),
        (&json!("scene.gltf"), &json!(true), &json!(null))
    );
    assert_eq!(hello["scene"]["cameras"][0]["name"], "eye");
    assert_eq!(hello["scene"]["materials"][1]["properties"]["emission"], json!([1.0, 1.0, 1.0]));
    assert_eq!(hello["scene"]["low"], json!([-1.0, 0.0, -1.0]));
}

#[test]
#[cfg(unix)]
fn the_settled_picture_equals_that_of_the_shown_command() {
    let room = Room::new();
    std::fs::create_dir(room.path("out")).unwrap();
    let view = small_view(&room, &["--out", "out"]);
    let mut page = view.connect();
    for number in 0..4 {
        match number {
            0 => {}
            1 => (0..20).for_each(|step| page.send(&camera(0.01 * f64::from(step), step < 19))),
            2 => page.send(&json!({"type": "set", "name": "floor.diffuse", "value": [0.7, 0.2, 0.1]})),
            _ => {
                page.send(&json!({"type": "size", "size": [33, 17]}));
                page.send(&json!({"type": "setting", "name": "cache", "value": true}));
                page.send(&json!({"type": "layer", "name": "direct"}));
            }
        }
        // The picture may settle for some of the messages before the last one arrives.
        let state = page.wait("state", |state| {
            let is_last = match number {
                0 => true,
                1 => state["camera"]["position"][0].as_f64().is_some_and(|x| x > 0.185),
                2 => state["changes"] != json!([]),
                _ => state["settings"]["layers"] != "albedo,N,Z",
            };
            is_last && state["settled"] == true
        });
        let [exr, png] = ["exr", "png"].map(|ending| format!("{number}.{ending}"));
        for name in [&exr, &png] {
            page.send(&json!({"type": "save", "name": name}));
            let saved = page.wait_for("saved");
            assert!(saved["path"].as_str().unwrap().ends_with(name), "{saved}");
        }
        run_shown(&room, &state, &exr);
        run_shown(&room, &state, &png);
        for name in [&exr, &png] {
            assert!(room.read(&format!("out/{name}")) == room.read(name), "{name}: {}", state["command"]);
        }
    }
}

/// Pages show the denoised radiance, as the PNG does. The EXR has it beside the rendered radiance.
#[test]
#[cfg(unix)]
fn a_denoised_view_settles_to_the_denoised_picture_of_its_command() {
    let room = Room::new();
    if !crate::denoise::is_there(&room) {
        return;
    }
    std::fs::create_dir(room.path("out")).unwrap();
    let view = small_view(&room, &["--out", "out", "--denoise", "--spp", "3", "--tile", "8"]);
    let mut page = view.connect();
    let state = page.settle();
    for name in ["a.exr", "a.png"] {
        page.send(&json!({"type": "save", "name": name}));
        page.wait_for("saved");
        run_shown(&room, &state, name);
        assert!(room.read(&format!("out/{name}")) == room.read(name), "{name}: {}", state["command"]);
    }
    let denoised = read(&room.path("a.exr"), Shown::Denoised).unwrap();
    assert_ne!(denoised.pixels, read(&room.path("a.exr"), Shown::Rendered).unwrap().pixels);
    let shown = (0..12).flat_map(|y| (0..20).map(move |x| (x, y))).map(|place| page.pixels[&place]);
    assert_eq!(shown.collect::<Vec<_>>(), denoised.pixels);

    // Without the denoiser the tiles come again, and no pixel is rendered.
    page.send(&json!({"type": "denoise", "value": false}));
    let mut plain = page.wait("state", |state| state["settled"] == true && state["denoised"] == false);
    assert_eq!(plain["version"], state["version"]);
    let (name, exr) = page.download("b.exr");
    run_shown(&room, &plain, &name);
    assert!(room.read(&name) == exr, "{}", plain["command"].take());
    let rendered = read(&room.path("b.exr"), Shown::Rendered).unwrap();
    let shown = (0..12).flat_map(|y| (0..20).map(move |x| (x, y))).map(|place| page.pixels[&place]);
    assert_eq!(shown.collect::<Vec<_>>(), rendered.pixels);
}

/// A view without a folder sends the files that the shown command writes.
#[test]
#[cfg(unix)]
fn a_picture_is_downloaded_without_a_folder() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    let state = page.settle();
    for name in ["a.exr", "a.png"] {
        let (named, contents) = page.download(name);
        run_shown(&room, &state, name);
        assert!(named == name && contents == room.read(name), "{named}: {}", state["command"]);
    }
    page.send(&json!({"type": "save", "name": "a.exr"}));
    assert!(page.wait_for("error")["text"].as_str().unwrap().contains("--out"));
    page.send(&json!({"type": "save", "name": "../a.exr", "download": true}));
    assert!(page.wait_for("error")["text"].as_str().unwrap().contains("name"));
    page.send(&json!({"type": "denoise", "value": true}));
    assert!(page.wait_for("error")["text"].as_str().unwrap().contains("--denoise"));
}

/// Name and provenance say that a picture is not the final one. It has the size of the final one.
#[test]
fn a_picture_that_is_not_settled_is_saved_as_such() {
    let room = Room::new();
    std::fs::create_dir(room.path("out")).unwrap();
    let view = small_view(&room, &["--out", "out"]);
    let mut page = view.connect();
    page.settle();
    // So many pixels and samples that the picture is not settled before it is saved.
    page.send(&json!({"type": "setting", "name": "spp", "value": 4096}));
    page.send(&json!({"type": "size", "size": [401, 301]}));
    page.wait("state", |state| state["size"] == json!([401, 301]) && state["samples"] != 0);
    let (name, exr) = page.download("a.exr");
    assert_eq!(name, "a-unsettled.exr");
    room.write(&name, &exr);
    let picture = read(&room.path(&name), Shown::Rendered).unwrap();
    assert_eq!([picture.width, picture.height], [401, 301]);
    assert!(picture.pixels.iter().flatten().any(|value| *value > 0.0), "the picture is black");
    for (file, bytes) in [("a.exr", &exr), ("a.png", &page.download("a.png").1)] {
        let says = |text: &[u8]| bytes.windows(text.len()).any(|part| part == text);
        assert!(says(b"\"unsettled\":{\"of\":4096,") && says(b"\"scene\":\"scene.gltf\""), "{file}");
    }
    page.send(&json!({"type": "save", "name": "a.png"}));
    let saved = page.wait_for("saved");
    assert!(saved["path"].as_str().unwrap().ends_with("a-unsettled.png"), "{saved}");
}

/// The picture is that of the shown command once the file that was dropped is in its folder.
#[test]
#[cfg(unix)]
fn an_environment_map_is_dropped_and_turned() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    assert_eq!(page.wait_for("hello")["environment"], json!(null));
    page.settle();
    page.send(&json!({"type": "turn", "degrees": 30}));
    assert!(page.wait_for("error")["text"].as_str().unwrap().contains("--environment"));

    let map = std::fs::read(shipped("sky.exr")).unwrap();
    page.drop_map("my sky.exr", &map);
    let hello = page.wait_for("hello");
    assert_eq!(hello["environment"], json!({"name": "my sky.exr", "rotation": 0.0, "dropped": true}));
    room.write("my sky.exr", &map);
    for rotation in [None, Some(30.0)] {
        if let Some(degrees) = rotation {
            page.send(&json!({"type": "turn", "degrees": degrees}));
            assert_eq!(page.wait_for("hello")["environment"]["rotation"], degrees);
        }
        let state = page.settle();
        let (name, exr) = page.download("a.exr");
        run_shown(&room, &state, &name);
        assert!(room.read(&name) == exr, "{}", state["command"]);
    }

    // A file that is none leaves the scene as it was.
    page.drop_map("no.hdr", b"no map");
    assert!(page.wait_for("error")["text"].as_str().unwrap().contains("no.hdr"));
    page.send(&camera(0.2, false));
    assert!(page.settle()["command"].as_str().unwrap().contains("--environment-rotation 30"));
}

/// The counts in the tile headers of the final picture add up to those that the shown command reports, also
/// after several passes.
#[test]
#[cfg(unix)]
fn tiles_report_their_work() {
    const UNKNOWN: u32 = u32::MAX;
    let room = Room::new();
    for (counters, options) in [
        (&["--counters"][..], ["--spp", "1", "--irradiance-cache", "on"]),
        (&[], ["--spp", "3", "--irradiance-cache", "off"]),
    ] {
        let view = small_view(&room, &[counters, &options, &["--tile", "8"]].concat());
        let mut page = view.connect();
        let mut state = page.settle();
        state["command"] =
            format!("{} --card emulated:1 --counters --stats stats.json", state["command"].as_str().unwrap())
                .into();
        run_shown(&room, &state, "a.exr");
        let stats: Value = serde_json::from_slice(&room.read("stats.json")).unwrap();
        let sum = |part: usize| page.work.values().map(|work| u64::from(work[part])).sum::<u64>();
        assert_eq!(page.work.len(), 6);
        assert_eq!(json!([sum(0), sum(1)]), json!([stats["gathers"], stats["records"]]));
        let bytes = |part: &str| stats["memory"][part]["dram_bytes"].as_u64().unwrap();
        assert_eq!(sum(1) > 0, options[3] == "on");
        if counters.is_empty() {
            assert!(page.work.values().all(|work| work[2] == UNKNOWN));
        } else {
            assert_eq!(128 * sum(2), bytes("photon_map") + bytes("scene"));
        }
    }
}

/// The command that a view shows states all settings that pilot renders have chosen.
#[test]
#[cfg(unix)]
fn a_quality_finds_the_settings_of_the_settled_picture() {
    let room = Room::new();
    std::fs::create_dir(room.path("out")).unwrap();
    let options = ["--size", "12x12", "--quality", "draft", "--out", "out", "--card", "emulated:2"];
    let view = View::start(&room, &shipped("cornell.gltf"), &options);
    let mut page = view.connect();
    let state = page.settle();
    page.send(&json!({"type": "save", "name": "a.exr"}));
    page.wait_for("saved");
    run_shown(&room, &state, "a.exr");
    assert!(room.read("out/a.exr") == room.read("a.exr"), "{}", state["command"]);
    let plain = ["render", &shipped("cornell.gltf"), "--size", "12x12", "--quality", "draft", "-o", "b.exr"];
    assert_eq!(room.run(&plain).status, Some(0));
    assert!(room.read("b.exr") == room.read("a.exr"), "{}", state["command"]);
}

/// The scene is that of the changed file, its pilot renders are repeated, and an edit that it has no use for
/// is dropped.
#[test]
#[cfg(unix)]
fn a_scene_that_is_read_again_settles_to_the_picture_of_its_command() {
    let room = Room::new();
    std::fs::create_dir(room.path("out")).unwrap();
    room.write_scene("scene.gltf", &scene());
    let options = ["--size", "20x12", "--quality", "draft", "--out", "out", "--card", "emulated:1"];
    let view = View::start(&room, "scene.gltf", &options);
    let mut page = view.connect();
    page.settle();
    page.send(&json!({"type": "set", "name": "floor.diffuse", "value": [0.7, 0.2, 0.1]}));
    page.send(&json!({"type": "set", "name": "lamp.emission", "value": 0.5}));
    let is_edited = |state: &Value| state["changes"].as_array().is_some_and(|changes| changes.len() == 2);
    page.wait("state", |state| state["settled"] == true && is_edited(state));
    let mut changed = scene();
    changed["materials"][0]["name"] = json!("ground");
    changed["nodes"][0]["scale"] = json!([1.0, 0.5, 2.0]);
    room.write_scene("scene.gltf", &changed);
    page.send(&json!({"type": "reload"}));
    let hello = page.wait_for("hello");
    assert_eq!(hello["scene"]["materials"][0]["name"], "ground");
    let state = page.settle();
    assert_eq!(state["changes"], json!([{"name": "lamp.emission", "value": 0.5}]));
    page.send(&json!({"type": "save", "name": "a.exr"}));
    page.wait_for("saved");
    let mut plain = vec!["render", "scene.gltf", "--size", "20x12", "--quality", "draft", "-o", "a.exr"];
    plain.extend(["--set", "lamp.emission=0.5"]);
    assert_eq!(room.run(&plain).status, Some(0));
    assert!(room.read("out/a.exr") == room.read("a.exr"), "{}", state["command"]);
}

#[test]
fn a_scene_that_cannot_be_read_again_stays() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    page.settle();
    room.write("scene.gltf", "{");
    page.send(&json!({"type": "reload"}));
    let error = page.wait_for("error");
    assert!(error["text"].as_str().unwrap().contains("scene.gltf"), "{error}");
    page.send(&camera(0.2, false));
    let state =
        page.wait("state", |state| state["settled"] == true && state["camera"]["position"][0] == json!(0.2));
    assert_eq!(state["refused"], json!(null));
    assert!(state["unread"].as_str().is_some_and(|reason| reason.contains("scene.gltf")), "{state}");
    let mut other = scene();
    other["cameras"][0]["name"] = json!("other");
    room.write_scene("scene.gltf", &other);
    page.send(&json!({"type": "reload"}));
    page.wait_for("hello");
    assert_eq!(page.settle()["unread"], json!(null));
}

/// The name of a camera that a page has chosen is dropped with the camera.
#[test]
fn a_scene_whose_chosen_camera_is_gone_is_seen_from_where_the_page_is() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    page.settle();
    let mut there = camera(0.2, false);
    there["name"] = json!("eye");
    page.send(&there);
    page.wait("state", |state| {
        state["settled"] == true
            && state["command"].as_str().is_some_and(|line| line.contains("--camera eye"))
    });
    let mut other = scene();
    other["cameras"][0]["name"] = json!("other");
    room.write_scene("scene.gltf", &other);
    page.send(&json!({"type": "reload"}));
    page.wait_for("hello");
    let state = page.settle();
    assert_eq!((&state["unread"], &state["camera"]["position"][0]), (&json!(null), &json!(0.2)));
}

/// A page states the lens, also that of a pinhole.
#[test]
fn a_page_states_the_lens() {
    let room = Room::new();
    let view = small_view(&room, &["--aperture", "0.5", "--focus", "1"]);
    let mut page = view.connect();
    let command = |page: &mut page::Page, lens: Value, said: &str| {
        let mut message = camera(0.2, false);
        message["lens"] = lens;
        page.send(&message);
        page.wait("state", |state| {
            state["settled"] == true && state["command"].as_str().is_some_and(|line| line.contains(said))
        });
    };
    command(&mut page, json!([0.25, 2.0]), "--aperture 0.25 --focus 2");
    command(&mut page, json!([0, 0]), "--aperture 0");
}

#[test]
fn pictures_are_refined_from_coarse_to_fine_and_follow_edits() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    page.settle();
    let lit = page.mean([20, 12]);
    page.steps.clear();
    page.send(&json!({"type": "set", "name": "lamp.emission", "value": 0.25}));
    let state = page.settle();
    let dark = page.mean([20, 12]);
    assert!((0.2..0.3).contains(&(dark / lit)), "{dark} of {lit}");
    let mut steps: Vec<u32> = page
        .steps
        .iter()
        .filter(|(version, _)| *version == state["version"])
        .map(|(_, step)| *step)
        .collect();
    steps.dedup();
    // A page that is slow may miss coarse passes.
    assert!(steps.is_sorted_by(|a, b| a > b) && steps.last() == Some(&1), "{steps:?}");
    assert_eq!(state["changes"], json!([{"name": "lamp.emission", "value": 0.25}]));
    page.send(&json!({"type": "pick", "at": [10, 8]}));
    let picked = page.wait_for("picked");
    assert!(
        picked["point"][1].as_f64().unwrap().abs() < 0.1 && picked["depth"].as_f64().unwrap() > 1.0,
        "{picked}"
    );
    page.send(&json!({"type": "reset"}));
    assert_eq!(page.settle()["changes"], json!([]));
    assert!((page.mean([20, 12]) - lit).abs() < 1e-6);
}

/// A page states the projection; the settled picture is that of the command that the view shows.
#[test]
fn a_page_sees_by_every_projection() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    page.settle();
    // The rows of pixels show the middle of the floor.
    for (shown, option, row) in [
        (json!({"height": 1.5}), "--orthographic 1.5", 8),
        (json!({"angles": [180, 90]}), "--panorama 180,90", 6),
        (json!({"fov": 50}), "--fov 50", 7),
    ] {
        let mut message = camera(0.25, false);
        let fields = message.as_object_mut().unwrap();
        fields.remove("fov");
        fields.extend(shown.as_object().unwrap().clone());
        page.send(&message);
        let state = page.settle();
        assert!(state["command"].as_str().unwrap().contains(option), "{}", state["command"]);
        let (key, value) = shown.as_object().unwrap().iter().next().unwrap();
        let numbers = |value: &Value| -> Vec<f64> {
            value
                .as_array()
                .map_or(vec![value.clone()], Clone::clone)
                .iter()
                .filter_map(Value::as_f64)
                .collect()
        };
        let [known, stated] = [numbers(&state["camera"][key]), numbers(value)];
        assert!(known.iter().zip(&stated).all(|(known, stated)| (known - stated).abs() < 1e-3), "{known:?}");
        assert_eq!(known.len(), stated.len());
        page.send(&json!({"type": "pick", "at": [9, row]}));
        let picked = page.wait_for("picked");
        let height = picked["point"][1].as_f64().unwrap_or_else(|| panic!("{option}: {picked}"));
        assert!(height.abs() < 0.25, "{option}: {picked} is not near the floor");
    }
    page.send(&json!({"type": "camera", "position": [0, 0, 3], "look_at": [0, 0, 0], "angles": [400, 90], "moving": false}));
    let error = page.wait_for("error");
    assert!(error["text"].as_str().unwrap().contains("360"), "{error}");
}

#[test]
fn an_edit_that_removes_all_light_is_refused() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    let version = page.settle()["version"].clone();
    page.send(&json!({"type": "set", "name": "lamp.emission", "value": 0, "id": 7}));
    let error = page.wait_for("error");
    assert!(error["text"].as_str().unwrap().contains("light") && error["id"] == 7, "{error}");
    page.send(&camera(0.5, false));
    assert_eq!(page.settle()["version"], version.as_u64().unwrap() + 1);
}

#[test]
fn settings_that_no_card_can_hold_are_named_and_change_nothing() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    let before = page.settle();
    for (name, value, option) in [
        ("gather_rays", u32::MAX, "--gather-rays"),
        ("spp", 0, "--spp"),
        ("spp", 5000, "--spp"),
        ("tile", 100, "--tile"),
    ] {
        page.send(&json!({"type": "setting", "name": name, "value": value}));
        let error = page.wait_for("error");
        assert!(error["text"].as_str().unwrap().contains(option), "{error}");
    }
    page.send(&camera(0.2, false));
    let after = page.settle();
    assert_eq!(after["settings"], before["settings"]);
    assert_eq!(after["version"], before["version"].as_u64().unwrap() + 1);
    page.send(&json!({"type": "setting", "name": "gather_rays", "value": 3}));
    assert_eq!(page.settle()["settings"]["gather_rays"], 3);
}

#[test]
fn only_one_of_two_pages_steers() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut first = view.connect();
    assert_eq!(first.wait_for("hello")["steers"], true);
    let mut second = view.connect();
    assert_eq!(second.wait_for("hello")["steers"], false);
    first.settle();
    second.settle();
    second.send(&camera(0.3, false));
    assert!(second.wait_for("error")["text"].as_str().unwrap().contains("take over"));
    second.send(&json!({"type": "steer"}));
    assert_eq!([&mut first, &mut second].map(|page| page.wait_for("steers")["value"].clone()), [false, true]);
    second.send(&camera(0.3, false));
    let states = [first.settle(), second.settle()];
    assert_eq!(states[0], states[1]);
    // Squares of coarse passes, which a slow page may miss, extend beyond the picture.
    for (place, pixel) in first.pixels.iter().filter(|((x, y), _)| *x < 20 && *y < 12) {
        assert_eq!(second.pixels.get(place), Some(pixel), "{place:?}");
    }
    drop(second);
    assert_eq!(first.wait_for("steers")["value"], true);
}

#[test]
#[cfg(unix)]
fn a_card_that_dies_and_comes_back_is_shown_and_used() {
    let room = Room::new();
    let card = Emulator::start(&room, "unix:card", &[]);
    room.write_scene("scene.gltf", &scene());
    let options: Vec<&str> =
        SMALL.iter().copied().filter(|word| !["--card", "emulated:1"].contains(word)).collect();
    let view = View::start(&room, "scene.gltf", &[&options, &["--card", card.address.as_str()][..]].concat());
    let mut page = view.connect();
    page.settle();
    let before = page.mean([20, 12]);
    drop(card);
    let is = |state: &'static str| move |message: &Value| message["cards"][0]["state"] == state;
    page.send(&camera(0.4, false));
    page.wait("cards", is("lost"));
    assert!(page.wait_for("error")["text"].as_str().unwrap().contains("no card is left"));
    page.send(&json!({"type": "reset"}));
    let _ = std::fs::remove_file(room.path("card"));
    let _card = Emulator::start(&room, "unix:card", &[]);
    page.wait("cards", is("ready"));
    page.settle();
    assert!((page.mean([20, 12]) - before).abs() < 1e-6);
}

#[test]
fn reasons_for_not_saving_a_picture_are_plain_text() {
    let room = Room::new();
    std::fs::create_dir(room.path("out")).unwrap();
    let view = small_view(&room, &["--out", "out"]);
    let mut page = view.connect();
    page.settle();
    std::fs::remove_dir(room.path("out")).unwrap();
    for name in ["a.exr", "a.png"] {
        page.send(&json!({"type": "save", "name": name}));
        let error = page.wait_for("error");
        let text = error["text"].as_str().unwrap();
        assert!(text.starts_with("cannot write") && text.contains(name) && !text.contains('\n'), "{text}");
    }
}

#[test]
fn impossible_options_are_refused_at_once() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    for (options, said) in [
        (&["--listen", view.host.as_str()][..], "--listen 127.0.0.1:0"),
        (&["--listen", "127.0.0.1"], "--listen"),
        (&["--listen", "127.0.0.1:0", "--crop", "0,1,0,1"], "--crop"),
        (&["--listen", "127.0.0.1:0", "--size", "5000x5000"], "4194304"),
        (&["--listen", "127.0.0.1:0", "--size", "5000x1"], "4096"),
        (&["--listen", "127.0.0.1:0", "--trace", "trace.gz"], "--trace"),
        (&["--listen", "127.0.0.1:0", "--out", "absent"], "absent"),
        (&["--listen", "127.0.0.1:0", "--set", "flor.alpha=1"], "'floor'"),
        (&["--listen", "127.0.0.1:0", "--spp", "0"], "--spp"),
        (&["--listen", "127.0.0.1:0", "--tile", "1000"], "--tile"),
    ] {
        let outcome = room.run(&[&["view", "scene.gltf"], options].concat());
        assert!(
            matches!(outcome.status, Some(1 | 2)) && outcome.stderr.contains(said),
            "{options:?}: {}",
            outcome.stderr
        );
    }
}

/// Instead of a browser, a script named `xdg-open` is started; `sh` reads the output of the view.
#[test]
#[cfg(target_os = "linux")]
fn open_opens_the_page_and_other_addresses_come_with_a_warning() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    std::fs::create_dir(room.path("bin")).unwrap();
    room.write("bin/xdg-open", "#!/bin/sh\necho \"$@\" > opened.part && mv opened.part opened\n");
    assert!(
        Command::new("chmod")
            .args(["+x", "bin/xdg-open"])
            .current_dir(room.path("."))
            .status()
            .unwrap()
            .success()
    );
    let path = std::env::join_paths(
        std::iter::once(room.path("bin")).chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())),
    );
    for (address, is_warned) in [("127.0.0.1:0", false), ("0.0.0.0:0", true)] {
        let mut command = room.command();
        command
            .args(["view", "scene.gltf", "--open", "--listen", address])
            .env("PATH", path.as_ref().unwrap());
        let [out, err] = ["out", "err"].map(|name| std::fs::File::create(room.path(name)).unwrap());
        let mut view = command.args(SMALL).stdout(out).stderr(err).spawn().unwrap();
        let mut opened = None;
        for _ in 0..1000 {
            opened = std::fs::read_to_string(room.path("opened")).ok();
            if opened.is_some() {
                break;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        view.kill().and_then(|()| view.wait()).unwrap();
        let [said, warned] = ["out", "err"].map(|name| String::from_utf8(room.read(name)).unwrap());
        assert_eq!(opened.as_ref(), Some(&said), "{warned}");
        assert!(said.starts_with("http://") && said.contains("/?token="), "{said}");
        assert_eq!(warned.contains("warning: other machines can reach 0.0.0.0:"), is_warned, "{warned}");
        std::fs::remove_file(room.path("opened")).unwrap();
    }
}

/// A signal ends the view within a short time, whatever the view is doing.
#[test]
#[cfg(unix)]
fn an_interrupt_ends_the_view() {
    let room = Room::new();
    let mut view = small_view(&room, &[]);
    let mut page = view.connect();
    page.wait_for("hello");
    let id = view.process.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    for _ in 0..500 {
        if let Some(status) = view.process.try_wait().unwrap() {
            assert_eq!(status.code(), Some(130));
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("the view goes on");
}
