//! Hosts and cards that send anything: a relay neither panics nor hangs.

use std::time::Duration;

use photoncard_driver::render::relay::Relay;
use photoncard_firmware::sampler::hash;
use photoncard_shared::frame::MAX_PAYLOAD;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::link::Port;
use photoncard_shared::message::{self, Command, Fault, FaultCode, PROTOCOL_VERSION, Reply, Tile};
use photoncard_shared::transport::Transport;

use super::network::{Network, Tree};
use super::{Root, render};
use crate::simulation::line::Random;
use crate::simulation::world::{BUDGET, Fixture};
use crate::simulation::{seeds, with_room_for_a_card};

/// Bytes of a message, valid or not.
fn any_command(random: &mut Random, fixture: &Fixture, data: &[u8]) -> Vec<u8> {
    let number = |random: &mut Random| [0, 1, 3, 12, 64, 4096, u32::MAX][random.below(7)];
    let job = fixture.job();
    let (lines, checksum) = (job.upload.lines().len() as u32, job.upload.checksum());
    let hello = Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION };
    let command = match random.below(14) {
        0 => hello,
        1 => Command::ReadChecksums { first: number(random), count: number(random) },
        2 => Command::BeginImage { lines: number(random), checksum },
        3 | 4 => Command::BeginImage { lines, checksum },
        5 => Command::WriteLines { first: number(random), data: &data[..random.below(data.len())] },
        6 => Command::WriteLines { first: number(random) % 64, data: &data[..256] },
        7 => Command::EndImage,
        8 => Command::BeginFrame(job.frame),
        9 => Command::RenderTile(Tile { id: number(random), x: 0, y: 0, width: 3, height: number(random) }),
        10 => Command::Compute { operands: &data[..12 * random.below(10)] },
        11 => Command::TestMemory,
        12 => Command::Flush,
        _ => return data[..random.below(data.len())].to_vec(),
    };
    let mut bytes = vec![0; MAX_PAYLOAD];
    let length = message::encode(&command, &mut bytes).unwrap_or(0);
    bytes[..length].to_vec()
}

/// Bytes of a reply, valid or not.
fn any_reply(random: &mut Random, data: &[u8]) -> Vec<u8> {
    let number = random.below(70) as u32;
    let code = [FaultCode::Internal, FaultCode::ImageChecksum, FaultCode::Order][random.below(3)];
    let hello = Reply::Hello {
        protocol: PROTOCOL_VERSION,
        layout: LAYOUT_VERSION,
        budget: BUDGET,
        written_lines: [0, 64, 4096, u32::MAX][random.below(4)],
        memory_use: None,
        build: "any",
        board: None,
    };
    let reply = match random.below(9) {
        0..3 => hello,
        3 => Reply::Checksums { first: 0, data: &data[..8 * random.below(10)] },
        4 => Reply::ImageAccepted,
        5 => Reply::FrameAccepted,
        6 => Reply::Pixels { tile: number, first: number, data: &data[..60 * random.below(9)] },
        7 => Reply::Fault(Fault { code, detail: number }),
        _ => Reply::Computed { results: &data[..84 * random.below(9)] },
    };
    let mut bytes = vec![0; MAX_PAYLOAD];
    let length = message::encode(&reply, &mut bytes).unwrap_or(0);
    bytes[..length].to_vec()
}

/// Sends a message, and takes and drops all that arrive.
fn say(transport: &mut Transport, end: &mut impl Port, message: &[u8], random: &mut Random) {
    transport.send(|bytes| {
        bytes.get_mut(..message.len())?.copy_from_slice(message);
        Some(message.len())
    });
    let noise: Vec<u8> = (0..random.below(20)).map(|_| random.below(256) as u8).collect();
    let outgoing = if random.below(8) == 0 { &noise[..] } else { transport.outgoing() };
    let sent = end.write(outgoing, Duration::ZERO).unwrap_or(0);
    transport.sent(sent);
    let mut buffer = [0; 4096];
    let count = end.read(&mut buffer, Duration::ZERO).unwrap_or(0);
    let mut rest = &buffer[..count];
    while !rest.is_empty() {
        let (taken, _) = transport.receive(rest);
        rest = &rest[taken..];
        while transport.take().is_some() {}
    }
    transport.acknowledge();
}

#[test]
fn any_commands_of_a_host_are_answered_and_the_next_host_is_served() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let expected = super::alone(&fixture);
        for seed in seeds(1..40) {
            let random = &mut Random(hash(seed));
            let data: Vec<u8> = (0..1100).map(|_| random.below(256) as u8).collect();
            let (mut network, root) = super::plant(&Tree::of_cards(2), &fixture);
            let mut end = root.end.clone();
            let mut transport = Transport::host();
            transport.open(77);
            let hello = Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION };
            let mut first = [0; 16];
            let length = message::encode(&hello, &mut first).unwrap();
            transport.send(|bytes| {
                bytes.get_mut(..length)?.copy_from_slice(&first[..length]);
                Some(length)
            });
            for _ in 0..400 {
                network.tick(|_| {
                    let command = any_command(random, &fixture, &data);
                    say(&mut transport, &mut end, &command, random);
                });
            }
            let mut root = Root::new(root.end, 78, network.now());
            let rendered = render(&mut network, std::slice::from_mut(&mut root), &fixture);
            assert!(rendered.is_some_and(|rendered| rendered == expected), "seed {seed}: {:?}", root.error);
        }
    });
}

#[test]
fn any_replies_of_a_card_cost_at_most_the_session() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let expected = super::alone(&fixture);
        let mut complete = 0;
        for seed in seeds(1..60) {
            let random = &mut Random(hash(seed));
            let data: Vec<u8> = (0..1100).map(|_| random.below(256) as u8).collect();
            let mut network = Network::default();
            let good = network.add(&Tree::Card, &fixture);
            let bad = network.add(&Tree::Card, &fixture);
            network.leaves[1].is_dead = true;
            let mut bad_end = network.leaves[1].end.clone();
            let cards = vec![("good".into(), good, BUDGET), ("bad".into(), bad, BUDGET)];
            let relay = Relay::new(cards, seed << 8, &|_| {}).unwrap();
            // The unused card of this link gives the relay its place.
            let place = network.add(&Tree::Card, &fixture);
            let leaf = network.leaves.pop().unwrap();
            network.relays.push((relay, leaf.end));
            let mut roots = [Root::new(place, seed, Duration::ZERO)];
            let mut transport = Transport::card();
            let rendered = super::render_until(&mut network, &mut roots, &fixture, |_, _| {
                let reply = any_reply(random, &data);
                say(&mut transport, &mut bad_end, &reply, random);
                false
            });
            complete += u32::from(rendered.is_some());
            assert!(rendered.is_none_or(|rendered| rendered == expected), "seed {seed}");
        }
        assert!(complete > 0);
    });
}
