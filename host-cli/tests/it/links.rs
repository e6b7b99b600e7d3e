//! Cards in other processes render equal pictures over every link, and errors name cards that cannot be
//! reached.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::Stdio;

use crate::support::{Emulator, Outcome, Room, shipped, small_render};

const LISTEN: [&str; 3] = ["tcp:", "unix:card", "pty"];

/// Checks that a command failed with status 1 and these words, and left no files but `names`.
fn check_failed(room: &Room, outcome: &Outcome, words: &[&str], names: &[&str]) {
    let Outcome { status, stdout, stderr } = outcome;
    assert_eq!((*status, stdout.as_str()), (Some(1), ""), "{stderr}");
    for word in words {
        assert!(stderr.contains(word), "{word:?} is not in: {stderr}");
    }
    assert_eq!(room.names(), names);
}

#[test]
fn pictures_are_equal_over_every_link() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let render = |name: &str, cards: &[&str]| {
        let mut options = vec!["-o", name, "--size", "32x32", "--photons", "1000", "--quiet"];
        options.extend(cards.iter().flat_map(|card| ["--card", card]));
        room.rendered(&cornell, &options);
        room.read(name)
    };
    let expected = render("emulated.exr", &["emulated:1"]);
    let emulators = LISTEN.map(|listen| Emulator::start(&room, listen, &[]));
    let micro = Emulator::start(&room, "tcp:127.0.0.1:0", &["--card", "emulated-micro"]);
    for Emulator { address, .. } in emulators.iter().chain([&micro]) {
        // The second host finds the card as the first one has left it.
        for _ in 0..2 {
            assert!(render("a.exr", &[address]) == expected, "{address}");
        }
    }
    let [tcp, unix, pty] = emulators.each_ref().map(|emulator| emulator.address.as_str());
    let cards = [tcp, "emulated:1", pty, unix, "emulated-micro:2", &micro.address];
    assert!(render("a.exr", &cards) == expected);
}

#[test]
fn a_relay_of_cards_and_relays_is_one_card() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let render = |name: &str, cards: &[&str]| {
        let mut options = vec!["-o", name, "--size", "64x64", "--photons", "1000", "--quiet"];
        options.extend(cards.iter().flat_map(|card| ["--card", card]));
        let outcome = room.rendered(&cornell, &options);
        (room.read(name), outcome.stderr)
    };
    let (expected, _) = render("emulated.exr", &["emulated:1"]);
    let card = Emulator::start(&room, "tcp:", &["--card", "emulated-micro"]);
    let inner = Emulator::start(&room, "unix:inner", &["--relay", "emulated:2", "--card-memory", "64M"]);
    let cards = ["--relay", &card.address, "--relay", &inner.address, "--relay", "emulated-large:1"];
    let outer = Emulator::start(&room, "tcp:", &cards);
    for _ in 0..2 {
        assert!(render("a.exr", &[&outer.address]) == (expected.clone(), String::new()));
    }
    let outcome = room.run(&["card", "info", "--card", &outer.address]);
    assert!(
        outcome.stdout.contains("of 3 cards") && outcome.stdout.contains(", 18 at once"),
        "{}",
        outcome.stdout
    );
    card.end("-INT");
    assert!(render("a.exr", &[&outer.address]) == (expected, String::new()));
    let (status, said) = outer.end("-INT");
    assert!(
        status == Some(130) && said.matches("card 0 (tcp:").count() == 1 && said.contains("is lost"),
        "{said}"
    );
    let absent = ["emulate", "--listen", "unix:outer", "--relay", "emulated:1", "--relay", &card_of(&said)];
    check_failed(
        &room,
        &room.run(&absent),
        &["card 1 (tcp:", "nothing listens there"],
        &["a.exr", "emulated.exr", "inner"],
    );
}

/// Address of the card that a message of a relay names.
fn card_of(said: &str) -> String {
    said.split(['(', ')']).find(|part| part.starts_with("tcp:")).unwrap().to_owned()
}

