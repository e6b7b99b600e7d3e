//! Address of a display server, or standard output in its place, and errors of the connection to it.

use std::str::FromStr;
use std::{fmt, io};

use photoncard_cards::link::host_name;

/// Default port of tev.
const DEFAULT_PORT: u16 = 14158;

/// Address of a display: of a server in the form `HOST:PORT`, or `-`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DisplayAddress {
    /// A display server.
    Server {
        /// Name or IP address of the machine.
        host: String,
        /// TCP port.
        port: u16,
    },
    /// The standard output of the process, from which another program reads the packets.
    StandardOutput,
}

impl DisplayAddress {
    /// Description for messages.
    fn described(&self) -> String {
        match self {
            Self::Server { .. } => format!("the display server at {self}"),
            Self::StandardOutput => "the reader of standard output".to_owned(),
        }
    }
}

impl fmt::Display for DisplayAddress {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Server { host, port } if host.contains(':') => write!(f, "[{host}]:{port}"),
            Self::Server { host, port } => write!(f, "{host}:{port}"),
            Self::StandardOutput => f.write_str("-"),
        }
    }
}

impl FromStr for DisplayAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "-" {
            return Ok(Self::StandardOutput);
        }
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
        Ok(Self::Server { host: host_name(host)?, port })
    }
}

/// Error that prevents a picture, or a part of it, from being shown. The render continues.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DisplayError {
    /// The server cannot be reached.
    #[error(
        "cannot reach {}: {source}; start tev there, or leave `outputs.display` out",
        address.described()
    )]
    Connect {
        /// Address of the server.
        address: DisplayAddress,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The connection has ended.
    #[error("{} is gone: {source}", address.described())]
    Gone {
        /// Address of the server.
        address: DisplayAddress,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The server did not take all packets in time.
    #[error("{} takes no more: {packets} packets of the picture are not shown", address.described())]
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
            ("-", "-"),
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
