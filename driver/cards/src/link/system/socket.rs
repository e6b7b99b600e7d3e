//! Links to cards on sockets.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
#[cfg(unix)]
use std::os::unix::net::UnixStream;
#[cfg(unix)]
use std::path::Path;
use std::time::Duration;

use rustix::net::sockopt;

use super::remote_address::tcp_address;
use super::{LinkError, StreamPort};

/// Time limit of a connection attempt.
const CONNECT_WAIT: Duration = Duration::from_secs(5);

/// Connects to a card that listens on a TCP port.
///
/// # Errors
/// If the host name has no address, or no address accepts the connection within 5 s.
pub fn connect_tcp(host: &str, port: u16) -> Result<StreamPort<TcpStream>, LinkError> {
    connect(host, port).map_err(|error| LinkError::connect(tcp_address(host, port), &error))
}

fn connect(host: &str, port: u16) -> io::Result<StreamPort<TcpStream>> {
    let mut last = io::Error::other("the host's name has no address");
    for address in (host, port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_WAIT) {
            Ok(stream) => return tcp_port(stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Creates a port on a TCP connection. Small frames are sent at once, and a vanished peer is detected.
pub(super) fn tcp_port(stream: TcpStream) -> io::Result<StreamPort<TcpStream>> {
    stream.set_nonblocking(true)?;
    stream.set_nodelay(true)?;
    sockopt::set_socket_keepalive(&stream, true)?;
    #[cfg(target_os = "linux")]
    probe_soon(&stream)?;
    Ok(StreamPort::new(stream))
}

/// Sets the times of keep-alive probes: the connection ends after a minute without an answer. Other systems
/// keep their default of hours.
#[cfg(target_os = "linux")]
fn probe_soon(stream: &TcpStream) -> io::Result<()> {
    sockopt::set_tcp_keepidle(stream, Duration::from_secs(30))?;
    sockopt::set_tcp_keepintvl(stream, Duration::from_secs(10))?;
    sockopt::set_tcp_keepcnt(stream, 3)?;
    Ok(())
}

/// Connects to a card that listens on a Unix socket.
///
/// # Errors
/// If the socket does not exist, or nothing listens on it.
#[cfg(unix)]
pub fn connect_unix(path: &Path) -> Result<StreamPort<UnixStream>, LinkError> {
    UnixStream::connect(path)
        .and_then(unix_port)
        .map_err(|error| LinkError::connect(format_args!("unix:{}", path.display()), &error))
}

/// Port on a connection of a Unix socket.
#[cfg(unix)]
pub(super) fn unix_port(stream: UnixStream) -> io::Result<StreamPort<UnixStream>> {
    stream.set_nonblocking(true)?;
    Ok(StreamPort::new(stream))
}