#[test]
fn a_card_serves_the_next_host_after_a_killed_one() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let small = ["-o", "a.exr", "--quiet", "--card"];
    room.rendered(&cornell, &[&small[..], &["emulated:1"]].concat());
    let expected = room.read("a.exr");
    for listen in LISTEN {
        let emulator = Emulator::start(&room, listen, &[]);
        // One tile of this picture would take minutes.
        let endless = ["--size", "64x64", "--spp", "4096", "--gather-rays", "64", "--tile", "32"];
        let options = [&endless[..], &["-o", "b.exr", "--card", &emulator.address]].concat();
        let mut command = room.command();
        let mut host = command.args(small_render(&cornell, &options)).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(host.stderr.take().unwrap()).lines().map(Result::unwrap);
        assert!(lines.any(|line| line.starts_with("photoncard: load ")), "{listen}");
        host.kill().unwrap();
        host.wait().unwrap();
        room.rendered(&cornell, &[&small[..], &[&emulator.address]].concat());
        assert!(room.read("a.exr") == expected, "{listen}");
    }
}

#[test]
fn cards_report_their_budget_over_links() {
    let room = Room::new();
    for listen in LISTEN {
        let emulator = Emulator::start(&room, listen, &["--card", "emulated-micro"]);
        let outcome = room.run(&["card", "info", "--card", &emulator.address]);
        assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""), "{listen}");
        assert!(outcome.stdout.contains("dram            16777216 bytes"), "{}", outcome.stdout);
        assert!(!outcome.stdout.contains("free"), "{}", outcome.stdout);
        let outcome = room.run(&["card", "ping", "--count", "3", "--card", &emulator.address]);
        assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""), "{listen}");
        for row in ["hello 1", "hello 3", "least", "mean", "most"] {
            assert!(outcome.stdout.contains(row), "{row}: {}", outcome.stdout);
        }
        assert_eq!(outcome.stdout.lines().count(), 6);
        let outcome = room.run(&["card", "selftest", "--quiet", "--card", &emulator.address]);
        assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""), "{listen}");
        assert!(outcome.stdout.contains("memory          16777216 bytes"), "{}", outcome.stdout);
    }
}

#[test]
fn a_host_is_not_disturbed_by_a_second_one() {
    let room = Room::new();
    let emulator = Emulator::start(&room, "tcp:", &[]);
    let info = || room.run(&["card", "info", "--card", &emulator.address]);
    let first = TcpStream::connect(emulator.address.strip_prefix("tcp:").unwrap()).unwrap();
    check_failed(&room, &info(), &[&emulator.address, "another host may be using the card"], &[]);
    drop(first);
    assert_eq!(info().status, Some(0));
}

#[test]
fn connections_that_are_no_host_do_not_occupy_a_card() {
    let silent_for_long = |said: &[u8]| {
        let room = Room::new();
        let emulator = Emulator::start(&room, "tcp:", &[]);
        let info = || room.run(&["card", "info", "--card", &emulator.address]);
        let mut other = TcpStream::connect(emulator.address.strip_prefix("tcp:").unwrap()).unwrap();
        other.write_all(said).unwrap();
        let refused = std::iter::repeat_with(info).take_while(|info| info.status != Some(0)).count();
        assert!(refused > 0, "{said:?}");
        assert!(emulator.end("-INT").1.contains("no valid frame for 10 s"));
    };
    std::thread::scope(|scope| {
        for said in [&b""[..], b"GET / HTTP/1.0\r\n\r\n", b"\0\0\0"] {
            scope.spawn(move || silent_for_long(said));
        }
    });
}

/// A card that cannot hold the scene or the settings is left out if there is another; alone, it makes the
/// render fail.
#[test]
fn a_card_that_is_too_small_is_not_used() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let options = ["-o", "a.exr", "--size", "16x16", "--photons", "1000", "--neighbors", "200"];
    room.rendered(&cornell, &[&options[..], &["--card", "emulated:1"]].concat());
    let expected = room.read("a.exr");
    let both = [&options[..], &["--quiet", "--card", "emulated-micro:1", "--card", "emulated:1"]].concat();
    let outcome = room.render(&cornell, &both);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert!(
        outcome.stderr.contains("card 0 is left out: --neighbors 200 is not possible"),
        "{}",
        outcome.stderr
    );
    assert!(room.read("a.exr") == expected);
    let outcome = room.render(&cornell, &[&options[..], &["--card", "emulated-micro:2"]].concat());
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    assert!(!outcome.stderr.contains("left out"), "{}", outcome.stderr);
}

