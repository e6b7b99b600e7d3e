//! Access to cards: byte links, the host's end of the protocol, and the assignment of tiles.
//!
//! A [`Session`](session::Session) performs no I/O: it consumes the bytes that a [`link`] received, and
//! supplies the bytes to send. The [`Scheduler`](scheduler::Scheduler) assigns tiles to cards, and a
//! [`Dispatcher`](dispatcher::Dispatcher) passes finished tiles to their sinks.
//!
//! | modules | contents |
//! |---|---|
//! | [`link`] | ports of bytes: serial, sockets, pseudo terminals, loopback; injected faults |
//! | [`session`] | greeting, upload, tiles and their checks, without I/O |
//! | [`scheduler`], [`dispatcher`] | choice of a card for each tile; delivery of finished tiles to sinks |
#![forbid(unsafe_code)]

pub mod dispatcher;
pub mod link;
pub mod scheduler;
pub mod session;
