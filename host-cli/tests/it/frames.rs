//! Frames of animations. Each frame equals the picture of a command for this frame alone. If only the camera
//! moves, nothing of the card image is sent again.

use crate::support::{Outcome, Room, scene_bytes, scene_of, shipped};
use serde_json::{Value, json};

/// Renders frames of the Cornell box whose camera, meshes and lights move.
fn moving(room: &Room, options: &[&str]) -> Outcome {
    room.rendered(&shipped("cornell-moving.glb"), options)
}

fn statistics(room: &Room, name: &str) -> Value {
    serde_json::from_slice(&room.read(name)).expect("JSON")
}

/// Bytes of the card image that each card received for a frame.
fn sent(statistics: &Value) -> Vec<u64> {
    let bytes = statistics["link"]["image_bytes"].as_array().expect("a list");
    bytes.iter().map(|bytes| bytes.as_u64().expect("a number")).collect()
}

/// Small scene with an animation of its camera's position from 0 to 1 s.
fn walk() -> Value {
    let mut bytes = scene_bytes();
    let keys: [[f32; 4]; 2] = [[0.0, 1.0, 0.0, 0.5], [3.0, 0.5, 1.0, 2.0]];
    let start = bytes.len();
    bytes.extend(keys.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
    let mut scene = scene_of(&bytes);
    let views = scene["bufferViews"].as_array_mut().expect("a list");
    views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": 32}));
    let accessors = scene["accessors"].as_array_mut().expect("a list");
    accessors.push(json!({"bufferView": 2, "componentType": 5126, "count": 2, "type": "SCALAR"}));
    accessors
        .push(json!({"bufferView": 2, "byteOffset": 8, "componentType": 5126, "count": 2, "type": "VEC3"}));
    scene["animations"] = json!([{
        "name": "walk",
        "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}],
        "samplers": [{"input": 3, "output": 4}]
    }]);
    scene
}

#[test]
fn a_moving_camera_takes_one_photon_pass_and_one_load() {
    let room = Room::new();
    // On links with faults, cards do not take the image by reference.
    let options = ["--animation", "pan", "--frames", "3-6", "--card", "emulated:1", "--faults", "seed=1"];
    moving(&room, &[&options[..], &["-o", "a.#.exr", "--stats", "a.##.json"]].concat());
    let first = statistics(&room, "a.03.json");
    assert!(sent(&first)[0] > 0, "{first}");
    assert!(first["time_s"]["photons"].as_f64() > Some(0.0));
    for name in ["a.04.json", "a.05.json", "a.06.json"] {
        let later = statistics(&room, name);
        assert_eq!(sent(&later), [0], "{name}");
        for phase in ["pilot", "hierarchy", "photons", "photon_map", "discs", "pack"] {
            assert_eq!(later["time_s"][phase], 0.0, "{name}: {phase}");
        }
        assert_eq!(later["image_bytes"], first["image_bytes"]);
        assert_eq!(later["photon_paths"], first["photon_paths"]);
    }
}

/// A card may receive the card image only in a later frame, after the other cards have rendered the frames
/// before.
#[test]
fn no_card_is_loaded_twice_for_cameras_that_move() {
    let room = Room::new();
    let options = "--animation pan --frames 1-9 --card emulated:3 --tile 2 --faults seed=1";
    let options: Vec<_> = options.split(' ').collect();
    moving(&room, &[&options[..], &["-o", "a.#.exr", "--stats", "a.#.json"]].concat());
    let frames: Vec<_> = (1..=9).map(|frame| statistics(&room, &format!("a.{frame}.json"))).collect();
    let image = frames[0]["image_bytes"].as_u64().expect("a number");
    for card in 0..3 {
        let loaded: u64 = frames.iter().map(|frame| sent(frame)[card]).sum();
        // If a frame ends during a load, the load continues in the next frame and repeats its last chunk of
        // lines.
        assert!(loaded < 2 * image, "card {card}: {loaded} bytes of an image of {image}");
    }
}

/// A quality chooses settings for the scene without animation: frames of different machines therefore match.
#[test]
fn a_frame_is_the_same_after_others_and_alone_on_other_cards() {
    let room = Room::new();
    for (animation, quality, frames) in [
        ("play", "paper", &["00", "06", "12", "40"][..]),
        ("pan", "draft", &["06"]),
        ("play", "draft", &["40"]),
    ] {
        let of = |options: &[&str]| {
            let fitted = ["--animation", animation, "--quality", quality];
            let small = ["--spp", "1", "--gather-rays", "4", "--shadow-rays", "1"];
            moving(&room, &[&fitted[..], &small, options].concat())
        };
        of(&["--frames", "0-12x6,40", "-o", "a.##.exr", "-o", "a.##.png"]);
        for frame in frames {
            let options =
                ["--frames", frame, "-o", "b.##.exr", "-o", "b.##.png", "--card", "emulated-micro:3"];
            of(&options);
            for ending in ["exr", "png"] {
                let [one, other] = ["a", "b"].map(|name| room.read(&format!("{name}.{frame}.{ending}")));
                assert!(one == other, "{animation} {quality} {frame}.{ending}");
            }
        }
        assert!(room.read("a.00.png") != room.read("a.06.png"), "{animation} moves");
    }
}

#[test]
fn a_frame_of_a_walk_is_the_picture_from_the_cameras_place() {
    let room = Room::new();
    room.write_scene("walk.gltf", &walk());
    room.rendered("walk.gltf", &["--frames", "0-48x12", "-o", "walk.##.exr"]);
    for (frame, place) in [("00", "0,0.5,3"), ("12", "0.25,0.75,2.5"), ("24", "0.5,1,2"), ("48", "0.5,1,2")] {
        room.rendered("walk.gltf", &["--camera-at", place, "-o", "there.exr"]);
        let found = room.run(&["diff", "there.exr", &format!("walk.{frame}.exr")]);
        let found: Value = serde_json::from_str(&found.stdout).expect("JSON");
        assert_eq!(found["pixels"]["mse"], 0.0, "{frame}: {found}");
    }
}

#[test]
fn unchanged_lines_are_not_sent_again() {
    let room = Room::new();
    let names = ["-o", "a.#.png", "--stats", "a.#.json", "--card", "emulated:1", "--faults", "seed=1"];
    moving(&room, &[&["--animation", "play", "--frames", "47,60,61"][..], &names].concat());
    // The animation ends at frame 48: frames 60 and 61 are equal.
    let bytes = ["a.47.json", "a.60.json", "a.61.json"].map(|name| sent(&statistics(&room, name)));
    assert!(bytes[..2].iter().flatten().all(|&bytes| bytes > 0), "{bytes:?}");
    assert!(bytes[2].iter().all(|&bytes| bytes == 0), "{bytes:?}");
}

#[test]
fn assignments_and_the_environment_apply_to_every_frame() {
    let room = Room::new();
    let of = |options: &[&str]| moving(&room, &[&["--animation", "play"][..], options].concat());
    let changes = ["--set", "white.diffuse=0.1,0.2,0.3", "--environment", "1,2,3"];
    of(&["--frames", "5", "-o", "plain.#.png"]);
    of(&[&["--frames", "4-5", "-o", "a.#.png"][..], &changes].concat());
    of(&[&["--frames", "5", "-o", "b.#.png"][..], &changes].concat());
    assert!(room.read("a.5.png") == room.read("b.5.png"));
    assert!(room.read("a.5.png") != room.read("plain.5.png"));
}

#[test]
fn each_frame_is_reported_with_its_cost() {
    let room = Room::new();
    let said = moving(
        &room,
        &["--animation", "pan", "--frames", "1-2", "-o", "out.####.png", "--card", "emulated:1"],
    )
    .stderr;
    assert!(said.contains("out.0001.png: frame 1, ") && said.contains("out.0002.png: frame 2, "), "{said}");
    assert!(said.contains(" 0 bytes sent in ") && said.contains("photoncard: 2 frames in "), "{said}");
    assert!(!said.contains("ignored"), "{said}");
    assert_eq!(room.names(), ["out.0001.png", "out.0002.png"]);
    let quiet = moving(&room, &["--frames", "1", "-o", "out.####.png", "--quiet"]).stderr;
    assert_eq!(quiet, "");
}

#[test]
fn statistics_and_provenance_name_the_frame() {
    let room = Room::new();
    let options = ["--animation", "pan", "--frames", "7", "--fps", "12.5", "-o", "a.#.exr", "--stats", "-"];
    let outcome = room.render(&shipped("cornell-moving.glb"), &options);
    let found: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
    let pixels = &found["provenance"]["pixels"];
    assert_eq!(
        [&pixels["frame"], &pixels["fps"], &pixels["animation"]],
        [&json!(7), &json!(12.5), &json!(["pan"])]
    );
}

/// A finished frame is not written again: its modification time stays. A frame with other settings or
/// formats, or with a damaged file, is rendered again.
#[test]
fn a_resumed_sequence_renders_unfinished_frames() {
    let scene = shipped("cornell-moving.glb");
    // The quality `paper` has no pilot, which would take four fifths of the time.
    let small = [
        ["--quality", "paper"],
        ["--size", "8x8"],
        ["--photons", "200"],
        ["--shadow-rays", "1"],
        ["--spp", "1"],
        ["--gather-rays", "4"],
    ];
    let small = small.as_flattened();
    for animation in ["pan", "play"] {
        let room = Room::new();
        let of = |options: &[&str]| {
            let own = ["render", &scene, "-o", "a.#.exr", "-o", "a.#.png", "--animation", animation];
            let outcome = room.run(&[&own[..], small, options].concat());
            assert_eq!(outcome.status, Some(0), "{options:?}: {}", outcome.stderr);
            (1..=3)
                .map(|frame| outcome.stderr.contains(&format!("frame {frame} is finished")))
                .collect::<Vec<_>>()
        };
        assert_eq!(of(&["--frames", "1-3", "--resume"]), [false; 3]);
        let read = || ["exr", "png"].map(|end| [1, 2, 3].map(|frame| room.read(&format!("a.{frame}.{end}"))));
        let whole = read();
        let again = |options: &[&str]| of(&[&["--frames", "1-3", "--resume"], options].concat());
        assert_eq!(again(&[]), [true; 3]);
        // A file of frame 1 is cut off, and one of frame 2 is missing.
        room.write("a.1.exr", &whole[0][0][..100]);
        std::fs::remove_file(room.path("a.2.png")).unwrap();
        assert_eq!(again(&[]), [false, false, true]);
        assert!(read() == whole, "{animation}");
        std::fs::copy(room.path("a.2.exr"), room.path("a.1.exr")).unwrap();
        assert_eq!(again(&[]), [false, true, true]);
        assert!(read() == whole, "{animation}");
        // Bytes behind the provenance are damaged.
        let mut flipped = whole[0][1].clone();
        let place = flipped.len() * 3 / 4;
        flipped[place] ^= 4;
        room.write("a.2.exr", &flipped);
        room.write("a.3.png", &whole[1][2][..whole[1][2].len() - 20]);
        assert_eq!(again(&[]), [true, false, false]);
        assert!(read() == whole, "{animation}");
        assert_eq!(of(&["--frames", "1-3"]), [false; 3]);
    }
    let room = Room::new();
    room.write("a.1.exr", []);
    for options in [
        &["--fps", "24"][..],
        &["--fps", "25"],
        &["--seed", "1"],
        &["--max-distance", "0.3"],
        &[],
        &["--near-distance", "0.3"],
        &[],
        &["--sample-type", "half"],
        &["--exposure", "1"],
        &["--aov", "Z"],
        &["--set", "white.diffuse=0.1,0.1,0.1"],
        &["--camera-at", "0,1,3"],
    ] {
        let own = ["render", &scene, "-o", "a.#.exr", "-o", "a.#.png", "--frames", "1", "--resume"];
        let is_finished = || {
            let outcome = room.run(&[&own[..], small, options].concat());
            assert_eq!(outcome.status, Some(0), "{options:?}: {}", outcome.stderr);
            outcome.stderr.contains("frame 1 is finished")
        };
        assert_eq!([is_finished(), is_finished()], [false, true], "{options:?}");
    }
}

/// Further samples have the settings that a pilot chose for the kept samples, whichever frames are finished.
#[test]
fn samples_of_frames_are_added_with_the_settings_of_the_kept_ones() {
    let room = Room::new();
    let of = |options: &[&str]| {
        let own = ["--quality", "draft", "--size", "8x8", "--photons", "200", "--animation", "pan"];
        let frames = ["--frames", "1-2", "-o", "a.#.exr", "--stats", "a.#.json", "--keep-samples"];
        let scene = shipped("cornell-moving.glb");
        let outcome = room.run(&[&["render", &scene], &own[..], &frames, options].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        outcome.stderr
    };
    let settings = |frame: u32| statistics(&room, &format!("a.{frame}.json"))["provenance"]["pixels"].clone();
    of(&["--spp", "2"]);
    let before = settings(2);
    assert!(!of(&["--spp", "4", "--resume"]).contains("is finished"));
    for frame in [1, 2] {
        let after = settings(frame);
        assert_eq!((&after["spp"], &after["gather-rays"]), (&json!(4), &before["gather-rays"]));
    }
    let said = of(&["--spp", "4", "--resume"]);
    assert_eq!(said.matches("is finished").count(), 2, "{said}");
}

#[test]
fn a_damaged_partial_picture_of_one_frame_stops_nothing_else() {
    let room = Room::new();
    room.write("a.2.exr.partial", "not of this program");
    let options = ["--frames", "1-3", "-o", "a.#.exr", "--animation", "pan"];
    let outcome = room.render(&shipped("cornell-moving.glb"), &options);
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("a.2.exr.partial"), "{}", outcome.stderr);
    assert_eq!(room.read("a.2.exr.partial"), b"not of this program");
    assert_eq!(room.names(), ["a.1.exr", "a.2.exr.partial"]);
}

#[test]
fn invalid_sequences_are_refused_before_any_work() {
    let room = Room::new();
    let moving = shipped("cornell-moving.glb");
    let still = shipped("cornell.gltf");
    for (scene, options, said) in [
        (&moving, &["--frames", "1-2", "-o", "a.exr"][..], "a.exr has no place for the number"),
        (
            &moving,
            &["--frames", "1", "-o", "a.#.exr", "--stats", "a.json"],
            "a.json has no place for the number",
        ),
        (&moving, &["--frames", "1", "-o", "#.exr", "-o", "1.exr"], "1.exr has no place for the number"),
        (&moving, &["--frames", "3", "-o", "a.#.exr", "-o", "a.##.exr", "-o", "a.#.exr"], "another output"),
        (&moving, &["--frames", "2-1", "-o", "a.#.exr"], "such as 1-240"),
        (&moving, &["--frames", "1", "--fps", "0", "-o", "a.#.exr"], "frames in a second"),
        (&moving, &["--fps", "24", "-o", "a.exr"], "--frames"),
        (&moving, &["--animation", "play", "-o", "a.exr"], "--frames"),
        (&moving, &["--frames", "1", "--time", "5", "-o", "a.#.exr"], "--time"),
        (&moving, &["--frames", "1", "--trace", "a.gz", "-o", "a.#.exr"], "--trace"),
        (&moving, &["--frames", "1", "--animation", "fly", "-o", "a.#.exr"], "'play', 'pan'"),
        (&still, &["--frames", "1", "-o", "a.#.exr"], "no animations"),
    ] {
        let outcome = room.render(scene, options);
        assert_eq!(outcome.status, Some(2), "{options:?}: {}", outcome.stderr);
        let text = outcome.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(said), "{options:?}: {text}");
        assert_eq!(room.names(), [""; 0], "{options:?}");
    }
}

#[test]
fn the_information_on_a_scene_lists_its_animations() {
    let room = Room::new();
    let path = shipped("cornell-moving.glb");
    let said = room.run(&["scene", "info", &path]).stdout;
    for line in
        ["Animations (2)", "play: 0 to 2 s, moves meshes or lights", "pan: 0 to 2 s, moves cameras alone"]
    {
        assert!(said.contains(line), "{said}");
    }
    let found: Value =
        serde_json::from_str(&room.run(&["scene", "info", &path, "--json"]).stdout).expect("JSON");
    assert_eq!(
        found["animations"][1],
        json!({"name": "pan", "seconds": [0.0, 2.0], "moves_only_cameras": true})
    );
}
