//! Pictures of prepared scenes equal those of the glTF file, byte for byte.

use crate::support::{Outcome, Room, mirrored_cornell, shipped};

fn refused(outcome: &Outcome, words: &[&str]) {
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    assert_eq!(outcome.stdout, "");
    for word in words {
        assert!(outcome.stderr.contains(word), "{word:?} is not in: {}", outcome.stderr);
    }
}

fn done(outcome: &Outcome) {
    assert_eq!((outcome.status, &*outcome.stdout), (Some(0), ""), "{}", outcome.stderr);
}

/// Prepares the glossy box with few photons and rays.
fn prepare(room: &Room) {
    let scene = shipped("cornell-glossy.gltf");
    done(&room.run(&["prepare", &scene, "-o", "scene.card", "--quality", "paper", "--photons", "300"]));
}

#[test]
fn a_picture_of_a_prepared_scene_equals_that_of_the_scene() {
    // `photoncard prepare` takes the options of scene, photons, rays and quality; those of the picture are
    // also needed by the quality's pilot, and stated again to `photoncard render`.
    for (prepared, picture) in [
        (
            &[
                "--quality",
                "draft",
                "--photons",
                "900",
                "--environment",
                "0.1,0.2,0.3",
                "--light-groups",
                "sky=environment",
            ][..],
            &["--size", "24x20", "--aov", "all", "--transparent", "--camera-at", "0.1,0.2,3"][..],
        ),
        (
            &[
                "--quality",
                "paper",
                "--photons",
                "900",
                "--gather-rays",
                "5",
                "--seed",
                "3",
                "--set",
                "white.diffuse=0.3,0.1,0.5",
            ],
            &["--size", "20x20", "--crop", "3,17,0,9", "--filter", "gaussian"],
        ),
        (
            &[
                "--quality",
                "paper",
                "--photons",
                "900",
                "--sky",
                "52.5,13.4,2026-06-21T09:00+02:00",
                "--north",
                "30",
            ],
            &["--size", "16x16"],
        ),
    ] {
        let room = Room::new();
        room.write_scene("mirrored.gltf", &mirrored_cornell());
        let whole = [&["render", "mirrored.gltf", "-o", "a.exr", "-o", "a.png"], prepared, picture].concat();
        done(&room.run(&whole));
        done(
            &room.run(
                &[&["prepare", "mirrored.gltf", "-o", "it.card", "--quiet"], prepared, picture].concat(),
            ),
        );
        let outcome =
            room.run(&[&["render", "--prepared", "it.card", "-o", "b.exr", "-o", "b.png"], picture].concat());
        done(&outcome);
        assert!(outcome.stderr.contains("mirrored.gltf with 900 photons, prepared"), "{}", outcome.stderr);
        assert!(room.read("b.exr") == room.read("a.exr"), "{prepared:?}");
        assert!(room.read("b.png") == room.read("a.png"), "{prepared:?}");
        for part in ["1/2", "2/2"] {
            let name = format!("c.{}.part", &part[..1]);
            let own = ["render", "it.card", "--prepared", "--part", part, "-o", &name];
            done(&room.run(&[&own[..], picture].concat()));
        }
        done(&room.run(&["merge", "c.2.part", "c.1.part", "-o", "c.exr"]));
        assert!(room.read("c.exr") == room.read("a.exr"), "{prepared:?}");
    }
}

#[test]
fn mattes_of_a_scene_that_was_prepared_without_them_are_refused_with_a_remedy() {
    let room = Room::new();
    prepare(&room);
    let outcome = room.run(&["render", "scene.card", "--prepared", "-o", "a.exr", "--aov", "Z,object"]);
    refused(&outcome, &["--aov", "Z,object", "prepare the scene with these layers"]);
    assert_eq!(room.names(), ["scene.card"]);
}

/// Options of small frames.
const FRAMES: [&str; 8] = ["--quality", "paper", "--photons", "300", "--gather-rays", "4", "--fps", "12"];

