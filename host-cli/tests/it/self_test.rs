//! Command `photoncard card selftest` on a card with bad memory: it prints addresses and bits of the errors,
//! and has status 1.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::support::Room;
use photoncard_driver::link::{HostPort, Listener};
use photoncard_firmware::card::MicroCard;
use photoncard_firmware::memory::{CardMemory, MemoryPort};
use photoncard_firmware::serve::serve;
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

/// Card memory in which bit 4 of each word is stuck at 1.
struct StuckLine(Vec<Line>);

impl MemoryPort for StuckLine {
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        Ok(&self.0[address.0 as usize])
    }

    fn write(&mut self, _: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        for (target, line) in self.0[first.0 as usize..].iter_mut().zip(lines) {
            target.0 = *line;
            target.0.iter_mut().step_by(4).for_each(|byte| *byte |= 0x10);
        }
        Some(())
    }
}

impl CardMemory for StuckLine {
    fn lines(&self) -> u32 {
        self.0.len() as u32
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.0.get(first.0 as usize..(first.0 + count) as usize)
    }
}

/// Output of the self-test of a card with `lines` lines of memory that has a stuck data line.
fn tested(lines: usize) -> crate::support::Outcome {
    let listener = Listener::new(&"tcp:0".parse().unwrap()).unwrap();
    let address = listener.card_address().to_owned();
    let stop = Arc::new(AtomicBool::new(false));
    let mut port = HostPort::new(listener, stop.clone(), |_| {});
    let card = std::thread::Builder::new().stack_size(16 << 20);
    let card = card.spawn(move || {
        let memory = StuckLine(vec![Line::ZERO; lines]);
        serve(&mut *Box::new(MicroCard::new(memory)), &mut port)
    });
    let outcome = Room::new().run(&["card", "selftest", "--quiet", "--card", &address]);
    stop.store(true, Ordering::Relaxed);
    // `serve` ends with an error, as its port was stopped.
    assert!(card.unwrap().join().unwrap().is_err());
    outcome
}

#[test]
fn a_bad_card_is_reported_with_addresses_and_bits() {
    let outcome = tested(1 << 17);
    assert_eq!(outcome.status, Some(1), "{}", outcome.stderr);
    let lines: Vec<_> = outcome.stdout.lines().collect();
    assert!(lines[0].starts_with("arithmetic      0 of"), "{lines:?}");
    let [ones, zeros] = ["walking one", "walking zero"]
        .map(|name| lines.iter().position(|line| line.trim_start().starts_with(name)).unwrap());
    // Of 32 words in a row, one has the stuck bit set ("walking one") or clear ("walking zero").
    assert!(lines[ones].ends_with(": 4063232 wrong words"), "{lines:?}");
    assert_eq!(
        lines[ones + 1..ones + 3],
        [
            "    first       byte 0x00000000: 0x00000011, not 0x00000001",
            "    bits        0x00000010 differ in any"
        ]
    );
    assert!(lines[zeros].ends_with(": 131072 wrong words"), "{lines:?}");
    assert_eq!(lines[zeros + 1], "    first       byte 0x00000010: 0xffffffff, not 0xffffffef");
    for words in ["the card fails its self-test", "does not hold what is written", "help:", "bring-up.md"] {
        assert!(outcome.stderr.contains(words), "{words}: {}", outcome.stderr);
    }
    assert!(
        !outcome.stderr.contains("arithmetic") && !outcome.stderr.contains("smaller"),
        "{}",
        outcome.stderr
    );
}

#[test]
fn a_memory_that_is_too_small_is_reported() {
    let outcome = tested(512);
    assert_eq!(outcome.status, Some(1));
    assert!(outcome.stdout.contains("memory          65536 bytes: 512 lines"), "{}", outcome.stdout);
    assert!(outcome.stderr.contains("smaller than the 16777216 bytes of its budget"), "{}", outcome.stderr);
}
