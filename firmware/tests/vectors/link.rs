//! Vectors of checksums, COBS, frames, and a session on a link that loses frames.

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::checksum::{checksum, image_checksum};
use photoncard_shared::frame::{
    FrameError, FrameHeader, FrameKind, FrameReader, HEADER_BYTES, MAX_FRAME, MAX_PAYLOAD, write_frame,
};
use photoncard_shared::message::{Command, Reply};
use photoncard_shared::stuffing::{stuff, unstuff};
use photoncard_shared::transport::Transport;

use crate::json::{hex, lines, object, text};
use crate::messages::{HELLO, encoded, hello_answers};

const SESSION: u32 = 0x1234_5678;

pub(crate) fn vectors() -> Vec<(&'static str, String)> {
    vec![
        ("crc32c", lines(crc32c())),
        ("crc64", lines(crc64())),
        ("cobs", lines(cobs())),
        ("cobs_decoded", lines(cobs_decoded())),
        ("cobs_refused", lines(cobs_refused())),
        ("frames", lines(frames())),
        ("dropped_frames", lines(dropped_frames())),
        ("link", lines(trace())),
    ]
}

/// `count` bytes that are not zero.
fn bytes(count: usize) -> Vec<u8> {
    (0..count).map(|index| (index % 255 + 1) as u8).collect()
}

fn crc32c() -> Vec<String> {
    [&b"123456789"[..], &[], &[0; 32], &[0xff; 32]]
        .map(|of| object(&[("bytes", hex(of)), ("sum", text(&format!("{:08x}", checksum(of))))]))
        .to_vec()
}

fn crc64() -> Vec<String> {
    let of_bytes = |of: &[u8], sum: u64| object(&[("bytes", hex(of)), ("sum", text(&format!("{sum:016x}")))]);
    let short = b"123456789";
    let line: [u8; LINE_BYTES] = std::array::from_fn(|index| index as u8);
    assert_eq!(bitwise_crc64(&line), image_checksum(&[Line(line)]));
    vec![
        of_bytes(short, bitwise_crc64(short)),
        of_bytes(&line, image_checksum(&[Line(line)])),
        of_bytes(&[0; LINE_BYTES], image_checksum(&[Line::ZERO])),
    ]
}

/// CRC-64/XZ of bytes that are no whole lines.
fn bitwise_crc64(bytes: &[u8]) -> u64 {
    let shifted = |sum: u64, _| (sum >> 1) ^ (0xc96c_5795_d787_0f42 & (sum & 1).wrapping_neg());
    !bytes.iter().fold(u64::MAX, |sum, &byte| (0..8).fold(sum ^ u64::from(byte), shifted))
}

fn cobs() -> Vec<String> {
    let zero_behind = [&bytes(254)[..], &[0]].concat();
    let zero_before = [&[0][..], &bytes(254)].concat();
    let one_behind_zero = [&bytes(254)[..], &[0, 1]].concat();
    let plain = [
        vec![0],
        vec![0, 0],
        vec![1, 0, 2],
        bytes(253),
        bytes(254),
        bytes(255),
        bytes(508),
        bytes(509),
        zero_behind,
        zero_before,
        one_behind_zero,
    ];
    let vector = |plain: Vec<u8>| {
        let mut stuffed = heapless::Vec::<u8, 600>::new();
        assert!(stuff(&[&plain], &mut stuffed));
        assert_eq!(unstuff(&mut stuffed.clone()), Some(&mut plain.clone()[..]));
        object(&[("plain", hex(&plain)), ("stuffed", hex(&stuffed))])
    };
    plain.into_iter().map(vector).collect()
}

/// A group of no bytes behind a full one is decoded.
fn cobs_decoded() -> Vec<String> {
    let mut stuffed = [&[0xff][..], &bytes(254), &[1]].concat();
    let vector = object(&[("stuffed", hex(&stuffed)), ("plain", hex(&bytes(254)))]);
    assert_eq!(unstuff(&mut stuffed), Some(&mut bytes(254)[..]));
    vec![vector]
}

fn cobs_refused() -> Vec<String> {
    let refused: [&mut [u8]; 3] = [&mut [2], &mut [3, 1], &mut [1, 0xff, 1]];
    let vector = |stuffed: &mut [u8]| {
        let vector = hex(stuffed);
        assert_eq!(unstuff(stuffed), None);
        vector
    };
    refused.into_iter().map(vector).collect()
}

