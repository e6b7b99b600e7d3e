//! Links to cards: ports of bytes.
//!
//! A card in this process is on a [`loopback()`]; others are reached over serial ports ([`open_serial`], listed by
//! [`list_serial_ports`]) and sockets ([`connect_tcp`], [`connect_unix`]). A [`Listener`] is the opposite end: hosts
//! connect to it to reach a card that this process emulates, one after another ([`HostPort`]). A [`FaultInjector`]
//! simulates a bad line on any of them.

mod error;
mod fault_injector;
mod host_port;
mod listener;
mod loopback;
mod serial;
mod serial_list;
mod socket;
mod stream;

#[cfg(unix)]
mod pty;
#[cfg(not(unix))]
mod unsupported;

pub use error::LinkError;
pub use fault_injector::{FaultInjector, LineFaults};
pub use host_port::HostPort;
pub use listener::{ListenAddress, Listener};
pub use loopback::{LoopbackPort, loopback};
pub use serial::{SerialLink, open_serial};
pub use serial_list::{ListedPort, list_serial_ports};
pub use socket::connect_tcp;
#[cfg(unix)]
pub use socket::connect_unix;
pub(crate) use socket::{host_name, tcp_address};
pub use stream::StreamPort;
#[cfg(not(unix))]
pub use unsupported::connect_unix;
