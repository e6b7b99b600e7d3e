//! Links to cards: ports that read and write bytes.
//!
//! A card in this process is reached by [`loopback()`], others by serial ports ([`open_serial`], listed by
//! [`list_serial_ports`]) and sockets ([`connect_tcp`], [`connect_unix`]). A [`Listener`] is the card's end:
//! hosts connect to it, one after another, to reach a card that this process emulates ([`HostPort`]). A
//! [`FaultInjector`] simulates a bad line on any of them. Targets without an operating system, such as
//! browsers, have only the loopback and the fault injector.

mod fault_injector;
mod lent;
mod loopback;
mod system;

pub use fault_injector::{FaultInjector, LineFaults};
pub use lent::LentCard;
pub use loopback::{LoopbackPort, loopback};
#[cfg(not(target_family = "wasm"))]
pub use system::{
    HostPort, ListedPort, Listener, SerialLink, StreamPort, connect_tcp, connect_unix, list_serial_ports,
    open_serial,
};
pub use system::{LinkError, ListenAddress, RemoteAddress, SerialOptions, host_name, reach};
