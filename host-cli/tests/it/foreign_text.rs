//! Foreign text: control characters in names of scenes, cards, paths and files do not reach the terminal.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::Duration;

use crate::support::{Outcome, Room, scene, scene_bytes, scene_of, small_render};
use photoncard_firmware::kind::MICRO;
use photoncard_shared::checksum::checksum;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::{self, Board, Command, PROTOCOL_VERSION, Reply};
use photoncard_shared::transport::Transport;
use serde_json::{Value, json};

/// Text that clears the screen, ends a line, starts a forged one, and reverses the direction of the rest.
const HOSTILE: &str = "x\u{1b}[2J\0\u{9b}31m\r\nforged\u{202e}\u{2066}\u{7f}";
/// [`HOSTILE`] as the command must print it.
const SHOWN: &str = "x\\u{1b}[2J\\0\\u{9b}31m\\r\\nforged\\u{202e}\\u{2066}\\u{7f}";
/// [`HOSTILE`] as a path or an argument, which cannot contain a zero byte.
const HOSTILE_PATH: &str = "x\u{1b}[2J\u{9b}31m\r\nforged\u{202e}";
const SHOWN_PATH: &str = "x\\u{1b}[2J\\u{9b}31m\\r\\nforged\\u{202e}";

/// Checks that a command has this status, prints `shown` at least `times` times, and prints no unprintable
/// character.
fn check_shown(outcome: &Outcome, status: i32, shown: &str, times: usize) {
    let Outcome { status: found, stdout, stderr } = outcome;
    assert_eq!(*found, Some(status), "{stderr}");
    for text in [stdout, stderr] {
        let is_hostile = |c: char| c != '\n' && (c.is_control() || "\u{202e}\u{2066}".contains(c));
        assert!(!text.contains(is_hostile), "{text:?}");
        assert!(!text.lines().any(|line| line.trim_start().starts_with("forged")), "{text}");
    }
    let found = stdout.matches(shown).count() + stderr.matches(shown).count();
    assert!(found >= times, "{shown} is there {found} times: {stdout}{stderr}");
}

/// Scene with a hostile name on every object.
fn hostile_scene(mut scene: Value) -> Value {
    scene["asset"]["generator"] = json!(HOSTILE);
    scene["extensionsUsed"] = json!(["KHR_materials_specular", "KHR_lights_punctual"]);
    let light = json!({"name": HOSTILE, "type": "point", "range": 5.0});
    scene["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    scene["nodes"][1]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    let named =
        [("nodes", 0), ("nodes", 1), ("cameras", 0), ("meshes", 0), ("materials", 0), ("materials", 1)];
    for (kind, index) in named {
        scene[kind][index]["name"] = json!(HOSTILE);
    }
    scene
}

#[test]
fn names_of_a_scene_are_shown_escaped() {
    let room = Room::new();
    room.write_scene("scene.gltf", &hostile_scene(scene()));
    // Generator, camera, two materials, light, and the notice about the light's `range`.
    check_shown(&room.run(&["scene", "info", "scene.gltf"]), 0, SHOWN, 6);
    check_shown(&room.render("scene.gltf", &["-o", "a.exr"]), 0, SHOWN, 1);
    for options in [["--camera", "absent"], ["--set", "absent.diffuse=0"]] {
        check_shown(&room.render("scene.gltf", &[&options[..], &["-o", "b.exr"]].concat()), 2, SHOWN, 1);
    }
}

#[test]
fn errors_about_a_scene_are_escaped() {
    let room = Room::new();
    let refused = |scene: &Value, shown: &str| {
        room.write_scene("scene.gltf", scene);
        check_shown(&room.run(&["scene", "info", "scene.gltf"]), 2, shown, 1);
    };
    let mut bytes = scene_bytes();
    bytes[84..86].copy_from_slice(&9u16.to_le_bytes());
    refused(&hostile_scene(scene_of(&bytes)), SHOWN);
    let mut required = scene();
    required["extensionsRequired"] = json!([HOSTILE]);
    refused(&required, SHOWN);
    let mut absent = scene();
    absent["buffers"][0]["uri"] = json!(HOSTILE_PATH);
    refused(&absent, SHOWN_PATH);
    // The error has an excerpt of the file, with a mark below the position.
    room.write("scene.gltf", "{\"\u{9b}31m\u{202e}\u{7f}\": \u{202e}}");
    let outcome = room.run(&["scene", "info", "scene.gltf"]);
    check_shown(&outcome, 2, "{\"\\u{9b}31m\\u{202e}\\u{7f}\": \\u{202e}}", 1);
    assert!(outcome.stderr.contains("here"), "{}", outcome.stderr);
}

#[cfg(unix)]
#[test]
fn paths_and_arguments_are_shown_escaped() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    check_shown(&room.run(&["scene", "info", HOSTILE_PATH]), 2, SHOWN_PATH, 1);
    room.write(HOSTILE_PATH, "{");
    check_shown(&room.run(&["scene", "info", HOSTILE_PATH]), 2, SHOWN_PATH, 2);
    let folder = format!("{HOSTILE_PATH}/a.exr");
    check_shown(&room.render("scene.gltf", &["-o", &folder]), 2, SHOWN_PATH, 1);
    check_shown(&room.run(&["diff", HOSTILE_PATH, HOSTILE_PATH]), 2, SHOWN_PATH, 1);
    // Arguments that clap rejects.
    for arguments in
        [&[HOSTILE_PATH][..], &["diff", "a", "b", HOSTILE_PATH], &["card", "info", "--card", HOSTILE_PATH]]
    {
        check_shown(&room.run(arguments), 2, SHOWN_PATH, 1);
    }
    let card = format!("unix:{HOSTILE_PATH}");
    check_shown(&room.render("scene.gltf", &["-o", "a.exr", "--card", &card]), 1, SHOWN_PATH, 1);
    if !cfg!(feature = "study") {
        return;
    }
    let study = ["study", "reordering", "--quick", "--scenes", HOSTILE_PATH, "--out", "reports"];
    check_shown(&room.run(&study), 2, SHOWN_PATH, 1);
}

