//! What crosses the wire: frames come back whole or not at all, opcodes stay what they are.

use photoncard_shared::budget::REFERENCE;
use photoncard_shared::counters::Counters;
use photoncard_shared::frame::{FrameError, FrameReader, FrameWriter, MAX_FRAME, MAX_PAYLOAD, checksum};
use photoncard_shared::message::*;
use proptest::prelude::*;

fn frame(payload: &[u8]) -> Vec<u8> {
    let mut writer = FrameWriter::new();
    let fill = |bytes: &mut [u8]| {
        bytes.get_mut(..payload.len())?.copy_from_slice(payload);
        Some(payload.len())
    };
    writer.write(fill).expect("fits").to_vec()
}

/// All frames and errors of `bytes`, given to a reader in pieces of `piece`.
fn read_all(bytes: &[u8], piece: usize) -> Vec<Result<(u16, Vec<u8>), FrameError>> {
    let mut reader = FrameReader::new();
    let mut found = Vec::new();
    for mut chunk in bytes.chunks(piece) {
        while !chunk.is_empty() {
            let (taken, result) = reader.read(chunk);
            found.extend(result.map(|r| r.map(|f| (f.sequence, f.payload.to_vec()))));
            chunk = &chunk[taken..];
        }
    }
    found
}

proptest! {
    #[test]
    fn a_payload_comes_back_whatever_the_pieces(
        payload in proptest::collection::vec(any::<u8>(), 0..MAX_PAYLOAD),
        piece in 1_usize..3000,
    ) {
        let wire = frame(&payload);
        prop_assert!(wire.len() <= MAX_FRAME);
        prop_assert_eq!(read_all(&wire, piece), vec![Ok((0, payload))]);
    }

    #[test]
    fn a_flipped_bit_never_yields_another_payload(
        payload in proptest::collection::vec(any::<u8>(), 1..200),
        position in any::<prop::sample::Index>(),
        bit in 0_u32..8,
    ) {
        let mut wire = frame(&payload);
        let position = position.index(wire.len());
        wire[position] ^= 1_u8 << bit;
        wire.push(0);
        for found in read_all(&wire, 64).into_iter().flatten() {
            prop_assert_eq!(found, (0, payload.clone()));
        }
    }

    #[test]
    fn after_garbage_the_next_frame_is_found(garbage in proptest::collection::vec(any::<u8>(), 0..6000)) {
        let mut wire = garbage;
        wire.push(0);
        wire.extend(frame(b"good"));
        prop_assert_eq!(read_all(&wire, 100).pop(), Some(Ok((0, b"good".to_vec()))));
    }

    #[test]
    fn no_bytes_make_a_message_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = decode::<Command>(&bytes);
        let _ = decode::<Reply>(&bytes);
    }
}

#[test]
fn frames_are_numbered_and_wrap() {
    let mut writer = FrameWriter::new();
    for expected in (0..=u16::MAX).chain(0..3) {
        let wire = writer.write(|_| Some(0)).unwrap().to_vec();
        assert_eq!(read_all(&wire, 64), vec![Ok((expected, vec![]))]);
    }
    assert_eq!(writer.write(|_| None), None);
    assert_eq!(writer.write(|_| Some(MAX_PAYLOAD + 1)), None);
}

#[test]
fn the_checksum_is_castagnolis() {
    assert_eq!(checksum(b"123456789"), 0xe306_9283);
}

#[test]
fn the_longest_messages_fit_a_frame() {
    let mut bytes = [0; MAX_PAYLOAD];
    let lines = [0xff; 128 * LINES_PER_WRITE];
    assert!(encode(&Command::WriteLines { first: u32::MAX, data: &lines }, &mut bytes).is_some());
    let pixels = [0xff; PIXEL_BYTES * PIXELS_PER_REPLY];
    assert!(encode(&Reply::Pixels { tile: u32::MAX, first: u32::MAX, data: &pixels }, &mut bytes).is_some());
}

fn encoded(message: &impl serde::Serialize) -> Vec<u8> {
    let mut bytes = [0; MAX_PAYLOAD];
    let length = encode(message, &mut bytes).unwrap();
    bytes[..length].to_vec()
}

#[test]
fn opcodes_are_pinned() {
    let tile = Tile { id: 1, x: 2, y: 3, width: 4, height: 5 };
    let commands = [
        Command::Hello { protocol: 1, layout: 1 },
        Command::BeginImage { lines: 2, checksum: 3 },
        Command::WriteLines { first: 0, data: &[9] },
        Command::EndImage,
    ];
    for (opcode, command) in commands.iter().enumerate() {
        assert_eq!(encoded(command)[0] as usize, opcode);
    }
    assert_eq!(encoded(&Command::RenderTile(tile)), [5, 1, 2, 3, 4, 5]);
    assert_eq!(encoded(&Command::ReadCounters), [6]);
    let fault = |code| Reply::Fault(Fault { code, detail: 7 });
    let replies = [
        (Reply::Hello { protocol: 1, layout: 1, budget: REFERENCE, build: "x" }, 0),
        (Reply::ImageAccepted, 1),
        (Reply::FrameAccepted, 2),
        (Reply::Pixels { tile: 1, first: 0, data: &[] }, 3),
        (Reply::TileDone { tile: 1 }, 4),
        (Reply::Counters(Counters::ZERO), 5),
    ];
    for (reply, opcode) in replies {
        assert_eq!(encoded(&reply)[0], opcode);
    }
    assert_eq!(encoded(&fault(FaultCode::Frame)), [6, 0, 7]);
    assert_eq!(encoded(&fault(FaultCode::Depth)), [6, 13, 7]);
}

#[test]
fn a_pixel_survives_its_record() {
    let pixel =
        Pixel { radiance: [1., 2., 3.], albedo: [4., 5., 6.], normal: [7., 8., 9.], depth: f32::INFINITY };
    assert_eq!(Pixel::read(&pixel.to_bytes()), pixel);
}
