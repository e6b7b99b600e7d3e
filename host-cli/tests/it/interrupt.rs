//! An interrupt ends a render or a self-test within a short time, with status 130 and without files left
//! behind.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::support::{Emulator, Room, shipped, small_render};

/// Interrupts a render once it has printed a line of `phase`, and checks status, message and files.
fn interrupt(phase: &str, options: &[&str]) {
    let room = Room::new();
    room.write("out.exr", "old picture");
    let cornell = shipped("cornell.gltf");
    let options = [options, &["-o", "out.exr", "-o", "out.png"]].concat();
    let mut command = room.command();
    let mut child = command.args(small_render(&cornell, &options)).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let told = lines.find(|line| line.starts_with(&format!("photoncard: {phase} ")));
    assert!(told.is_some(), "the render ended before its phase {phase}");
    // Two signals at once, as from `timeout`, which signals the process and its group.
    let process = child.id().to_string();
    let kill = Command::new("kill").args(["-INT", &process, &process]).status().unwrap();
    assert!(kill.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let last = lines.last();
    assert_eq!(last.as_deref(), Some("photoncard: stopped; no picture was written"));
    assert_eq!(room.names(), ["out.exr"]);
    assert_eq!(room.read("out.exr"), b"old picture");
}

/// The host ends; the card continues with the test, and then serves the next host.
#[test]
fn an_interrupt_ends_a_self_test() {
    let room = Room::new();
    let card = Emulator::start(&room, "unix:card", &[]);
    let mut command = room.command();
    command.args(["card", "selftest", "--card", &card.address]);
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.next().is_some_and(|line| line.starts_with("photoncard: memory ")));
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let last = lines.last();
    assert_eq!(
        last.as_deref(),
        Some("photoncard: stopped; the card holds patterns of the test, and no scene")
    );
    assert_eq!(room.run(&["card", "info", "--card", &card.address]).status, Some(0));
}

#[test]
fn an_interrupt_ends_photon_tracing() {
    interrupt("photons", &["--photons", "20000000"]);
}

#[test]
fn an_interrupt_ends_a_render() {
    // The card is loaded when the signal comes, and its first tile would take hours.
    interrupt("load", &["--size", "256x256", "--spp", "4096", "--gather-rays", "4096", "--tile", "32"]);
}
