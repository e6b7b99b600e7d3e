//! Test vectors of the protocol: `docs/protocol/vectors.json`, by which ends in other languages are tested,
//! is what this crate and the formats say. `UPDATE_DOCS=1 cargo test -p photoncard-firmware --test vectors`
//! writes it.

mod conversations;
mod json;
mod link;
mod messages;

use std::path::Path;

use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::PROTOCOL_VERSION;

use crate::json::{lines, sections, text};

/// Description of the file, its first field.
const HEADING: &[&str] = &[
    "Test vectors of the protocol of docs/protocol.md. Bytes are in hexadecimal, in the order of the link or of",
    "memory; so are numbers in quotation marks, the highest digit first. Other numbers are decimal.",
    "crc32c, crc64: checksums of bytes.",
    "cobs: plain bytes and their encoding, without the zero at a frame's end. cobs_decoded: encodings that a",
    "decoder takes, and an encoder does not write. cobs_refused: no encodings.",
    "frames: header and payload, the bytes before COBS, and those in the link. dropped_frames: bytes that are",
    "no frame.",
    "link: the frames of both ends of a session, in order, on a link that loses some.",
    "integers: values of up to `bits` bits and their encoding. integers_decoded, integers_refused: as for cobs.",
    "messages: the end that takes it, its name, its fields in the order of the page, and its bytes. `data` is",
    "bytes; an option is null or its value. no_messages: payloads that the end takes for no message.",
    "compute: operands a, b and c, and the 21 words of a result.",
    "images: card images, their checksums, and the answer to EndImage.",
    "card, resident_card: conversations with a card of the budget `budget` and 64 lines of memory, all zero at",
    "first. The second card holds the second of `images` from power-on, read-only. The commands of a step",
    "arrive before the card works on any, and none of the next step before the last answer. Answers are",
    "messages; of that to Hello only the number of written lines is here. Counters may differ.",
];

fn written() -> String {
    let mut all = vec![
        ("about", lines(HEADING.iter().map(|&line| text(line)))),
        ("protocol", PROTOCOL_VERSION.to_string()),
        ("layout", LAYOUT_VERSION.to_string()),
    ];
    all.extend(link::vectors());
    all.extend(messages::vectors());
    all.extend(conversations::vectors());
    sections(&all)
}

#[test]
fn the_file_of_vectors_is_what_the_program_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/protocol/vectors.json");
    let vectors = written();
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, &vectors).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    let mut pairs = found.lines().zip(vectors.lines());
    assert_eq!(pairs.find(|(found, vector)| found != vector), None, "UPDATE_DOCS=1 writes the file");
    assert!(found == vectors, "UPDATE_DOCS=1 writes the file");
}
