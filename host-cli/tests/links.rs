//! Cards of other processes: what is said where there is none.
#![cfg(unix)]

mod support;

use std::net::TcpListener;

use support::{Outcome, Room, shipped};

/// Checks that a command failed at its work with these words, and left no file but `names`.
fn check_failed(room: &Room, outcome: &Outcome, words: &[&str], names: &[&str]) {
    let Outcome { status, stdout, stderr } = outcome;
    assert_eq!((*status, stdout.as_str()), (Some(1), ""), "{stderr}");
    for word in words {
        assert!(stderr.contains(word), "{word:?} is not in: {stderr}");
    }
    assert_eq!(room.names(), names);
}

#[test]
fn cards_that_are_not_there() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let free_port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let refused = format!("tcp:127.0.0.1:{free_port}");
    room.write("file", "");
    for (card, words) in [
        (refused.as_str(), ["nothing listens there", "start the card"]),
        ("unix:absent", ["there is no such socket", "start the card"]),
        ("unix:file", ["nothing listens there", "start the card"]),
        ("serial:/dev/absent", ["there is no such device", "check the cable"]),
        ("serial:/dev/null@9600", ["serial:/dev/null", "names a serial port"]),
        ("serial:file", ["serial:file", "names a serial port"]),
    ] {
        let words = [words[0], words[1], card.split('@').next().unwrap(), "card 1", "help:"];
        let options = ["-o", "a.exr", "--stats", "a.json", "--card", "emulated:1", "--card", card];
        check_failed(&room, &room.render(&cornell, &options), &words, &["file"]);
    }
}

#[test]
fn what_listens_may_be_no_card() {
    let room = Room::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    let closing = std::thread::spawn(move || drop(listener.accept().unwrap()));
    let outcome = room.run(&["card", "info", "--card", &address]);
    check_failed(&room, &outcome, &[&address, "closed the link before it said hello"], &[]);
    closing.join().unwrap();
}
