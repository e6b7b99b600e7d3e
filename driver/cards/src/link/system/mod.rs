//! Links that need an operating system: serial ports, sockets and pseudo terminals.

mod error;
mod host_port;
mod listener;
mod remote_address;
mod serial;
mod serial_options;
mod socket;
mod stream;

#[cfg(unix)]
mod pty;
#[cfg(not(unix))]
mod unsupported;

pub use error::LinkError;
pub use host_port::HostPort;
pub use listener::{ListenAddress, Listener};
pub use remote_address::RemoteAddress;
pub use serial::{ListedPort, SerialLink, list_serial_ports, open_serial};
pub use serial_options::SerialOptions;
pub use socket::connect_tcp;
#[cfg(unix)]
pub use socket::connect_unix;
pub use socket::host_name;
pub use stream::StreamPort;
#[cfg(not(unix))]
pub use unsupported::connect_unix;
