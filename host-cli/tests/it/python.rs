//! The host and the card in Python, which follow `docs/protocol.md` alone, work with the program's card and
//! host.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use photoncard_driver::exr::{Shown, read};

use crate::support::{Emulator, Room, shipped, skip};

/// Command that runs a program in `docs/protocol`; `None` without Python.
fn python(program: &str) -> Option<Command> {
    if Command::new("python3").arg("--version").output().is_err() {
        skip("python3 is missing: the host and the card in Python are not tested");
        return None;
    }
    let mut command = Command::new("python3");
    command.arg("-B").arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/protocol").join(program));
    Some(command)
}

const SIDE: u32 = 24;

/// A room with a prepared scene.
fn prepared() -> Room {
    let room = Room::new();
    let options =
        ["--quality", "paper", "--photons", "2000", "--gather-rays", "8", "--irradiance-cache", "on"];
    let outcome =
        room.run(&[&["prepare", &shipped("cornell.gltf"), "-o", "room.card"][..], &options].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    room
}

/// Renders the prepared scene on a card by the program. Returns the pixels.
fn rendered(room: &Room, card: &str) -> Vec<[f32; 3]> {
    let size = format!("{SIDE}x{SIDE}");
    let picture = ["--size", &size, "--filter", "box", "--aov", "none", "-o", "a.exr", "--card", card];
    let outcome = room.run(&[&["render", "--prepared", "room.card"][..], &picture].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    read(&room.path("a.exr"), Shown::Rendered).unwrap().pixels
}

/// Renders the prepared scene on a card by the host in Python. Returns the pixels; `None` without Python.
fn rendered_by_python(room: &Room, card: &str) -> Option<Vec<[f32; 3]>> {
    let mut host = python("host.py")?;
    let address = card.strip_prefix("tcp:").unwrap();
    host.args([address, "room.card", "out.pixels", "--size", &SIDE.to_string()]).current_dir(room.path(""));
    let output = host.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let image = room.read("room.card");
    let start = image.windows(8).position(|bytes| bytes == b"PHOTCARD").unwrap();
    let unit = f32::from_le_bytes(*image[start + 20..].first_chunk().unwrap());
    let light = |sum: &[u8; 8]| (i64::from_le_bytes(*sum) as f64 / 2_f64.powi(40) * f64::from(unit)) as f32;
    let records = room.read("out.pixels");
    let pixels = records.as_chunks::<60>().0.iter().map(|record| {
        let (sums, _) = record[36..].as_chunks();
        [light(&sums[0]), light(&sums[1]), light(&sums[2])]
    });
    Some(pixels.collect())
}

/// The card in Python, which ends when it is dropped.
struct PythonCard {
    process: Child,
    address: String,
}

impl PythonCard {
    fn start() -> Option<Self> {
        let mut command = python("card.py")?;
        let mut process = command.arg("0").stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut address = String::new();
        BufReader::new(process.stdout.as_mut().unwrap()).read_line(&mut address).unwrap();
        Some(Self { process, address: address.trim_end().to_owned() })
    }
}

impl Drop for PythonCard {
    fn drop(&mut self) {
        // Both calls fail if the process has ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn a_host_in_python_renders_what_the_program_does() {
    let room = prepared();
    let card = Emulator::start(&room, "tcp:127.0.0.1:0", &[]);
    let Some(pixels) = rendered_by_python(&room, &card.address) else { return };
    assert!(pixels.iter().any(|pixel| *pixel != [0.0; 3]));
    assert_eq!(pixels, rendered(&room, "emulated:1"));
    // The card has the image's lines, and another session takes others.
    assert_eq!(rendered_by_python(&room, &card.address), Some(pixels));
}

#[test]
fn a_card_in_python_serves_both_hosts() {
    let room = prepared();
    let Some(card) = PythonCard::start() else { return };
    let pattern = rendered(&room, &card.address);
    let brightest = |axis: usize| pattern.iter().map(|pixel| pixel[axis]).fold(0.0, f32::max);
    assert!(brightest(0) > 0.0 && brightest(0) == brightest(1) && brightest(2) == 0.0);
    // The second host finds the lines that the first has written.
    assert_eq!(rendered(&room, &card.address), pattern);
    assert_eq!(rendered_by_python(&room, &card.address), Some(pattern));
}

/// A test of the firmware compares the same vectors with the program.
#[test]
fn the_test_vectors_hold_in_python() {
    let Some(mut checker) = python("vectors.py") else { return };
    let output = checker.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