const fn header(kind: FrameKind, sequence: u16, acknowledged: u16, held: u8) -> FrameHeader {
    FrameHeader { kind, session: SESSION, sequence, acknowledged, held }
}

fn frame(header: &FrameHeader, payload: &[u8]) -> Vec<u8> {
    let mut wire = heapless::Vec::<u8, { 2 * MAX_FRAME }>::new();
    write_frame(header, payload, &mut wire);
    wire.to_vec()
}

/// Frames, or what they are dropped for, in bytes of the link.
fn read(wire: &[u8]) -> Vec<Result<(FrameHeader, Vec<u8>), FrameError>> {
    let mut reader = FrameReader::new();
    let mut rest = wire;
    let mut found = Vec::new();
    while !rest.is_empty() {
        let (taken, result) = reader.read(rest);
        found.extend(result.map(|result| result.map(|frame| (frame.header, frame.payload.to_vec()))));
        rest = &rest[taken..];
    }
    found
}

/// Bytes of a frame before COBS.
fn plain(wire: &[u8]) -> Vec<u8> {
    let mut stuffed = wire[..wire.len() - 1].to_vec();
    unstuff(&mut stuffed).unwrap().to_vec()
}

fn frames() -> Vec<String> {
    let [bare, full] = hello_answers().map(|(reply, _)| encoded(&reply));
    let all: [(&str, FrameHeader, Vec<u8>); 10] = [
        ("open with Hello", header(FrameKind::Open, 0, 0, 0), encoded(&HELLO)),
        ("its answer without options", header(FrameKind::Data, 0, 1, 0), bare),
        ("its answer with options", header(FrameKind::Data, 0, 1, 0), full),
        ("acknowledge", header(FrameKind::Acknowledge, 0, 0x0102, 0), Vec::new()),
        ("acknowledge with two messages held", header(FrameKind::Acknowledge, 0, 1, 0b110), Vec::new()),
        ("probe", header(FrameKind::Probe, 3, 3, 0), vec![5, 1]),
        ("answer", header(FrameKind::Answer, 4, 6, 0), vec![5, 1]),
        ("unknown", header(FrameKind::Unknown, 0, 0, 0), Vec::new()),
        (
            "data of the longest payload",
            header(FrameKind::Data, 0xffff, 0x8000, 0b1000),
            vec![7; MAX_PAYLOAD],
        ),
        ("data of no bytes", header(FrameKind::Data, 9, 9, 0), Vec::new()),
    ];
    let vector = |(name, header, payload): (&str, FrameHeader, Vec<u8>)| {
        let wire = frame(&header, &payload);
        assert_eq!(read(&wire), [Ok((header, payload.clone()))]);
        object(&[
            ("name", text(name)),
            ("kind", (header.kind as u8).to_string()),
            ("session", text(&format!("{:08x}", header.session))),
            ("sequence", header.sequence.to_string()),
            ("acknowledged", header.acknowledged.to_string()),
            ("held", header.held.to_string()),
            ("payload", hex(&payload)),
            ("plain", hex(&plain(&wire))),
            ("link", hex(&wire)),
        ])
    };
    all.into_iter().map(vector).collect()
}

fn dropped_frames() -> Vec<String> {
    let good = frame(&header(FrameKind::Data, 1, 2, 0), &encoded(&Command::Flush));
    let stuffed = |plain: &[u8]| {
        let mut wire = heapless::Vec::<u8, 40>::new();
        assert!(stuff(&[plain, &checksum(plain).to_le_bytes()], &mut wire) && wire.push(0).is_ok());
        wire.to_vec()
    };
    let mut flipped = good.clone();
    flipped[3] ^= 0x10;
    let mut unknown = plain(&good);
    unknown.truncate(HEADER_BYTES);
    unknown[0] = 6;
    let mut cut = good.clone();
    cut.remove(good.len() - 2);
    let all = [
        ("a damaged byte", flipped, FrameError::Checksum),
        ("a lost byte", cut, FrameError::Encoding),
        ("an unknown kind", stuffed(&unknown), FrameError::Kind),
        ("a header that is too short", stuffed(&unknown[..HEADER_BYTES - 1]), FrameError::TooShort),
        (
            "a payload of 1057 bytes",
            frame(&header(FrameKind::Data, 1, 2, 0), &[0; MAX_PAYLOAD + 1]),
            FrameError::TooLong,
        ),
    ];
    let vector = |(why, wire, error): (&str, Vec<u8>, FrameError)| {
        assert_eq!(read(&wire), [Err(error)]);
        object(&[("why", text(why)), ("link", hex(&wire))])
    };
    all.into_iter().map(vector).collect()
}