#[test]
fn settings_of_a_kept_file_are_shown_escaped() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let settings = json!({HOSTILE: HOSTILE});
    let head = format!("photoncard partial render 4\n{settings}\n");
    let sum = checksum(head.as_bytes()).to_le_bytes();
    room.write("a.exr.partial", [head.as_bytes(), &sum].concat());
    // JSON itself escapes a part of the text.
    check_shown(&room.render("scene.gltf", &["-o", "a.exr", "--resume"]), 2, SHOWN, 1);
}

#[test]
fn the_name_of_a_picture_is_shown_escaped_by_a_viewer() {
    let viewer = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = viewer.local_addr().unwrap().to_string();
    let reader = thread::spawn(move || {
        let mut bytes = Vec::new();
        viewer.accept().unwrap().0.read_to_end(&mut bytes).unwrap();
        bytes
    });
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let name = "a\u{1b}[2J.exr";
    room.rendered("scene.gltf", &["-o", name, "--display-server", &address]);
    let bytes = reader.join().unwrap();
    assert!(bytes[6..].starts_with(b"a\\u{1b}[2J.exr\0"), "{:?}", &bytes[..40]);
}

/// Answers a host's hello with the hostile `build`, until the host disconnects.
fn serve_hello(mut host: TcpStream, build: &str) {
    let mut transport = Transport::card();
    host.set_read_timeout(Some(Duration::from_millis(5))).unwrap();
    let mut buffer = [0; 4096];
    loop {
        let received = match host.read(&mut buffer) {
            Ok(0) => return,
            received => received.unwrap_or(0),
        };
        let mut rest = &buffer[..received];
        while !rest.is_empty() {
            rest = &rest[transport.receive(rest).0..];
            let mut is_hello = false;
            while let Some(payload) = transport.take() {
                is_hello |= matches!(message::decode(payload), Some(Command::Hello { .. }));
            }
            let hello = Reply::Hello {
                protocol: PROTOCOL_VERSION,
                layout: LAYOUT_VERSION,
                budget: MICRO,
                written_lines: 0,
                memory_use: None,
                build,
                board: Some(Board { name: build, serial_number: build, clock_hz: 1 }),
            };
            assert!(!is_hello || transport.send(|bytes| message::encode(&hello, bytes)));
        }
        transport.acknowledge();
        loop {
            let outgoing = transport.outgoing().to_vec();
            if outgoing.is_empty() {
                break;
            }
            if host.write_all(&outgoing).is_err() {
                return;
            }
            transport.sent(outgoing.len());
        }
    }
}

#[test]
fn the_build_of_a_card_is_shown_escaped() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let card = format!("tcp:{}", listener.local_addr().unwrap());
    let server = thread::spawn(move || serve_hello(listener.accept().unwrap().0, HOSTILE));
    let room = Room::new();
    check_shown(&room.run(&["card", "info", "--card", &card]), 0, SHOWN, 1);
    server.join().unwrap();
}

/// Sets a material whose name begins with a direction mark.
#[test]
fn a_material_with_a_hostile_name_can_be_set() {
    let room = Room::new();
    let mut scene = scene();
    scene["materials"][0]["name"] = json!("\u{202e}floor");
    room.write_scene("scene.gltf", &scene);
    let outcome =
        room.run(&small_render("scene.gltf", &["-o", "a.exr", "--set", "\u{202e}floor.diffuse=0.1"]));
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
}
