//! Wire and memory formats of photoncard: bytes, no rendering.
//!
//! Both ends of a link are built on this crate. It defines the contents of a card's memory ([`address`], [`layout`],
//! [`image`]), the capacities of a chip ([`budget`]), and the protocol between the two ends ([`message`] inside
//! [`frame`]). The layers, from memory to wire:
//!
//! | module | unit | contents |
//! |---|---|---|
//! | [`address`] | 128-byte line | addresses of card memory |
//! | [`layout`] | record | little-endian photons, nodes, triangles, materials, emitters |
//! | [`image`] | section | positions of a scene's records in the card image |
//! | [`message`] | message | commands of the host, replies of a card |
//! | [`transport`] | message | windowed acknowledgement, selective repetition |
//! | [`frame`] | frame | COBS, header, CRC-32C |
//! | [`link`] | byte | a port: bytes with a bounded wait |
//!
//! Nothing here allocates, and nothing here panics on any input.
#![forbid(unsafe_code)]
#![no_std]
// A chip never panics: these lints catch what could, and each exception gives its reason.
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
