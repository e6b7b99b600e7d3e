//! Addresses of cards that are not emulated in this process.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use super::serial_options::SerialOptions;
use crate::link::LentCard;

/// Address of a card that is not emulated in this process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RemoteAddress {
    /// A serial port or pseudo terminal.
    Serial {
        /// Path of the device.
        path: PathBuf,
        /// Speed, bit/s.
        baud: u32,
        /// Lines of the port, and the wait for an unplugged board.
        options: SerialOptions,
    },
    /// TCP port on which the card listens.
    Tcp {
        /// Name or IP address of the machine on which the card listens.
        host: String,
        /// Port number.
        port: u16,
    },
    /// Unix socket on which the card listens.
    Unix {
        /// Path of the socket.
        path: PathBuf,
    },
    /// Card that another part of this process lends. It has no text form that is parsed.
    Lent(LentCard),
}

/// Default speed of a serial port, bit/s.
const DEFAULT_BAUD: u32 = 115_200;
/// Minimum speed of a serial port, bit/s. A card acknowledges every second message, and counts as lost after
/// 10 s of silence. At this speed it receives four of the longest frames in 9 s, so that one acknowledgement
/// may be lost.
const MIN_BAUD: u32 = 4800;

impl RemoteAddress {
    /// Valid forms of an address, for help texts.
    pub const FORMS: &str =
        "serial:PATH[@BAUD][,dtr=on|off][,rts=on|off][,wait=SECONDS], tcp:HOST:PORT or unix:PATH";

    /// Creates the address of a serial port at the default speed.
    pub fn serial(path: impl Into<PathBuf>) -> Self {
        Self::Serial { path: path.into(), baud: DEFAULT_BAUD, options: SerialOptions::default() }
    }

    /// Time for which a render without any other card waits for this card to come back after a loss. A board
    /// may be plugged in again. The process behind a socket has ended.
    pub fn wait_for_return(&self) -> Duration {
        match self {
            Self::Serial { options, .. } => options.wait(),
            Self::Tcp { .. } | Self::Unix { .. } | Self::Lent(_) => Duration::ZERO,
        }
    }

    /// Parses an address. `kind` is the text before the first colon, and `rest` the text after it. Returns
    /// `None` if there is no such kind of link.
    ///
    /// # Errors
    /// A sentence that names the valid form.
    pub fn parse(kind: &str, rest: &str) -> Option<Result<Self, String>> {
        Some(match kind {
            "serial" => serial(rest),
            "tcp" => tcp(rest),
            "unix" if rest.is_empty() => Err("a card on a Unix socket is unix:PATH".into()),
            "unix" => Ok(Self::Unix { path: rest.into() }),
            _ => return None,
        })
    }
}

impl fmt::Display for RemoteAddress {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Serial { path, baud, options } => write!(f, "serial:{}@{baud}{options}", path.display()),
            Self::Tcp { host, port } => f.write_str(&tcp_address(host, *port)),
            Self::Unix { path } => write!(f, "unix:{}", path.display()),
            Self::Lent(card) => card.fmt(f),
        }
    }
}

fn serial(text: &str) -> Result<RemoteAddress, String> {
    // Folders of the path may contain a comma, and the path an @.
    let name = text.rfind('/').map_or(0, |slash| slash + 1);
    let (port, options) = match text[name..].find(',') {
        Some(comma) => (&text[..name + comma], Some(&text[name + comma + 1..])),
        None => (text, None),
    };
    let (path, baud) = match port.rsplit_once('@') {
        Some((path, baud)) if !baud.contains('/') => (path, Some(baud)),
        _ => (port, None),
    };
    if path.is_empty() {
        return Err(
            "a card on a serial port is serial:PATH[@BAUD], such as serial:/dev/ttyUSB0@115200".into()
        );
    }
    let baud = baud.map_or(Ok(DEFAULT_BAUD), speed)?;
    let options = options.map_or(Ok(SerialOptions::default()), str::parse)?;
    Ok(RemoteAddress::Serial { path: path.into(), baud, options })
}

fn speed(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(baud) if baud >= MIN_BAUD => Ok(baud),
        Ok(baud) if baud > 0 => Err(format!(
            "{baud} bits a second are too slow: a card would be taken for silent; use {MIN_BAUD} or more, such as 115200"
        )),
        _ => Err(format!("{text:?} is no speed in bits a second; use one such as 115200")),
    }
}

fn tcp(text: &str) -> Result<RemoteAddress, String> {
    let usage = || format!("{text:?} is no TCP address; use tcp:HOST:PORT, such as tcp:localhost:7000");
    let (host, port) = text.rsplit_once(':').ok_or_else(usage)?;
    let port = port.parse().ok().filter(|&port| port > 0).ok_or_else(usage)?;
    Ok(RemoteAddress::Tcp { host: host_name(host)?, port })
}

/// Formats a TCP address as an argument of `--card`.
pub(crate) fn tcp_address(host: &str, port: u16) -> String {
    if host.contains(':') { format!("tcp:[{host}]:{port}") } else { format!("tcp:{host}:{port}") }
}

/// Parses a host name or address; the brackets of an IPv6 address are removed.
pub fn host_name(text: &str) -> Result<String, String> {
    match text.strip_prefix('[').and_then(|text| text.strip_suffix(']')) {
        Some(address) if !address.is_empty() => Ok(address.into()),
        None if !text.is_empty() && !text.contains([':', '[', ']']) => Ok(text.into()),
        _ => Err(format!("{text:?} is no host; use a name, an IPv4 address or an IPv6 address in brackets")),
    }
}
