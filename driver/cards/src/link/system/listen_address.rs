//! Addresses on which a card is reached that this process emulates.

use std::path::PathBuf;
use std::str::FromStr;

use super::remote_address::host_name;

/// Address to listen on, an argument of `--listen`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ListenAddress {
    /// A new pseudo terminal.
    Pty,
    /// A TCP port of this machine.
    Tcp {
        /// Name or IP address to bind to.
        host: String,
        /// Port number; 0 lets the system choose a free port.
        port: u16,
    },
    /// A Unix socket.
    Unix {
        /// Path of the socket.
        path: PathBuf,
    },
}

/// Default host name: an address that only this machine can reach.
const LOCAL_HOST: &str = "127.0.0.1";

impl FromStr for ListenAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':').unwrap_or((text, "")) {
            ("pty", "") => Ok(Self::Pty),
            ("tcp", rest) => {
                let (host, port) = rest.rsplit_once(':').unwrap_or(("", rest));
                let host = host_name(if host.is_empty() { LOCAL_HOST } else { host })?;
                let port = if port.is_empty() { Ok(0) } else { port.parse() };
                let port = port.map_err(|_| format!("{rest:?} has no port of 0 to 65535; use tcp:PORT"))?;
                Ok(Self::Tcp { host, port })
            }
            ("unix", path) if !path.is_empty() => Ok(Self::Unix { path: path.into() }),
            _ => Err(format!(
                "{text:?} is no address to listen on; use pty, tcp:PORT, tcp:ADDRESS:PORT or unix:PATH"
            )),
        }
    }
}
