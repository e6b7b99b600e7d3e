//! Cards: links of bytes, the host's end of the protocol, and which card renders which tile.
//!
//! A [`Session`](session::Session) has no I/O: it takes bytes of a [`link`], and says what to send. The
//! [`Scheduler`](scheduler::Scheduler) deals tiles, and a [`Dispatcher`](dispatcher::Dispatcher) hands
//! finished ones to their sinks.
//!
//! | modules | contents |
//! |---|---|
//! | [`link`] | ports of bytes: serial, sockets, pseudo terminals, loopback; faults on purpose |
//! | [`session`] | greeting, upload, tiles and their checks, without I/O |
//! | [`scheduler`], [`dispatcher`] | which card renders which tile; finished tiles to the sinks |
#![forbid(unsafe_code)]

pub mod dispatcher;
pub mod link;
pub mod scheduler;
pub mod session;