/// A session of two transports: the frames that they send, in order, and whether the link loses them.
struct Trace {
    host: Transport,
    card: Transport,
    frames: Vec<String>,
}

impl Trace {
    fn say(&mut self, is_host: bool, payload: &[u8]) {
        let end = if is_host { &mut self.host } else { &mut self.card };
        assert!(end.send(|bytes| {
            bytes.get_mut(..payload.len())?.copy_from_slice(payload);
            Some(payload.len())
        }));
    }

    fn host_says(&mut self, command: &Command) {
        self.say(true, &encoded(command));
    }

    fn card_says(&mut self, reply: &Reply) {
        self.say(false, &encoded(reply));
    }

    /// Sends the next frame of an end, which must be of `kind`, and takes what arrives.
    fn pass(&mut self, is_host: bool, kind: FrameKind, is_lost: bool, what: &str) {
        let (from, to) =
            if is_host { (&mut self.host, &mut self.card) } else { (&mut self.card, &mut self.host) };
        let wire = from.outgoing().to_vec();
        from.sent(wire.len());
        let [Ok((header, _))] = &read(&wire)[..] else { panic!("{what}: no frame") };
        assert_eq!(header.kind, kind, "{what}");
        if !is_lost {
            let mut rest = &wire[..];
            while !rest.is_empty() {
                rest = &rest[to.receive(rest).0..];
            }
            while to.take().is_some() {}
        }
        self.frames.push(object(&[
            ("from", text(if is_host { "host" } else { "card" })),
            ("lost", is_lost.to_string()),
            ("what", text(what)),
            ("link", hex(&wire)),
        ]));
    }

    fn is_quiet(&mut self) -> bool {
        self.host.outgoing().is_empty() && self.card.outgoing().is_empty()
    }
}

fn trace() -> Vec<String> {
    use FrameKind::{Acknowledge, Answer, Data, Open, Probe};
    let (host, card) = (Transport::host(), Transport::card());
    let mut trace = Trace { host, card, frames: Vec::new() };
    trace.host.open(SESSION);
    trace.host_says(&HELLO);
    trace.pass(true, Open, false, "message 0: Hello");
    trace.card_says(&hello_answers()[0].0);
    trace.pass(false, Data, false, "message 0: Hello");
    trace.host_says(&Command::ReadChecksums { first: 0, count: 1 });
    trace.host_says(&Command::Flush);
    trace.host_says(&Command::TestMemory);
    trace.pass(true, Data, true, "message 1: ReadChecksums");
    trace.pass(true, Data, false, "message 2: Flush");
    trace.pass(false, Acknowledge, false, "1 is missing, 2 is held");
    trace.pass(true, Data, false, "message 1 again, before a message that was not sent yet");
    trace.pass(true, Data, false, "message 3: TestMemory");
    trace.pass(false, Acknowledge, false, "three messages have been taken since the last");
    trace.card_says(&Reply::Checksums { first: 0, data: &[1, 2, 3, 4, 5, 6, 7, 8] });
    trace.pass(false, Data, false, "message 1: Checksums");
    trace.card_says(&Reply::ImageAccepted);
    trace.pass(false, Data, true, "message 2: ImageAccepted");
    trace.host_says(&Command::EndImage);
    trace.pass(true, Data, true, "message 4: EndImage");
    assert!(trace.is_quiet());
    trace.host.probe();
    trace.pass(true, Probe, false, "after 0.2 s of silence");
    trace.pass(false, Answer, false, "message 4 has not arrived; the card's next message has the number 3");
    trace.pass(true, Data, false, "message 4 again: it was sent before the probe");
    trace.pass(
        true,
        Probe,
        false,
        "at once: the card's messages below 3 that are not acknowledged here are lost",
    );
    trace.pass(false, Data, false, "message 2 again");
    trace.pass(false, Answer, false, "to the second probe");
    trace.host.acknowledge();
    trace.pass(true, Acknowledge, false, "the link is idle");
    assert!(trace.is_quiet() && trace.host.is_acknowledged() && trace.card.is_acknowledged());
    trace.frames
}
