//! Links as users of other tools report them: each test has the property that a report misses. The sources
//! are facts about boards, adapters and systems.
#![cfg(unix)]

use std::io::Read;
use std::process::{Child, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::board::{BOARD, Board, Change, Way};
use crate::support::{Emulator, Outcome, Room, shipped, small_render};

/// Bytes of the card image whose checksum a card is asked for.
const CHUNK_BYTES: u64 = 64 * 64;

/// Room with an emulated card for a [`Board`].
fn room() -> (Room, Emulator) {
    let room = Room::new();
    let card = Emulator::start(&room, "unix:card", &["--card", "emulated-micro"]);
    (room, card)
}

fn info(room: &Room) -> Outcome {
    room.run(&["card", "info", "--card", BOARD])
}

/// Asserts that a board on a line is heard, and returns what the command prints.
fn heard(room: &Room, change: Change) -> String {
    let _board = Board::plug_on(room, change);
    let outcome = info(room);
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    assert!(outcome.stdout.contains("dram            16777216 bytes"), "{}", outcome.stdout);
    outcome.stdout
}

/// Returns the error of a host whose board is on a line.
fn refused(room: &Room, change: Change) -> String {
    let _board = Board::plug_on(room, change);
    let outcome = info(room);
    assert_eq!((outcome.status, outcome.stdout.as_str()), (Some(1), ""));
    outcome.stderr.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Changes what comes from the card.
fn to_host(mut change: impl FnMut(Vec<u8>) -> Vec<u8> + Send + 'static) -> Change {
    Box::new(move |way, bytes| if way == Way::ToHost { change(bytes) } else { bytes })
}

/// Changes each byte that comes from the card.
fn each_to_host(change: impl Fn(u8) -> u8 + Send + 'static) -> Change {
    to_host(move |bytes| bytes.iter().map(|&byte| change(byte)).collect())
}

/// Says something once, before what the card says.
fn saying_first(said: Vec<u8>) -> Change {
    let mut said = Some(said);
    to_host(move |bytes| [said.take().unwrap_or_default(), bytes].concat())
}

// b14ckyy/Kite-GC pull 33 and serialport/serialport-rs pull 239: boards with USB CDC say nothing while DTR is
// low, and ports without such lines must work as well.
#[test]
fn a_port_without_lines_is_used_unless_an_option_states_one() {
    let (room, _card) = room();
    heard(&room, to_host(|bytes| bytes));
    let _board = Board::plug(&room);
    for option in ["dtr=on", "dtr=off", "rts=on", "rts=off"] {
        let outcome = room.run(&["card", "info", "--card", &format!("{BOARD}@115200,{option}")]);
        assert_eq!(outcome.status, Some(1));
        assert!(outcome.stderr.contains(&format!("{option} is not possible")), "{}", outcome.stderr);
        assert!(outcome.stderr.contains("leave the option out"), "{}", outcome.stderr);
    }
}

// serialport/serialport-rs issue 251: DTR resets a board when its port is opened, and it starts for seconds.
#[test]
fn a_board_that_its_port_resets_is_heard_once_it_has_started() {
    let (room, _card) = room();
    let mut opened = None;
    let change = move |_, bytes| {
        let begin = *opened.get_or_insert_with(Instant::now);
        if begin.elapsed() < Duration::from_millis(1500) { Vec::new() } else { bytes }
    };
    heard(&room, Box::new(change));
}

// esp-rs/espflash issue 556: the ROM of a chip writes text on the UART of its program after a reset.
#[test]
fn a_board_that_prints_its_boot_log_first_is_heard() {
    let (room, _card) = room();
    let log = "ESP-ROM:esp32c6-20220919\r\nBuild:Sep 19 2022\r\nrst:0x15 (USB_UART_HPSYS),boot:0xc\r\n";
    heard(&room, saying_first(log.into()));
}

// jamesmunns/ergot pull 189: a port holds bytes of the host before, and half a frame.
#[test]
fn answers_to_an_earlier_host_are_not_taken_for_those_to_this_one() {
    let (room, _card) = room();
    let said = Arc::new(Mutex::new(Vec::new()));
    let heard_by = said.clone();
    let first = heard(
        &room,
        to_host(move |bytes| {
            heard_by.lock().unwrap().extend(&bytes);
            bytes
        }),
    );
    let mut stale = said.lock().unwrap().clone();
    assert!(stale.len() > 60);
    stale.extend_from_within(..50);
    assert_eq!(heard(&room, saying_first(stale)), first);
}

// probe-rs/probe-rs issue 3058: a frame that comes in several reads was dropped.
#[test]
fn a_frame_that_comes_byte_by_byte_is_whole() {
    let (room, _card) = room();
    let mut waiting = std::collections::VecDeque::new();
    let one = move |bytes: Vec<u8>| {
        waiting.extend(bytes);
        waiting.pop_front().into_iter().collect()
    };
    heard(&room, to_host(one));
}

// knurling-rs/probe-run issue 249: a decoder ended at the first malformed frame.
#[test]
fn malformed_frames_cost_only_themselves() {
    let (room, _card) = room();
    for noise in [vec![0xaa; 5000], vec![0; 300], [7, 0, 1, 0, 255, 0].repeat(100)] {
        heard(&room, saying_first(noise));
    }
}

// berkowski/tokio-serial issue 74 and dcuddeback/serial-rs issue 5: a port in use was no clear error, and
// stayed in use after its program was killed.
#[test]
fn a_port_in_use_is_named_and_free_after_its_host_was_killed() {
    let (room, _card) = room();
    let _board = Board::plug(&room);
    let mut host = Ping::start(&room, 65_535);
    let outcome = info(&room);
    assert!(outcome.status == Some(1) && outcome.stderr.contains("the device is busy"), "{}", outcome.stderr);
    host.process.kill().unwrap();
    host.process.wait().unwrap();
    assert_eq!(info(&room).status, Some(0));
}

// esp-rs/espmonitor pull 35: a signal interrupts a read, which is no error.
#[test]
fn signals_do_not_end_a_read() {
    let (room, _card) = room();
    let _board = Board::plug(&room);
    let mut host = Ping::start(&room, 300);
    for signal in ["-STOP", "-CONT", "-WINCH", "-STOP", "-CONT"] {
        let id = host.process.id().to_string();
        // The process may have ended.
        let _ = std::process::Command::new("kill").args([signal, &id]).stderr(Stdio::null()).status();
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut said = String::new();
    host.process.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!((host.process.wait().unwrap().code(), said.as_str()), (Some(0), ""));
}

/// Process of `photoncard card ping` that has opened the port of the board.
struct Ping {
    process: Child,
}

impl Ping {
    fn start(room: &Room, count: u32) -> Self {
        let count = count.to_string();
        let mut command = room.command();
        command.args(["card", "ping", "--count", &count, "--card", BOARD]);
        let process = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        // Opening a port takes a moment, in which stale bytes are dropped.
        std::thread::sleep(Duration::from_millis(300));
        Self { process }
    }
}

impl Drop for Ping {
    fn drop(&mut self) {
        // Both calls fail if the process has ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Options of a picture of 36 tiles that takes about a second.
const PICTURE: [&str; 7] =
    ["--size=96x96", "--tile=16", "--photons=2000", "--gather-rays=20", "--neighbors=50", "-o", "a.exr"];
/// Size of a finished tile in the partial file, bytes.
const TILE_BYTES: u64 = 8 + 24 + 60 * 256 + 4;

/// Bytes of the picture that an emulated card renders in the command's process.
fn expected() -> Vec<u8> {
    let room = Room::new();
    room.rendered(&shipped("cornell.gltf"), &[&PICTURE[..], &["--quiet", "--card=emulated:1"]].concat());
    room.read("a.exr")
}

/// Starts a render on a card, and waits until some of its tiles are kept.
fn begun(room: &Room, card: &str) -> Child {
    let cornell = shipped("cornell.gltf");
    let options = [&PICTURE[..], &["--stats", "a.json", "--card", card]].concat();
    let mut command = room.command();
    let mut host = command.args(small_render(&cornell, &options)).stderr(Stdio::piped()).spawn().unwrap();
    let kept = || std::fs::metadata(room.path("a.exr.partial")).map_or(0, |found| found.len());
    while kept() < 3 * TILE_BYTES {
        assert_eq!(host.try_wait().unwrap(), None, "the render has ended");
        std::thread::sleep(Duration::from_millis(2));
    }
    host
}

/// Asserts that a render has succeeded, and returns its notices and statistics.
fn succeeded(room: &Room, host: Child, picture: &[u8]) -> (String, Value) {
    let outcome = host.wait_with_output().unwrap();
    let said = String::from_utf8(outcome.stderr).unwrap();
    assert_eq!(outcome.status.code(), Some(0), "{said}");
    assert!(room.read("a.exr") == picture);
    (said, serde_json::from_slice(&room.read("a.json")).unwrap())
}

// embassy-rs/embassy issue 5009: a UART loses bytes at an overrun.
#[test]
fn bytes_that_an_overrun_loses_are_sent_again() {
    let picture = expected();
    let room = Room::new();
    let _card = Emulator::start(&room, "unix:card", &[]);
    let mut passed = 0_u32;
    let lossy = move |_, bytes: Vec<u8>| {
        let mut is_kept = || {
            passed += 1;
            !passed.is_multiple_of(5003)
        };
        bytes.into_iter().filter(|_| is_kept()).collect()
    };
    let _board = Board::plug_on(&room, Box::new(lossy));
    let host = begun(&room, BOARD);
    let (said, statistics) = succeeded(&room, host, &picture);
    assert!(!said.contains("gone"), "{said}");
    assert!(statistics["link"]["damaged_frames"].as_u64() > Some(0), "{statistics}");
}

// jamesmunns/postcard-rpc issue 39 and embassy-rs/embassy issue 1442: a program had to be restarted after the
// cable was out.
#[test]
fn a_render_goes_on_where_it_was_when_its_board_is_plugged_in_again() {
    let picture = expected();
    for is_reset in [false, true] {
        let room = Room::new();
        let mut card = Emulator::start(&room, "unix:card", &[]);
        let board = Board::plug(&room);
        let host = begun(&room, BOARD);
        board.unplug();
        if is_reset {
            card.end("-KILL");
            card = Emulator::start(&room, "unix:card", &[]);
        }
        std::thread::sleep(Duration::from_millis(700));
        let _board = Board::plug(&room);
        let (said, statistics) = succeeded(&room, host, &picture);
        let gone = "card 0 (serial:board@115200) is gone: the link to the card was closed by the other end; \
                    waiting up to 30 s for it to come back";
        assert_eq!(said.matches(gone).count(), 1, "{said}");
        let sent = statistics["link"]["image_bytes"][0].as_u64().unwrap();
        let image = statistics["image_bytes"].as_u64().unwrap();
        let again = if is_reset { image } else { 0 };
        // Lines of an incomplete chunk are not compared.
        assert!((image + again..image + again + CHUNK_BYTES).contains(&sent), "{statistics}");
        assert_eq!(statistics["cards_given_up"], 0, "{statistics}");
        drop(card);
    }
}

// esp-rs/espmonitor issue 12: a port whose device was unplugged reads nothing at once, for ever.
#[test]
fn a_board_that_stays_away_ends_the_render_with_its_reason() {
    let room = Room::new();
    let _card = Emulator::start(&room, "unix:card", &[]);
    let board = Board::plug(&room);
    let host = begun(&room, "serial:board@115200,wait=1");
    board.unplug();
    let begin = Instant::now();
    let outcome = host.wait_with_output().unwrap();
    assert!(begin.elapsed() < Duration::from_secs(10));
    let said = String::from_utf8(outcome.stderr).unwrap();
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(outcome.status.code(), Some(1), "{said}");
    for words in [
        "gone for 1 s, and no other card is left",
        "cannot open serial:board: there is no such device",
        "--resume",
        ",wait=SECONDS",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert_eq!(room.names(), ["a.exr.partial", "a.json", "card"]);
}

// esp-rs/espflash issue 582: a board of another crystal talks at another bit rate, and only noise comes.
// embassy-rs/embassy issue 6850: the top bit of each byte is the parity of a UART of 7 data bits.
// serialport/serialport-rs issue 10: a write to a port that nobody reads did not return.
// Each fault takes the 10 s after which a card is silent.
#[test]
fn a_card_that_is_not_understood_ends_in_a_sentence_that_names_the_cause() {
    let parity = |byte: u8| byte & 0x7f | ((byte & 0x7f).count_ones() as u8 & 1) << 7;
    let text = |bytes: Vec<u8>| if bytes.is_empty() { bytes } else { b"I (312) app: idle\r\n".to_vec() };
    let faults: [(Change, &str); 6] = [
        (each_to_host(|byte| (byte & 0x38) | 0x80), "the bytes are no frames: a wrong bit rate"),
        (each_to_host(move |byte| if byte == 0 { 0 } else { parity(byte) }), "is even parity: 7 data bits"),
        (each_to_host(|byte| byte & 0x7f), "no byte has its top bit set: 7 data bits or a parity bit"),
        (to_host(text), "the bytes are text, \"I (312) app: idle"),
        (each_to_host(|_| 0), "all bytes are zero"),
        (Box::new(|_, _| Vec::new()), "the card has not answered for 10 s"),
    ];
    std::thread::scope(|scope| {
        for (change, cause) in faults {
            scope.spawn(move || {
                let (room, _card) = room();
                let said = refused(&room, change);
                assert!(said.contains(cause) && said.contains("help: "), "{cause}: {said}");
            });
        }
    });
}

#[test]
fn an_echo_is_told_from_a_card() {
    let (room, _card) = room();
    let echo = Arc::new(Mutex::new(Vec::new()));
    let change = move |way, bytes: Vec<u8>| {
        let mut echo = echo.lock().unwrap();
        match way {
            Way::ToCard => echo.extend(bytes),
            Way::ToHost => return std::mem::take(&mut *echo),
        }
        Vec::new()
    };
    let said = refused(&room, Box::new(change));
    assert!(said.contains("the card's answer is an echo of the host's own bytes"), "{said}");
}
