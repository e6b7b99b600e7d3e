//! Address of a display server, and errors of the connection to it.

use std::str::FromStr;
use std::{fmt, io};

use photoncard_cards::link::host_name;

/// Default port of tev.
const DEFAULT_PORT: u16 = 14158;

/// Address of a display server in the form `HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DisplayAddress {
    /// Name or IP address of the machine.
    pub host: String,
    /// TCP port.
    pub port: u16,
}

impl fmt::Display for DisplayAddress {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { host, port } = self;
        if host.contains(':') { write!(f, "[{host}]:{port}") } else { write!(f, "{host}:{port}") }
    }
}

impl FromStr for DisplayAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (host, port) = match text.rsplit_once(':') {
            // The colons of an IPv6 address are in brackets.
            Some((host, port)) if !port.ends_with(']') => (host, Some(port)),
            _ => (text, None),
        };
        let usage = || {
            format!(
                "{text:?} is no address of a display server; use HOST:PORT, such as localhost:{DEFAULT_PORT}"
            )
        };
        let port = match port {
            None => DEFAULT_PORT,
            Some(port) => port.parse().ok().filter(|&port| port > 0).ok_or_else(usage)?,
        };
        Ok(Self { host: host_name(host)?, port })
    }
}

/// Error that prevents a picture, or a part of it, from being shown. The render continues.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DisplayError {
    /// The server cannot be reached.
    #[error(
        "cannot reach the display server at {address}: {source}; start tev there, or leave `outputs.display` out"
    )]
    Connect {
        /// Address of the server.
        address: DisplayAddress,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The connection has ended.
    #[error("the display server at {address} is gone: {source}")]
    Gone {
        /// Address of the server.
        address: DisplayAddress,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The server did not take all packets in time.
    #[error("the display server at {address} takes no more: {packets} packets of the picture are not shown")]
    Slow {
        /// Address of the server.
        address: DisplayAddress,
        /// Number of packets that the server did not take.
        packets: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_as_they_are_written() {
        for (text, full) in [
            ("localhost", "localhost:14158"),
            ("127.0.0.1:80", "127.0.0.1:80"),
            ("[::1]", "[::1]:14158"),
            ("[::1]:7000", "[::1]:7000"),
        ] {
            let address: DisplayAddress = text.parse().unwrap();
            assert_eq!(address.to_string(), full);
            assert_eq!(full.parse(), Ok(address));
        }
        for (text, said) in [
            ("", "no host"),
            (":14158", "no host"),
            ("localhost:", "HOST:PORT"),
            ("localhost:0", "HOST:PORT"),
            ("localhost:65536", "HOST:PORT"),
            ("::1:7000", "in brackets"),
        ] {
            let error = text.parse::<DisplayAddress>().unwrap_err();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
