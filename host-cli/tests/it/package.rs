//! Archive of the program that `package.sh` writes.
#![cfg(target_os = "linux")]

use std::process::Command;

use crate::support::{Outcome, Room, shipped};

/// Runs `package.sh` in the folder `room`.
fn package(room: &Room, arguments: &[&str]) -> Outcome {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/package.sh");
    let mut command = Command::new("timeout");
    command.args(["300", script]).args(arguments).current_dir(room.path(""));
    command.env("CARGO", env!("CARGO")).env("SOURCE_DATE_EPOCH", "1000000000");
    Outcome::of(&command.output().unwrap())
}

/// Standard output of a program, which must succeed.
fn said(room: &Room, program: &str, arguments: &[&str]) -> String {
    let outcome =
        Outcome::of(&Command::new(program).args(arguments).current_dir(room.path("")).output().unwrap());
    assert_eq!(outcome.status, Some(0), "{program}: {}", outcome.stderr);
    outcome.stdout
}

#[test]
fn archives_are_complete_and_reproducible() {
    let room = Room::new();
    let program = env!("CARGO_BIN_EXE_photoncard");
    let archives = ["first", "second"].map(|folder| {
        let outcome = package(&room, &["tar", "--binary", program, "--out", folder]);
        assert_eq!(outcome.status, Some(0), "{}{}", outcome.stdout, outcome.stderr);
        outcome.stdout.lines().find(|path| path.ends_with(".tar.gz")).unwrap().to_owned()
    });
    let [first, second] = archives.each_ref().map(|path| std::fs::read(path).unwrap());
    assert!(first == second, "the archives differ");

    let contents = said(&room, "tar", &["-tzf", &archives[0]]);
    let name = archives[0].rsplit('/').next().unwrap().strip_suffix(".tar.gz").unwrap();
    assert!(name.starts_with(concat!("photoncard-", env!("CARGO_PKG_VERSION"), "-")), "{name}");
    for file in [
        "CHANGELOG.md",
        "LICENSE-APACHE",
        "LICENSE-MIT",
        "LICENSE-OF-SKY-DATA.txt",
        "LICENSES-OF-CRATES.txt",
        "README.md",
        "bin/photoncard",
        "completions/photoncard.bash",
        "completions/photoncard.zsh",
        "docs/glossary.md",
        "scenes/cornell.gltf",
        "share/man/man1/photoncard-render.1",
    ] {
        assert!(contents.lines().any(|line| line == format!("{name}/{file}")), "{file}: {contents}");
    }

    said(&room, "tar", &["-xzf", &archives[0]]);
    let packed = room.path(name).join("bin/photoncard");
    let version = said(&room, packed.to_str().unwrap(), &["--version"]);
    assert_eq!(version, room.run(&["--version"]).stdout);
    assert_eq!(
        std::fs::read(room.path(name).join("scenes/cornell.gltf")).unwrap(),
        std::fs::read(shipped("cornell.gltf")).unwrap()
    );
    let licences = std::fs::read_to_string(room.path(name).join("LICENSES-OF-CRATES.txt")).unwrap();
    for of in ["==== clap v", "==== serialport v", "Mozilla Public License, v. 2.0"] {
        assert!(licences.contains(of), "{of}");
    }
}

#[test]
fn a_failed_package_leaves_no_file() {
    let room = Room::new();
    for (arguments, status, message) in [
        (&["--output", "out"][..], 2, "usage"),
        (&["--out"], 2, "usage"),
        (&["--binary", "absent", "--out", "out"], 1, "absent is no program"),
        (&["--binary", "/bin/false", "--out", "out"], 1, "/bin/false states no version"),
    ] {
        let outcome = package(&room, arguments);
        assert_eq!(outcome.status, Some(status), "{arguments:?}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(message), "{arguments:?}: {}", outcome.stderr);
    }
    assert_eq!(room.names(), Vec::<String>::new());
}
