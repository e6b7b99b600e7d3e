//! Renders that end early because the card, its link or the host fails: finished tiles are kept.
#![cfg(unix)]

#[cfg(target_os = "linux")]
#[path = "../../src/hang_up.rs"]
mod hang_up;
use std::fs;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::support::{Emulator, Room, shipped};
use serde_json::Value;

/// Options of a picture with 64 tiles that takes a second or two, without a pilot.
const PICTURE: [&str; 10] = [
    "--quality",
    "paper",
    "--size",
    "128x128",
    "--photons",
    "2000",
    "--gather-rays",
    "20",
    "--shadow-rays",
    "4",
];
/// Size of a finished tile of 16x16 pixels in the partial file, bytes.
const TILE_BYTES: u64 = 8 + 24 + 60 * 256 + 4;

fn arguments<'a>(scene: &'a str, options: &[&'a str]) -> Vec<&'a str> {
    [&["render", scene, "-o", "a.exr"][..], &PICTURE, options].concat()
}

fn partial_bytes(room: &Room) -> u64 {
    fs::metadata(room.path("a.exr.partial")).map_or(0, |found| found.len())
}

/// Starts a render, and waits until its partial file has `tiles` tiles.
fn begun(room: &Room, options: &[&str], tiles: u64) -> Child {
    let cornell = shipped("cornell.gltf");
    let mut command = room.command();
    let mut host = command.args(arguments(&cornell, options)).stderr(Stdio::piped()).spawn().unwrap();
    while partial_bytes(room) < tiles * TILE_BYTES {
        assert_eq!(host.try_wait().unwrap(), None, "the render has ended");
        std::thread::sleep(Duration::from_millis(5));
    }
    host
}

/// Option of `kill` for the signal of a closed terminal, SIGHUP. If this process ignores SIGHUP, the signal
/// is SIGTERM.
fn hang_up() -> &'static str {
    #[cfg(target_os = "linux")]
    if hang_up::is_ignored() == Some(false) {
        return "-HUP";
    }
    "-TERM"
}

/// Bytes of the picture of a render that is not interrupted.
fn expected() -> Vec<u8> {
    let room = Room::new();
    let outcome = room.run(&arguments(&shipped("cornell.gltf"), &["--quiet"]));
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert_eq!(room.names(), ["a.exr"]);
    room.read("a.exr")
}

/// Resumes a render, and checks that it takes over tiles and gives the expected bytes.
fn resumes(room: &Room, options: &[&str], expected: &[u8]) {
    let options = [options, &["--resume"]].concat();
    let outcome = room.run(&arguments(&shipped("cornell.gltf"), &options));
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("tiles were rendered before"), "{}", outcome.stderr);
    assert!(room.read("a.exr") == expected);
    assert!(!room.names().contains(&"a.exr.partial".to_owned()));
}

#[test]
fn a_killed_host_loses_only_tiles_in_flight() {
    let expected = expected();
    let room = Room::new();
    let mut host = begun(&room, &[], 5);
    host.kill().unwrap();
    host.wait().unwrap();
    assert_eq!(room.names(), ["a.exr.partial"]);
    // The last tile in the partial file is incomplete.
    let mut bytes = room.read("a.exr.partial");
    bytes.truncate(bytes.len() - 100);
    room.write("a.exr.partial", &bytes);
    // Side and order of the tiles, and the kind of card, may differ.
    resumes(&room, &["--tile", "16", "--order", "hash", "--card", "emulated-micro:2"], &expected);
}

