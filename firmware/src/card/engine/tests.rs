//! Tests with full reply buffers: the engine must report a fault instead of losing pixels or checksums.

use std::boxed::Box;
use std::vec;

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::message::{CHUNK_LINES, PIXEL_BYTES};

use super::*;
use crate::kind::Micro;
use crate::memory::Lines;

/// Engine whose reply buffer is full.
fn full() -> Box<Engine<Micro>> {
    let mut engine = Box::new(Engine::new(Chip::new()));
    engine.data.resize(DATA_BYTES, 0).unwrap();
    engine
}

#[test]
fn a_pixel_without_room_in_its_reply_is_a_fault() {
    let (mut engine, mut transport) = (full(), Transport::card());
    let next = (DATA_BYTES / PIXEL_BYTES) as u32;
    let sums = PixelSums::default();
    assert_eq!(engine.add_pixel((0, next), &sums, &mut transport), Err(Invariant::Reply.fault()));
    // The pixel of another tile begins a reply of its own.
    assert_eq!(engine.add_pixel((1, 0), &sums, &mut transport), Ok(()));
}

#[test]
fn a_checksum_without_room_in_its_reply_is_a_fault() {
    let (mut engine, mut transport) = (full(), Transport::card());
    let lines = vec![Line([0; LINE_BYTES]); CHUNK_LINES as usize];
    engine.written = CHUNK_LINES;
    engine.checksums = Some(Checksums::new(0, 1, engine.written).unwrap());
    assert_eq!(engine.work(&mut Lines(&lines), &mut transport), Err(Invariant::Reply.fault()));
    assert!(engine.checksums.is_none() && !engine.has_work());
}
