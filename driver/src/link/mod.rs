//! Links to cards: ports of bytes.

mod loopback;

pub use loopback::{LoopbackPort, loopback};
