//! Wire and memory formats of photoncard: bytes, no rendering.
//!
//! Both ends of a link are built on this crate. It says what lies where in a card's memory ([`address`],
//! [`layout`], [`image`]), what a chip can hold ([`budget`]), and how the two ends speak ([`message`] inside
//! [`frame`]). The layers, from memory to wire:
//!
//! | module | unit | what it fixes |
//! |---|---|---|
//! | [`address`] | 128-byte line | how card memory is addressed |
//! | [`layout`] | record | little-endian photons, nodes, triangles, materials, emitters |
//! | [`image`] | section | where the records of a scene lie in the card image |
//! | [`message`] | message | commands of the host, replies of a card |
//! | [`transport`] | message | windowed acknowledgement, selective repetition |
//! | [`frame`] | frame | COBS, header, CRC-32C |
//! | [`link`] | byte | a port: bytes with a bounded wait |
//!
//! Nothing here allocates, and nothing here panics on any input.
#![forbid(unsafe_code)]
#![no_std]
// A chip never panics: what could is kept out, or its reason given.
#![cfg_attr(
    not(test),
    warn(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable
    )
)]

pub mod address;
pub mod budget;
pub mod checksum;
pub mod counters;
pub mod frame;
pub mod image;
pub mod layout;
pub mod link;
pub mod message;
pub mod stuffing;
pub mod transport;
