//! Links that need an operating system: serial ports, sockets and pseudo terminals. Browsers have their
//! addresses alone.
#![cfg_attr(target_family = "wasm", expect(dead_code, reason = "a browser opens no links"))]

mod error;
mod listen_address;
mod reach;
mod remote_address;
mod serial_options;

#[cfg(not(target_family = "wasm"))]
mod host_port;
#[cfg(not(target_family = "wasm"))]
mod listener;
#[cfg(unix)]
mod pty;
#[cfg(not(target_family = "wasm"))]
mod serial;
#[cfg(not(target_family = "wasm"))]
mod socket;
#[cfg(not(target_family = "wasm"))]
mod stream;
#[cfg(not(any(unix, target_family = "wasm")))]
mod unsupported;

pub use error::LinkError;
#[cfg(not(target_family = "wasm"))]
pub use host_port::HostPort;
pub use listen_address::ListenAddress;
#[cfg(not(target_family = "wasm"))]
pub use listener::Listener;
pub use reach::reach;
pub use remote_address::{RemoteAddress, host_name};
#[cfg(not(target_family = "wasm"))]
pub use serial::{ListedPort, SerialLink, list_serial_ports, open_serial};
pub use serial_options::SerialOptions;
#[cfg(not(target_family = "wasm"))]
pub use socket::connect_tcp;
#[cfg(unix)]
pub use socket::connect_unix;
#[cfg(not(target_family = "wasm"))]
pub use stream::StreamPort;
#[cfg(not(any(unix, target_family = "wasm")))]
pub use unsupported::connect_unix;
