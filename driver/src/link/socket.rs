//! Links to cards on sockets.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
#[cfg(unix)]
use std::os::unix::net::UnixStream;
#[cfg(unix)]
use std::path::Path;
use std::time::Duration;

use rustix::net::sockopt;

use super::{LinkError, StreamPort};

/// How long a connection may take to be made.
const CONNECT_WAIT: Duration = Duration::from_secs(5);

/// Connects to a card that listens on a TCP port.
///
/// # Errors
/// If the host has no address, or none that accepts within seconds.
pub fn connect_tcp(host: &str, port: u16) -> Result<StreamPort<TcpStream>, LinkError> {
    connect(host, port).map_err(|error| LinkError::connect(tcp_address(host, port), &error))
}

/// How a TCP address is written as an argument.
pub(crate) fn tcp_address(host: &str, port: u16) -> String {
    if host.contains(':') { format!("tcp:[{host}]:{port}") } else { format!("tcp:{host}:{port}") }
}

/// The host of an address, without the brackets that an IPv6 address is written in.
pub(crate) fn host_name(text: &str) -> Result<String, String> {
    match text.strip_prefix('[').and_then(|text| text.strip_suffix(']')) {
        Some(address) if !address.is_empty() => Ok(address.into()),
        None if !text.is_empty() && !text.contains([':', '[', ']']) => Ok(text.into()),
        _ => Err(format!("{text:?} is no host; use a name, an IPv4 address or an IPv6 address in brackets")),
    }
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

/// A port on a TCP connection: small frames go at once, and an end that vanishes is noticed.
pub(super) fn tcp_port(stream: TcpStream) -> io::Result<StreamPort<TcpStream>> {
    stream.set_nonblocking(true)?;
    stream.set_nodelay(true)?;
    sockopt::set_socket_keepalive(&stream, true)?;
    #[cfg(target_os = "linux")]
    probe_soon(&stream)?;
    Ok(StreamPort::new(stream))
}

/// Ends a connection that is silent for a minute and answers no probe. Elsewhere the system's own hours pass.
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
/// If there is no such socket, or nothing listens on it.
#[cfg(unix)]
pub fn connect_unix(path: &Path) -> Result<StreamPort<UnixStream>, LinkError> {
    UnixStream::connect(path)
        .and_then(unix_port)
        .map_err(|error| LinkError::connect(format_args!("unix:{}", path.display()), &error))
}

/// A port on a connection of a Unix socket.
#[cfg(unix)]
pub(super) fn unix_port(stream: UnixStream) -> io::Result<StreamPort<UnixStream>> {
    stream.set_nonblocking(true)?;
    Ok(StreamPort::new(stream))
}