#[test]
fn only_a_render_with_equal_settings_is_resumed() {
    let room = Room::new();
    // A closed terminal ends a render as an interrupt does.
    let host = begun(&room, &["--stats", "a.json"], 1);
    assert!(Command::new("kill").args([hang_up(), &host.id().to_string()]).status().unwrap().success());
    let outcome = host.wait_with_output().unwrap();
    let said = String::from_utf8(outcome.stderr).unwrap();
    assert_eq!(outcome.status.code(), Some(130), "{said}");
    assert!(said.contains("finished tiles are kept in a.exr.partial; --resume goes on"), "{said}");
    let statistics: Value = serde_json::from_slice(&room.read("a.json")).unwrap();
    assert!(statistics["error"].as_str().is_some_and(|error| error.contains("stopped")), "{statistics}");
    assert!(statistics["rays"]["eye"].as_u64().is_some_and(|rays| rays > 0), "{statistics}");
    fs::remove_file(room.path("a.json")).unwrap();
    let kept = room.read("a.exr.partial");
    let cornell = shipped("cornell.gltf");
    let refused = |options: &[&str], words: &[&str]| {
        let outcome = room.run(&arguments(&cornell, &[options, &["--resume"]].concat()));
        assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
        assert!(words.iter().all(|word| outcome.stderr.contains(word)), "{words:?}: {}", outcome.stderr);
        assert_eq!(room.names(), ["a.exr.partial"]);
    };
    refused(&["--seed", "7", "--neighbors", "60"], &["seed was 0 and is 7", "neighbors was 100 and is 60"]);
    refused(&["--radiance", "precomputed"], &["radiance was", "precomputed"]);
    refused(&["--set", "white.diffuse=0.1,0.1,0.1"], &["scene-checksum was"]);
    assert!(room.read("a.exr.partial") == kept);
    // A render without `--resume` is refused while there are finished tiles, of this picture or another.
    for options in [&[][..], &["--seed", "7"], &["--quiet", "--order", "naive"]] {
        let outcome = room.run(&arguments(&cornell, options));
        assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
        for word in ["a.exr.partial has the finished tiles", "--resume", "remove the file"] {
            assert!(outcome.stderr.contains(word), "{word}: {}", outcome.stderr);
        }
        assert!(room.names() == ["a.exr.partial"] && room.read("a.exr.partial") == kept);
    }
    // A partial file without tiles is replaced. This render fails before it has any tile to keep.
    let head = kept.iter().position(|&byte| byte == 0x89).unwrap();
    room.write("a.exr.partial", &kept[..head]);
    let outcome = room.run(&arguments(&cornell, &["--seed", "7", "--card", "unix:absent"]));
    assert_eq!(outcome.status, Some(1), "{}", outcome.stderr);
    assert!(!outcome.stderr.contains("--resume goes on"), "{}", outcome.stderr);
    room.write("a.exr.partial", b"photoncard partial render 4\n{]\n\0\0\0\0");
    refused(&[], &["the settings in a.exr.partial are damaged", "remove the file"]);
    room.write("a.exr.partial", b"photoncard partial renders\n");
    refused(&[], &["is no partial render"]);
    room.write("a.exr.partial", b"photoncard partial render 1\n{}\n");
    refused(&[], &["of version 1", "the program that began it", "remove the file"]);
}

#[test]
fn files_without_finished_tiles_are_not_replaced() {
    use std::os::unix::fs::{FileTypeExt, symlink};
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let file = room.path("a.exr.partial");
    room.write("notes", "precious");
    let refused = |words: &[&str]| {
        for options in [&["--quiet"][..], &["--quiet", "--resume"]] {
            let outcome = room.run(&arguments(&cornell, options));
            assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
            for word in [&["a.exr.partial", "choose another output"], words].concat() {
                assert!(outcome.stderr.contains(word), "{word}: {}", outcome.stderr);
            }
            assert_eq!(room.names(), ["a.exr.partial", "notes"]);
            assert_eq!(room.read("notes"), b"precious");
        }
    };
    for foreign in [&b"something else"[..], b"x", &[0xff; 100]] {
        room.write("a.exr.partial", foreign);
        refused(&["is no partial render"]);
        assert_eq!(room.read("a.exr.partial"), foreign);
    }
    fs::remove_file(&file).unwrap();
    symlink("notes", &file).unwrap();
    refused(&["symbolic link"]);
    fs::remove_file(&file).unwrap();
    fs::hard_link(room.path("notes"), &file).unwrap();
    refused(&["hard link"]);
    fs::remove_file(&file).unwrap();
    assert!(Command::new("mkfifo").arg(&file).status().unwrap().success());
    refused(&["named pipe"]);
    assert!(fs::symlink_metadata(&file).unwrap().file_type().is_fifo());
}

