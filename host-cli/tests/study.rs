//! `photoncard study` from outside: wrong arguments, and an interrupt.

mod support;

use support::{Room, shipped};

fn refused(arguments: &[&str], words: &[&str]) {
    let room = Room::new();
    room.write("taken", "");
    let outcome = room.run(&[&["study"], arguments].concat());
    assert_eq!((outcome.status, outcome.stdout.as_str()), (Some(2), ""), "{arguments:?}: {}", outcome.stderr);
    for word in words {
        assert!(outcome.stderr.contains(word), "{arguments:?}: {word:?} is not in: {}", outcome.stderr);
    }
}

#[test]
fn wrong_arguments_are_told_with_a_remedy() {
    refused(&["figure-6.18", "--out", "out"], &["figure-6.18", "figure-6.17", "all"]);
    refused(&["reordering"], &["--out"]);
    for sample in ["0/5", "3/2", "1/0", "text", "-1/2"] {
        refused(&["scaling", "--out", "out", "--sample", sample], &[sample, "1/17"]);
    }
    refused(&["scaling", "--out", "out", "--threads", "0"], &["threads"]);
    refused(&["scaling", "--out", "out"], &["cornell.gltf", "scenes", "--scenes"]);
    refused(&["scaling", "--out", "out", "--scenes", "nowhere"], &["cornell.gltf", "nowhere", "--scenes"]);
    refused(&["scaling", "--out", "taken"], &["taken", "--out"]);
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_a_study_and_keeps_its_points() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};

    let room = Room::new();
    let folder = shipped("");
    let arguments = ["study", "reordering", "--quick", "--out", "out", "--scenes", &folder, "--threads", "1"];
    let mut child = room.command().args(arguments).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let finished = |line: &String| -> Option<usize> {
        line.strip_prefix("photoncard: reordering ")?.split(' ').next()?.parse().ok()
    };
    // Progress is printed in tenths: several points may be finished at the first line.
    let finished = lines.find_map(|line| finished(&line).filter(|&count| count > 0)).unwrap();
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let last = lines.last().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{last}");
    assert!(last.contains("stopped") && last.contains("points are kept"), "{last}");
    assert!(std::fs::read_dir(room.path("out/points")).unwrap().count() >= finished);
    assert!(!room.path("out/index.html").exists());
}