#[test]
fn missing_cards_are_reported() {
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
        let name = card.split('@').next().unwrap();
        let words = [words[0], words[1], name, "card 0", "help:"];
        let options = ["-o", "a.exr", "--stats", "a.json", "--card", card];
        check_failed(&room, &room.render(&cornell, &options), &words, &["a.json", "file"]);
        assert!(room.read("a.json").starts_with(b"{\n  \"error\": \"card 0"));
        // Beside a second card the failing one is lost, and the picture is rendered.
        let options = [&options[..], &["--card", "emulated:1"]].concat();
        let outcome = room.render(&cornell, &options);
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        let told: Vec<_> = outcome.stderr.lines().filter(|line| line.contains("is lost")).collect();
        assert!(
            told.len() == 1 && [words[0], name, "card 0"].iter().all(|word| told[0].contains(word)),
            "{told:?}"
        );
        ["a.exr", "a.json"].iter().for_each(|name| std::fs::remove_file(room.path(name)).unwrap());
    }
}

#[test]
fn listeners_that_are_no_card_are_reported() {
    let room = Room::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    let closing = std::thread::spawn(move || drop(listener.accept().unwrap()));
    let outcome = room.run(&["card", "info", "--card", &address]);
    check_failed(&room, &outcome, &[&address, "closed the link before it said hello"], &[]);
    closing.join().unwrap();
}

/// Address at which the first connection is closed at once, and the second is one to the card at `address`.
fn busy_at_first(address: &str) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let busy = format!("tcp:{}", listener.local_addr().unwrap());
    let card = address.strip_prefix("tcp:").unwrap().to_owned();
    std::thread::spawn(move || {
        drop(listener.accept().unwrap());
        let (host, _) = listener.accept().unwrap();
        let card = TcpStream::connect(card).unwrap();
        let [mut from, mut to] = [&host, &card].map(|end| end.try_clone().unwrap());
        let back = std::thread::spawn(move || std::io::copy(&mut &card, &mut &host));
        let _ = std::io::copy(&mut from, &mut to);
        let _ = to.shutdown(Shutdown::Both);
        let _ = back.join();
    });
    busy
}

#[test]
fn a_card_that_has_not_noticed_that_its_last_host_is_gone_is_reached_again() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let card = Emulator::start(&room, "tcp:127.0.0.1:0", &[]);
    for command in ["info", "selftest"] {
        let outcome = room.run(&["card", command, "--card", &busy_at_first(&card.address)]);
        assert_eq!(outcome.status, Some(0), "{command}: {}", outcome.stderr);
    }
    let options = ["-o", "a.exr", "--size", "32x32", "--photons", "1000", "--quiet"];
    room.rendered(&cornell, &[&options[..], &["--card", &busy_at_first(&card.address)]].concat());
}

#[test]
fn an_emulator_ends_on_a_signal() {
    let room = Room::new();
    for (listen, signal) in
        [("unix:card", "-INT"), ("unix:card", "-TERM"), ("pty", "-INT"), ("tcp:", "-TERM")]
    {
        let emulator = Emulator::start(&room, listen, &[]);
        assert_eq!(emulator.end(signal), (Some(130), "photoncard: stopped; the card is gone\n".into()));
        assert!(room.names().is_empty(), "{listen}");
    }
    // A killed process leaves its socket file behind, which the next one replaces.
    Emulator::start(&room, "unix:card", &[]).end("-KILL");
    assert_eq!(room.names(), ["card"]);
    assert_eq!(Emulator::start(&room, "unix:card", &[]).end("-INT").0, Some(130));
    assert!(room.names().is_empty());
    let (_, said) = Emulator::start(&room, "tcp:0.0.0.0:0", &[]).end("-INT");
    assert!(said.contains("warning") && said.contains("no authentication"), "{said}");
}

#[test]
fn unavailable_listening_addresses_are_reported() {
    let room = Room::new();
    let emulator = Emulator::start(&room, "unix:card", &[]);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = format!("tcp:{}", taken.local_addr().unwrap().port());
    room.write("file", "mine");
    for (listen, words) in [
        ("unix:card", ["listen on unix:card", "in use"]),
        ("unix:file", ["a file has that name", "choose another path"]),
        ("unix:absent/card", ["its folder does not exist", "create the folder"]),
        (taken.as_str(), ["in use", "choose another"]),
        ("tcp:192.0.2.1:0", ["no such address", "such as 127.0.0.1"]),
    ] {
        check_failed(&room, &room.run(&["emulate", "--listen", listen]), &words, &["card", "file"]);
    }
    assert_eq!(room.read("file"), b"mine");
    assert_eq!(room.run(&["card", "info", "--card", &emulator.address]).status, Some(0));
}
