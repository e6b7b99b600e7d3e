//! Tests that messages arrive once, whole and in order, whatever the link does to bytes.

use photoncard_shared::frame::{MAX_FRAME, MAX_PAYLOAD};
use photoncard_shared::transport::{Event, LineStatistics, Transport};
use proptest::prelude::*;

/// Pseudo-random number generator; the field is its state.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    fn happens(&mut self, per_million: u64) -> bool {
        self.next() % 1_000_000 < per_million
    }
}

/// Mean numbers of a link's errors per million bytes.
#[derive(Clone, Copy, Debug)]
struct Faults {
    flips: u64,
    drops: u64,
    repeats: u64,
}

const NONE: Faults = Faults { flips: 0, drops: 0, repeats: 0 };

/// Sends up to 699 pending bytes from one end to the other over a faulty link. Returns whether a byte was
/// sent, and the events at the receiving end.
fn deliver(
    from: &mut Transport,
    to: &mut Transport,
    faults: Faults,
    random: &mut Random,
) -> (bool, Vec<Event>) {
    let most = random.next() as usize % 700;
    let outgoing = from.outgoing();
    let count = outgoing.len().min(most);
    let mut bytes = Vec::new();
    for &byte in &outgoing[..count] {
        if random.happens(faults.drops) {
            continue;
        }
        let flipped = if random.happens(faults.flips) { byte ^ 1 << (random.next() % 8) } else { byte };
        bytes.push(flipped);
        if random.happens(faults.repeats) {
            bytes.push(flipped);
        }
    }
    from.sent(count);
    let mut events = Vec::new();
    let mut rest = &bytes[..];
    while !rest.is_empty() {
        let (taken, event) = to.receive(rest);
        rest = &rest[taken..];
        events.extend(event);
    }
    (count > 0, events)
}

fn fill(message: &[u8]) -> impl FnOnce(&mut [u8]) -> Option<usize> {
    move |bytes| {
        bytes.get_mut(..message.len())?.copy_from_slice(message);
        Some(message.len())
    }
}

/// Content of message number `number`; the length varies with the number.
fn message(number: usize, salt: usize) -> Vec<u8> {
    let length = (number * 389 + salt * 7) % (MAX_PAYLOAD + 1);
    (0..length).map(|index| (index * 31 + number * 7 + salt) as u8).collect()
}

/// Sends `count` messages in each direction and checks them. Returns the statistics of host and card.
fn converse(count: usize, faults: Faults, seed: u64) -> [LineStatistics; 2] {
    let mut random = Random(seed);
    let (mut host, mut card) = (Transport::host(), Transport::card());
    host.open(seed as u32);
    let [mut said, mut heard] = [[0; 2]; 2];
    let mut quiet = 0;
    for _ in 0..200_000 {
        for (end, transport) in [&mut host, &mut card].into_iter().enumerate() {
            // A card sends its first message after a message of the host has arrived.
            if said[end] < count
                && (end == 0 || heard[1] > 0)
                && transport.send(fill(&message(said[end], end)))
            {
                said[end] += 1;
            }
            if !random.next().is_multiple_of(3) {
                while let Some(payload) = transport.take() {
                    assert_eq!(payload, message(heard[end], 1 - end), "message {} for {end}", heard[end]);
                    heard[end] += 1;
                }
            }
        }
        let (from_host, _) = deliver(&mut host, &mut card, faults, &mut random);
        let (from_card, events) = deliver(&mut card, &mut host, faults, &mut random);
        if events.contains(&Event::Unknown) {
            host.send_again();
        }
        quiet = if from_host || from_card { 0 } else { quiet + 1 };
        if quiet > 20 {
            card.acknowledge();
            host.acknowledge();
        }
        if quiet > 40 {
            if heard == [count; 2] && host.is_acknowledged() && card.is_acknowledged() {
                return [host.statistics(), card.statistics()];
            }
            host.probe();
            quiet = 0;
        }
    }
    panic!("stuck: said {said:?}, heard {heard:?}, {faults:?}, seed {seed}");
}

