//! Wire and memory formats of photoncard, without any rendering.
//!
//! The firmware and the host use this crate. It defines the contents of a card's memory ([`address`],
//! [`layout`], [`image`]), the capacities of a chip ([`budget`]), and the protocol of a link ([`message`],
//! [`transport`], [`frame`]).
//!
//! # Example
//!
//! A host sends its first message to a card. The caller transports the bytes:
//!
//! ```
//! use photoncard_shared::image::LAYOUT_VERSION;
//! use photoncard_shared::message::{self, Command, PROTOCOL_VERSION};
//! use photoncard_shared::transport::Transport;
//!
//! let (mut host, mut card) = (Transport::host(), Transport::card());
//! let hello = Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION };
//! // A session has a random number.
//! host.open(0x5eed);
//! assert!(host.send(|payload| message::encode(&hello, payload)));
//!
//! let frame = host.outgoing().to_vec();
//! host.sent(frame.len());
//! let (taken, _) = card.receive(&frame);
//! assert_eq!(taken, frame.len());
//! let payload = card.take().expect("the link has lost nothing");
//! assert_eq!(message::decode(payload), Some(hello));
//! ```
//!
//! # Layers
//!
//! Card memory, from bottom to top:
//!
//! | module | unit | contents |
//! |---|---|---|
//! | [`address`] | 128-byte line | addresses of card memory |
//! | [`layout`] | record | little-endian photons, nodes, triangles, materials, emitters |
//! | [`image`] | section | positions of a scene's records in the card image |
//! | [`budget`] | | capacities of a chip, and limits for all kinds of chips |
//!
//! Protocol, from bottom to top:
//!
//! | module | unit | contents |
//! |---|---|---|
//! | [`link`] | byte | a port: bytes with a bounded wait |
//! | [`handover`] | byte | hosts that come and go on one link, of which the card makes one |
//! | [`stuffing`], [`checksum`] | byte | COBS; CRC-32C and CRC-64/XZ |
//! | [`frame`] | frame | header, payload, checksum |
//! | [`transport`] | message | windowed acknowledgement, selective repetition |
//! | [`message`] | message | commands of the host, replies of a card, faults |
//! | [`counters`] | | counts of the work on a tile, which a card reports when the tile is complete |
//!
//! [`hash`] is the hash from which all random numbers are made.
//!
//! No function allocates or panics, whatever the input. `docs/protocol.md` describes the protocol for other
//! implementations, `docs/glossary.md` defines the terms. [`heapless`] is a public dependency: its vectors
//! are in signatures of [`frame`] and [`stuffing`].
#![forbid(unsafe_code)]
#![no_std]
// A chip must never panic: these lints warn of code that could, and each exception gives its reason.
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

pub use heapless;

pub mod address;
pub mod budget;
pub mod checksum;
pub mod counters;
pub mod embedded;
pub mod frame;
pub mod handover;
pub mod hash;
pub mod image;
pub mod layout;
pub mod link;
pub mod message;
pub mod stuffing;
pub mod transport;