#[test]
fn frames_of_a_prepared_scene_equal_those_of_the_scene() {
    let moving = shipped("cornell-moving.glb");
    for (animation, frames, card, files) in [
        // Only cameras move: all frames share one file.
        ("pan", "3-5,20", "one.card", &["one.card"][..]),
        ("pan", "3-5,20", "s.##.card", &["s.03.card"]),
        // Meshes and lights move until frame 24: each frame up to it has a file.
        ("play", "22-26", "s.###.card", &["s.022.card", "s.023.card", "s.024.card"]),
    ] {
        let room = Room::new();
        let of_frames = ["--frames", frames, "--animation", animation];
        let own = ["render", &moving, "-o", "a.##.exr", "-o", "a.##.png", "--size", "9x8"];
        done(&room.run(&[&own[..], &of_frames, &FRAMES].concat()));
        let whole = room.names();
        let own = ["prepare", &moving, "-o", card, "--size", "9x8"];
        done(&room.run(&[&own[..], &of_frames, &FRAMES].concat()));
        let cards: Vec<String> = room.names().into_iter().filter(|name| name.ends_with("card")).collect();
        assert_eq!(cards, files);
        let own = ["render", "--prepared", card, "--size", "9x8", "--card", "emulated:2", "--frames"];
        for frames in [&frames[..2], frames] {
            let frames = frames.trim_end_matches('-');
            done(&room.run(&[&own[..], &[frames, "-o", "b.##.exr", "-o", "b.##.png"]].concat()));
        }
        for name in &whole {
            assert!(room.read(name) == room.read(&name.replacen('a', "b", 1)), "{animation}: {name}");
        }
        let outcome = room.run(&[&own[..], &["1", "-o", "c.#.exr"]].concat());
        refused(&outcome, &["has no frame 1", "photoncard prepare"]);
        let last = files.last().unwrap();
        let outcome = room.run(&["render", "--prepared", last, "--size", "9x8", "-o", "c.exr"]);
        refused(&outcome, &["scene of frames", "--frames"]);
        let outcome = room.run(&[&own[..], &["25", "-o", "c.#.exr", "--fps", "12"]].concat());
        refused(&outcome, &["--fps", "state it to photoncard prepare"]);
    }
}

#[test]
fn frames_whose_meshes_move_have_files_of_their_own() {
    let room = Room::new();
    let own = ["prepare", &shipped("cornell-moving.glb"), "-o", "a.card", "--animation", "play"];
    refused(&room.run(&[&own[..], &["--frames", "1-2"], &FRAMES].concat()), &["a.card is one file", "####"]);
    done(&room.run(&[&own[..], &["--frames", "2"], &FRAMES].concat()));
    assert_eq!(room.names(), ["a.card"]);
    let own = ["prepare", &shipped("cornell.gltf"), "-o", "b.card", "--frames", "1"];
    refused(&room.run(&own), &["no animations"]);
}

#[test]
fn options_of_the_preparation_are_refused_with_a_remedy() {
    let room = Room::new();
    prepare(&room);
    for option in [
        ["--photons", "100"],
        ["--quality", "draft"],
        ["--seed", "0"],
        ["--spp", "4"],
        ["--set", "white.diffuse=0,0,0"],
        ["--environment", "1,1,1"],
        ["--sky", "0,0,2026-06-21T12:00Z"],
        ["--time", "1s"],
    ] {
        let outcome =
            room.run(&[&["render", "--prepared", "scene.card", "-o", "a.exr"], &option[..]].concat());
        refused(&outcome, &["--prepared", option[0], "state it to photoncard prepare"]);
    }
    let outcome = room.run(&["render", "--prepared", "scene.card", "-o", "a.exr", "--photons-for", "camera"]);
    refused(&outcome, &["--prepared", "--photons-for"]);
    assert!(!outcome.stderr.contains("photoncard prepare"), "{}", outcome.stderr);
    let absent = room.run(&["render", "--prepared", "scene.card", "-o", "a.exr", "--camera", "other"]);
    refused(&absent, &["other"]);
    assert_eq!(room.names(), ["scene.card"]);
}

#[test]
fn files_that_are_no_prepared_scene_are_refused() {
    let room = Room::new();
    prepare(&room);
    let bytes = room.read("scene.card");
    let refuses = |words: &[&str]| {
        let outcome = room.run(&["render", "--prepared", "scene.card", "--size", "8x8", "-o", "a.exr"]);
        refused(&outcome, &[&["scene.card", "help:"], words].concat());
    };
    room.write("scene.card", &bytes[..bytes.len() - 128]);
    refuses(&["is damaged", "cut off", "prepare the scene again"]);
    let last = bytes.len() - 5;
    room.write("scene.card", [&bytes[..last], &[bytes[last] ^ 1], &bytes[last + 1..]].concat());
    refuses(&["is damaged", "another checksum"]);
    room.write("scene.card", std::fs::read(shipped("cornell.gltf")).unwrap());
    refuses(&["no prepared scene", "leave --prepared out"]);
    std::fs::remove_file(room.path("scene.card")).unwrap();
    refuses(&["cannot read"]);
    refused(&room.run(&["prepare", "absent.gltf", "-o", "scene.card"]), &["absent.gltf"]);
    let cornell = shipped("cornell.gltf");
    refused(&room.run(&["prepare", &cornell, "-o", &cornell]), &["it is the scene as well"]);
    assert!(room.names().is_empty());
}