#[test]
fn a_faultless_line_repeats_no_message() {
    for seed in 0..50 {
        for statistics in converse(40, NONE, seed) {
            assert_eq!((statistics.damaged, statistics.repeated, statistics.duplicates), (0, 0, 0));
        }
    }
}

#[test]
fn more_messages_than_sequence_numbers_arrive_in_order() {
    let (mut host, mut card) = (Transport::host(), Transport::card());
    host.open(1);
    let mut random = Random(5);
    let (mut said, mut heard) = (0_u32, 0_u32);
    while heard < 70_000 {
        while host.send(fill(&said.to_le_bytes())) {
            said += 1;
        }
        deliver(&mut host, &mut card, NONE, &mut random);
        while let Some(payload) = card.take() {
            assert_eq!(payload, heard.to_le_bytes());
            heard += 1;
        }
        deliver(&mut card, &mut host, NONE, &mut random);
    }
}

#[test]
fn a_message_of_the_greatest_length_fits_a_frame() {
    for byte in [0, 1, 0xff] {
        let mut host = Transport::host();
        host.open(u32::MAX);
        assert!(host.send(fill(&[byte; MAX_PAYLOAD])));
        let length = host.outgoing().len();
        assert!((MAX_PAYLOAD..=MAX_FRAME).contains(&length), "{length}");
    }
    assert!(!Transport::host().send(|_| Some(MAX_PAYLOAD + 1)));
    assert!(!Transport::host().send(|_| None));
}

#[test]
fn a_reset_card_reports_an_unknown_session_and_a_new_session_replaces_the_old() {
    let mut random = Random(3);
    let (mut host, mut card) = (Transport::host(), Transport::card());
    host.open(7);
    assert!(host.send(fill(b"hello")));
    while deliver(&mut host, &mut card, NONE, &mut random).0 {}
    assert_eq!(card.take(), Some(&b"hello"[..]));
    assert!(card.send(fill(b"of the old session")));
    let mut card = Transport::card();
    assert!(host.send(fill(b"who are you")));
    let mut events = Vec::new();
    for _ in 0..10 {
        deliver(&mut host, &mut card, NONE, &mut random);
        events.extend(deliver(&mut card, &mut host, NONE, &mut random).1);
    }
    assert_eq!(events, [Event::Unknown]);
    assert_eq!(card.take(), None);
    host.open(8);
    assert!(host.send(fill(b"again")));
    for _ in 0..10 {
        deliver(&mut host, &mut card, NONE, &mut random);
    }
    assert_eq!(card.take(), Some(&b"again"[..]));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn messages_arrive_once_whole_and_in_order(
        seed in any::<u64>(),
        flips in 0_u64..1000,
        drops in 0_u64..1000,
        repeats in 0_u64..1000,
    ) {
        let [host, card] = converse(12, Faults { flips, drops, repeats }, seed);
        // Damaged and lost frames are repeated, and few others.
        prop_assert!(host.repeated + card.repeated <= 8 * (1 + host.damaged + card.damaged + host.probes));
    }

    #[test]
    fn arbitrary_bytes_do_not_stop_an_end(garbage in proptest::collection::vec(any::<u8>(), 0..4000), is_card in any::<bool>()) {
        let mut end = if is_card { Transport::card() } else { Transport::host() };
        end.open(0);
        let mut rest = &garbage[..];
        while !rest.is_empty() {
            let (taken, _) = end.receive(rest);
            prop_assert!(taken > 0);
            rest = &rest[taken..];
            let length = end.outgoing().len();
            end.sent(length);
            end.take();
        }
    }
}

/// A card in a session with one host accepts the first message of another host, unless all 32 bits of the
/// session numbers are equal.
#[test]
fn sessions_are_distinguished_by_all_bits_of_their_numbers() {
    for (bit, is_new) in (0..32).map(|bit| (1 << bit, true)).chain([(0, false)]) {
        let mut card = Transport::card();
        for (number, expected) in [(77, true), (77 ^ bit, is_new)] {
            let mut host = Transport::host();
            host.open(number);
            assert!(host.send(fill(&message(1, number as usize))));
            card.receive(host.outgoing());
            assert_eq!(card.take().is_some(), expected, "bit {bit:#x}");
        }
    }
}
