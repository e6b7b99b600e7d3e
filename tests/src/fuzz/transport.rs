//! Fuzzing of frames and of the transport: arbitrary bytes reach either end of a link.

use photoncard_shared::frame::{
    Frame, FrameHeader, FrameKind, FrameReader, MAX_FRAME, MAX_PAYLOAD, write_frame,
};
use photoncard_shared::transport::{Transport, WINDOW};

use super::random::Random;
use super::target::{Target, bound};
use super::{messages, mutation};

/// Number of the session at both ends.
const SESSION: u32 = 7;
/// Message that both ends send.
const MESSAGE: &[u8] = b"message";
/// Maximum number of frames that an end sends without receiving any: a window of messages, and control
/// frames.
const MAX_FRAMES: usize = WINDOW + 4;

/// Target for frames.
pub(super) struct Frames {
    /// Frames of every kind, in an order that is valid.
    seeds: Vec<(FrameHeader, Vec<u8>)>,
    wires: Vec<Vec<u8>>,
}

impl Frames {
    pub(super) fn new() -> Self {
        let header = |kind, sequence, acknowledged, held| FrameHeader {
            kind,
            session: SESSION,
            sequence,
            acknowledged,
            held,
        };
        let payloads = [messages::commands(), messages::replies()].concat();
        let mut seeds = vec![(header(FrameKind::Open, 0, 0, 0), payloads[0].clone())];
        for (payload, sequence) in payloads.iter().zip(0..) {
            seeds.push((header(FrameKind::Data, sequence, sequence.min(4), 0b101), payload.clone()));
        }
        seeds.push((header(FrameKind::Acknowledge, 0, 2, 0b10), Vec::new()));
        seeds.push((header(FrameKind::Probe, 3, 1, 0), vec![5, 0]));
        seeds.push((header(FrameKind::Answer, 5, 2, 0b1000), vec![2, 0]));
        seeds.push((header(FrameKind::Unknown, 0, 0, 0), Vec::new()));
        seeds.push((header(FrameKind::Data, 4, 3, 0), vec![0; MAX_PAYLOAD]));
        let wires = seeds.iter().map(|(header, payload)| wire(header, payload)).collect();
        Self { seeds, wires }
    }

    /// Encoded frame with an edited header and a correct checksum.
    fn frame(&self, random: &mut Random) -> Vec<u8> {
        let (mut header, mut payload) = random.pick(&self.seeds).clone();
        if random.once_in(2) {
            header.sequence = random.below(8) as u16;
            header.acknowledged = random.below(5) as u16;
        }
        match random.below(8) {
            0 => header.kind = random.pick(&self.seeds).0.kind,
            1 => header.held = random.next() as u8,
            2 => header.sequence = header.sequence.wrapping_sub(random.below(6) as u16),
            3 => header.sequence ^= 1 << random.below(16),
            4 => header.acknowledged ^= 1 << random.below(16),
            5 if random.once_in(4) => header.session = header.session.wrapping_add(random.below(3) as u32),
            6 => mutation::edit_bytes(&mut payload, &[], random),
            _ => {}
        }
        payload.truncate(MAX_PAYLOAD);
        wire(&header, &payload)
    }
}

fn wire(header: &FrameHeader, payload: &[u8]) -> Vec<u8> {
    let mut wire = heapless::Vec::<u8, MAX_FRAME>::new();
    write_frame(header, payload, &mut wire);
    assert!(!wire.is_empty(), "there is room for every payload");
    wire.to_vec()
}

/// Reads all frames, `step` bytes at a time. A valid frame that is encoded again must be read as an equal
/// frame. Returns whether there was a valid frame.
fn read_frames(input: &[u8], step: usize) -> bool {
    let mut reader = FrameReader::new();
    let mut is_whole = false;
    for chunk in input.chunks(step) {
        let mut rest = chunk;
        while !rest.is_empty() {
            let (taken, frame) = reader.read(rest);
            assert!((1..=rest.len()).contains(&taken), "{taken} bytes are taken of {}", rest.len());
            rest = &rest[taken..];
            if let Some(Ok(Frame { header, payload })) = frame {
                is_whole = true;
                let wire = wire(&header, payload);
                let mut again = FrameReader::new();
                assert_eq!(again.read(&wire), (wire.len(), Some(Ok(Frame { header, payload }))));
            }
        }
    }
    is_whole
}

/// Takes all that an end sends: at most [`MAX_FRAMES`] frames, all valid.
fn drain(end: &mut Transport) {
    for _ in 0..MAX_FRAMES {
        let wire = end.outgoing();
        if wire.is_empty() {
            return;
        }
        let whole = FrameReader::new().read(wire).1.is_some_and(|frame| frame.is_ok());
        assert!(whole && wire.len() <= MAX_FRAME, "what is sent is no frame: {wire:?}");
        let length = wire.len();
        end.sent(length);
    }
    panic!("more than {MAX_FRAMES} frames are sent unasked");
}

fn send(end: &mut Transport) -> bool {
    end.send(|bytes| {
        bytes.get_mut(..MESSAGE.len())?.copy_from_slice(MESSAGE);
        Some(MESSAGE.len())
    })
}

/// Feeds an end bytes, `step` at a time. The end answers each message by another.
fn feed(end: &mut Transport, input: &[u8], step: usize) {
    for chunk in input.chunks(step) {
        let mut rest = chunk;
        while !rest.is_empty() {
            let (taken, _) = end.receive(rest);
            assert!((1..=rest.len()).contains(&taken), "{taken} bytes are taken of {}", rest.len());
            rest = &rest[taken..];
            while let Some(message) = end.take() {
                assert!(message.len() <= MAX_PAYLOAD);
                send(end);
            }
            end.acknowledge();
        }
        drain(end);
    }
}

/// Returns whether the card accepts a new session of the host, whatever the card has received before.
fn is_heard(card: &mut Transport) -> bool {
    card.receive(&[0]);
    (SESSION + 1000..).take(2).any(|session| {
        let mut host = Transport::host();
        host.open(session);
        send(&mut host);
        let wire = host.outgoing().to_vec();
        card.receive(&wire);
        card.take() == Some(MESSAGE)
    })
}

impl Target for Frames {
    fn name(&self) -> &'static str {
        "frames"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        bound(input, 16)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut bytes = Vec::new();
        for _ in 0..1 + random.below(12) {
            bytes.extend(self.frame(random));
        }
        if random.once_in(2) {
            mutation::edit(&mut bytes, &self.wires, random);
        }
        bytes
    }

    fn read(&self, input: &[u8]) -> bool {
        let step = 1 + input.iter().map(|&byte| usize::from(byte)).sum::<usize>() % 1500;
        let is_whole = read_frames(input, step);
        let mut card = Transport::card();
        feed(&mut card, input, step);
        assert!(is_heard(&mut card), "the card does not hear another session");
        let mut host = Transport::host();
        host.open(SESSION);
        for _ in 0..3 {
            send(&mut host);
        }
        drain(&mut host);
        host.probe();
        drain(&mut host);
        feed(&mut host, input, step);
        is_whole
    }
}