#[test]
fn a_second_render_of_the_same_output_is_refused() {
    let room = Room::new();
    let mut host = begun(&room, &[], 1);
    for options in [&[][..], &["--resume"]] {
        let outcome = room.run(&arguments(&shipped("cornell.gltf"), options));
        assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains("another render is writing a.exr.partial"), "{}", outcome.stderr);
    }
    host.kill().unwrap();
    host.wait().unwrap();
}

#[test]
fn a_card_that_is_killed_leaves_its_tiles_to_the_other() {
    let expected = expected();
    let room = Room::new();
    let [dying, living] = ["tcp:", "unix:card"].map(|listen| Emulator::start(&room, listen, &[]));
    let host = begun(&room, &["--card", &dying.address, "--card", &living.address], 5);
    let address = dying.address.clone();
    dying.end("-KILL");
    let outcome = host.wait_with_output().unwrap();
    let said = String::from_utf8(outcome.stderr).unwrap();
    assert_eq!(outcome.status.code(), Some(0), "{said}");
    assert!(said.contains(&format!("({address}) is lost")), "{said}");
    assert!(room.read("a.exr") == expected);
}

#[test]
fn a_card_that_is_restarted_is_greeted_again() {
    let expected = expected();
    let room = Room::new();
    let living = Emulator::start(&room, "tcp:", &[]);
    let dying = Emulator::start(&room, "unix:card", &[]);
    let host = begun(&room, &["--card", &dying.address, "--card", &living.address], 5);
    dying.end("-KILL");
    let _reborn = Emulator::start(&room, "unix:card", &[]);
    let outcome = host.wait_with_output().unwrap();
    assert_eq!(outcome.status.code(), Some(0), "{}", String::from_utf8_lossy(&outcome.stderr));
    assert!(room.read("a.exr") == expected);
}

#[test]
fn a_card_that_freezes_leaves_its_tiles_to_the_other() {
    let expected = expected();
    let room = Room::new();
    let [frozen, living] = ["tcp:", "pty"].map(|listen| Emulator::start(&room, listen, &[]));
    let host = begun(&room, &["--card", &frozen.address, "--card", &living.address], 5);
    frozen.signal("-STOP");
    let outcome = host.wait_with_output().unwrap();
    frozen.signal("-CONT");
    let said = String::from_utf8(outcome.stderr).unwrap();
    assert_eq!(outcome.status.code(), Some(0), "{said}");
    assert!(room.read("a.exr") == expected);
}

#[test]
fn finished_tiles_are_kept_when_all_cards_fail() {
    let expected = expected();
    for (listen, options) in [("tcp:", ""), ("pty", ",wait=0")] {
        let room = Room::new();
        let card = Emulator::start(&room, listen, &[]);
        let address = format!("{}{options}", card.address);
        let host = begun(&room, &["--card", &address, "--stats", "a.json"], 5);
        card.end("-KILL");
        let outcome = host.wait_with_output().unwrap();
        let said = String::from_utf8(outcome.stderr).unwrap();
        assert_eq!(outcome.status.code(), Some(1), "{listen}: {said}");
        let statistics: Value = serde_json::from_slice(&room.read("a.json")).unwrap();
        assert!(statistics["error"].as_str().is_some_and(|error| error.contains("card")), "{statistics}");
        assert!(statistics["link"]["damaged_frames"].is_u64(), "{statistics}");
        fs::remove_file(room.path("a.json")).unwrap();
        assert!(said.contains("finished tiles are kept in a.exr.partial; --resume goes on"), "{said}");
        assert_eq!(room.names(), ["a.exr.partial"]);
        resumes(&room, &[], &expected);
    }
}
