//! Parts of a picture, and their merge.

use std::process::Command;

use crate::support::{Outcome, Room, shipped};

/// Options of a picture with 16 patches, the squares of pixels that are dealt to the parts.
const PICTURE: [&str; 10] =
    ["--size", "64x48", "--crop", "3,64,0,47", "--photons", "800", "--gather-rays", "8", "--spp", "2"];

fn refused(outcome: &Outcome, words: &[&str]) {
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    for word in words {
        assert!(outcome.stderr.contains(word), "{word:?} is not in: {}", outcome.stderr);
    }
}

/// Renders a part. `options` replace or extend those of the picture.
fn part(room: &Room, options: &[&str], part: &str, name: &str) -> Outcome {
    let own = ["--part", part, "-o", name];
    room.render(&shipped("cornell-glossy.gltf"), &[&PICTURE, options, &own].concat())
}

fn merged(room: &Room, arguments: &[&str]) -> Outcome {
    let outcome = room.run(&[&["merge"], arguments].concat());
    assert_eq!((outcome.status, &*outcome.stdout), (Some(0), ""), "{arguments:?}: {}", outcome.stderr);
    outcome
}

#[test]
fn the_merged_picture_equals_the_file_of_one_render() {
    for options in [
        &["--quality", "draft", "--aov", "all", "--transparent"][..],
        &["--irradiance-cache", "off", "--seed", "5"],
    ] {
        let room = Room::new();
        let whole = [&PICTURE, options, &["-o", "whole.exr", "-o", "whole.png"]].concat();
        room.rendered(&shipped("cornell-glossy.gltf"), &whole);
        // Parts are rendered on different cards, in different orders, with different tiles.
        for (number, own) in [
            ("1/3", &["--card", "emulated:1", "--order", "naive"][..]),
            ("2/3", &["--card", "emulated-micro:2", "--tile", "5"]),
            ("3/3", &["--order", "hash"]),
        ] {
            let name = format!("a.{}.part", &number[..1]);
            let outcome = part(&room, &[options, own].concat(), number, &name);
            assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        }
        let parts = ["a.2.part", "a.3.part", "a.1.part", "a.2.part"];
        merged(&room, &[&parts[..], &["-o", "merged.exr", "-o", "merged.png"]].concat());
        assert!(room.read("merged.exr") == room.read("whole.exr"), "{options:?}");
        assert!(room.read("merged.png") == room.read("whole.png"), "{options:?}");
        // No partial and no temporary file is left behind.
        assert_eq!(room.names().len(), 7, "{:?}", room.names());
    }
}

#[test]
fn a_part_of_a_retried_task_has_equal_bytes() {
    let room = Room::new();
    let [first, second] = [(); 2].map(|()| {
        assert_eq!(part(&room, &[], "1/2", "a.1.part").status, Some(0));
        room.read("a.1.part")
    });
    assert!(first == second);
}

#[test]
fn a_part_without_pixels_is_merged() {
    let room = Room::new();
    for number in 1..=9 {
        let own = ["--size", "70x9", "--part", &format!("{number}/9"), "-o", &format!("{number}.part")];
        room.rendered(&shipped("cornell-glossy.gltf"), &own);
    }
    let names: Vec<String> = (1..=9).map(|number| format!("{number}.part")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    merged(&room, &[&names[..], &["-o", "merged.exr"]].concat());
}

#[cfg(unix)]
#[test]
fn the_printed_commands_render_missing_parts() {
    let room = Room::new();
    let folder = room.path("a folder's");
    std::fs::create_dir(&folder).unwrap();
    std::fs::copy(shipped("cornell.gltf"), folder.join("it.gltf")).unwrap();
    let options = [&PICTURE[..], &["-o", "a folder's/p02.part", "--part=2/3"]].concat();
    room.rendered("a folder's/it.gltf", &options);
    room.write("out.exr", "old picture");
    let outcome = room.run(&["merge", "a folder's/p02.part", "-o", "out.exr"]);
    refused(&outcome, &["2 of 3 parts are missing: 1/3, 3/3", "help: render them"]);
    assert_eq!(room.read("out.exr"), b"old picture");
    let commands: Vec<&str> = outcome.stderr.lines().filter(|line| line.starts_with("photoncard ")).collect();
    assert_eq!(commands.len(), 2, "{}", outcome.stderr);
    for command in commands {
        let program = env!("CARGO_BIN_EXE_photoncard");
        let script = format!("photoncard() {{ '{program}' \"$@\"; }}\n{command}");
        let ended = Command::new("sh").args(["-c", &script]).current_dir(room.path("")).output().unwrap();
        assert!(ended.status.success(), "{command}: {}", String::from_utf8_lossy(&ended.stderr));
    }
    let parts = ["a folder's/p01.part", "a folder's/p02.part", "a folder's/p03.part"];
    merged(&room, &[&parts[..], &["-o", "out.exr"]].concat());
}

#[test]
fn differences_and_damage_are_named() {
    let room = Room::new();
    assert_eq!(part(&room, &[], "1/2", "a.part").status, Some(0));
    for (options, words) in [
        (&["--spp", "4"][..], "parts differ in spp: 2 in a.part, 4 in b.part"),
        (&["--set", "white.diffuse=0.1,0.1,0.1"], "; scene-checksum: "),
        (&["--aov", "none"], "layers: albedo,N,Z in a.part, none in b.part"),
    ] {
        let given: Vec<&str> = if options[0] == "--spp" {
            vec!["--size", "64x48", "--crop", "3,64,0,47", "--photons", "800", "--gather-rays", "8"]
        } else {
            PICTURE.to_vec()
        };
        let own = [&given[..], options, &["--part", "2/2", "-o", "b.part"]].concat();
        room.rendered(&shipped("cornell-glossy.gltf"), &own);
        refused(
            &room.run(&["merge", "a.part", "b.part", "-o", "out.exr"]),
            &[words, "help: render all parts"],
        );
    }
    let bytes = room.read("a.part");
    room.write("b.part", &bytes[..bytes.len() - 7]);
    refused(&room.run(&["merge", "a.part", "b.part", "-o", "out.exr"]), &["b.part is damaged", "cut off"]);
    refused(&room.run(&["merge", "absent.part", "-o", "out.exr"]), &["cannot read absent.part"]);
    refused(&room.run(&["merge", "a.part", "-o", "a.part"]), &["a file OUT.part is a part"]);
    assert_eq!(room.names(), ["a.part", "b.part"]);
}

#[test]
fn parts_are_written_to_part_files_only() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    for (options, words) in [
        (
            &["--part", "1/2", "-o", "a.exr"][..],
            ["1/2 of a picture is written to one file OUT.part", "help: give -o"],
        ),
        (&["--part", "1/2", "-o", "a.part", "-o", "b.exr"], ["one file OUT.part", "help: give -o"]),
        (&["-o", "a.part"], ["OUT.part is a part of a picture", "help: give --part K/N"]),
        (&["--part", "3/2", "-o", "a.part"], ["a part is K/N", "3/8"]),
        (&["--part", "1/2", "-o", "a.part", "--time", "3s"], ["--part", "--time"]),
        (&["--part", "1/2", "-o", "a.part", "--keep-samples"], ["--part", "--keep-samples"]),
    ] {
        refused(&room.render(&cornell, options), &words);
    }
    assert!(room.names().is_empty());
}
