//! Addresses of cards, as in the arguments of `--card`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use photoncard_cards::link::{host_name, tcp_address};
use photoncard_picture::choice::Choice;

use super::RenderError;
use crate::emulator::EmulatedKind;

/// Address of one card, or of several emulated cards: an argument of `--card`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CardAddress {
    /// Emulated chips in this process.
    Emulated {
        /// Kind of the chips.
        kind: EmulatedKind,
        /// Number of chips.
        chips: usize,
    },
    /// A card at the other end of a link.
    Remote(RemoteAddress),
}

/// Address of a card that is not emulated in this process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RemoteAddress {
    /// A serial port or pseudo terminal.
    Serial {
        /// Path of the device.
        path: PathBuf,
        /// Speed, bit/s.
        baud: u32,
    },
    /// TCP port on which the card listens.
    Tcp {
        /// Name or IP address of the host.
        host: String,
        /// Port number.
        port: u16,
    },
    /// Unix socket on which the card listens.
    Unix {
        /// Path of the socket.
        path: PathBuf,
    },
}

/// Maximum number of chips that one process emulates.
const MAX_CHIPS: usize = 1024;
/// Default speed of a serial port, bit/s.
const DEFAULT_BAUD: u32 = 115_200;
/// Minimum speed of a serial port, bit/s. A card is silent while it receives two whole frames and
/// acknowledges them. Even if one acknowledgement is lost, the next must arrive within the 10 s after which a
/// card counts as lost.
const MIN_BAUD: u32 = 4800;

impl Default for CardAddress {
    /// One emulated reference chip.
    fn default() -> Self {
        Self::Emulated { kind: EmulatedKind::Reference, chips: 1 }
    }
}

impl CardAddress {
    /// Emulated chips of a kind in this process, one per processor core.
    pub fn emulated(kind: EmulatedKind) -> Self {
        let chips = std::thread::available_parallelism().map_or(1, usize::from);
        Self::Emulated { kind, chips }
    }

    /// Card on a serial port at the default speed.
    pub fn serial(path: impl Into<PathBuf>) -> Self {
        Self::Remote(RemoteAddress::Serial { path: path.into(), baud: DEFAULT_BAUD })
    }

    /// Forms of an address, for a line of help.
    pub fn forms() -> String {
        let emulated: String =
            EmulatedKind::ALL.iter().map(|kind| format!("{}[:CHIPS], ", kind.name())).collect();
        format!("{emulated}serial:PATH[@BAUD], tcp:HOST:PORT or unix:PATH")
    }

    /// Number of chips at this address that this process emulates.
    pub(super) fn emulated_chips(&self) -> usize {
        match *self {
            Self::Emulated { chips, .. } => chips,
            Self::Remote(_) => 0,
        }
    }

    /// Name in errors of card number `index` at this address. It includes the address if the card is not
    /// emulated.
    pub(super) fn name_of(&self, index: usize) -> String {
        match self {
            Self::Emulated { .. } => format!("card {index}"),
            Self::Remote(address) => format!("card {index} ({address})"),
        }
    }

    /// Memory size of each card at this address, bytes. For a remote card it is the maximum that a card can
    /// report.
    pub fn dram_bytes(&self) -> u32 {
        match self {
            Self::Emulated { kind, .. } => kind.budget().dram_bytes,
            Self::Remote(_) => u32::MAX,
        }
    }
}

/// Checks the number of emulated chips.
///
/// # Errors
/// If there are more than `MAX_CHIPS`.
pub(super) fn check_chips(chips: usize) -> Result<(), RenderError> {
    if chips <= MAX_CHIPS {
        return Ok(());
    }
    Err(RenderError::Setting {
        option: "--card",
        value: format!("with {chips} chips in all"),
        reason: format!("one process emulates at most {MAX_CHIPS}"),
        remedy: "use fewer chips".into(),
    })
}

/// Returns whether the addresses name exactly one card, and it is emulated.
pub(super) fn is_one_emulated_chip(addresses: &[CardAddress]) -> bool {
    matches!(addresses, [CardAddress::Emulated { chips: 1, .. }])
}

/// First address of a card that is not emulated in this process.
pub(super) fn first_remote(addresses: &[CardAddress]) -> Option<&CardAddress> {
    addresses.iter().find(|address| !matches!(address, CardAddress::Emulated { .. }))
}

impl fmt::Display for CardAddress {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Emulated { kind, chips } => write!(f, "{}:{chips}", kind.name()),
            Self::Remote(address) => address.fmt(f),
        }
    }
}

impl fmt::Display for RemoteAddress {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Serial { path, baud } => write!(f, "serial:{}@{baud}", path.display()),
            Self::Tcp { host, port } => f.write_str(&tcp_address(host, *port)),
            Self::Unix { path } => write!(f, "unix:{}", path.display()),
        }
    }
}

impl FromStr for CardAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, rest) = text.split_once(':').map_or((text, None), |(kind, rest)| (kind, Some(rest)));
        if let Ok(kind) = EmulatedKind::of_name(kind) {
            return emulated(kind, rest);
        }
        match kind {
            "serial" => serial(rest.unwrap_or_default()).map(Self::Remote),
            "tcp" => tcp(rest.unwrap_or_default()).map(Self::Remote),
            "unix" => match rest {
                Some(path) if !path.is_empty() => Ok(Self::Remote(RemoteAddress::Unix { path: path.into() })),
                _ => Err("a card on a Unix socket is unix:PATH".into()),
            },
            _ => Err(format!("{kind:?} is no kind of card; use {}", Self::forms())),
        }
    }
}

fn emulated(kind: EmulatedKind, chips: Option<&str>) -> Result<CardAddress, String> {
    let Some(text) = chips else { return Ok(CardAddress::emulated(kind)) };
    let chips = text.parse().ok().filter(|count| (1..=MAX_CHIPS).contains(count));
    let chips = chips.ok_or_else(|| format!("{text:?} is no number of chips; use 1 to {MAX_CHIPS}"))?;
    Ok(CardAddress::Emulated { kind, chips })
}

fn serial(text: &str) -> Result<RemoteAddress, String> {
    // The path itself may contain an @.
    let (path, baud) = match text.rsplit_once('@') {
        Some((path, baud)) if !baud.contains('/') => (path, Some(baud)),
        _ => (text, None),
    };
    if path.is_empty() {
        return Err(
            "a card on a serial port is serial:PATH[@BAUD], such as serial:/dev/ttyUSB0@115200".into()
        );
    }
    let baud = match baud {
        None => DEFAULT_BAUD,
        Some(baud) => speed(baud)?,
    };
    Ok(RemoteAddress::Serial { path: path.into(), baud })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_as_they_are_written() {
        for (text, full) in [
            ("emulated:3", "emulated:3"),
            ("emulated-micro:1", "emulated-micro:1"),
            ("serial:/dev/ttyUSB0", "serial:/dev/ttyUSB0@115200"),
            ("serial:/dev/a@b/c@921600", "serial:/dev/a@b/c@921600"),
            ("serial:/dev/ttyUSB0@4800", "serial:/dev/ttyUSB0@4800"),
            ("serial:/dev/a@b/c", "serial:/dev/a@b/c@115200"),
            ("tcp:localhost:7000", "tcp:localhost:7000"),
            ("tcp:[::1]:7000", "tcp:[::1]:7000"),
            ("unix:/tmp/a:b", "unix:/tmp/a:b"),
        ] {
            let address: CardAddress = text.parse().unwrap();
            assert_eq!(address.to_string(), full);
            assert_eq!(full.parse(), Ok(address));
        }
    }

    #[test]
    fn invalid_addresses_are_refused_with_the_valid_forms() {
        for (text, said) in [
            ("", "no kind of card"),
            ("abacus", "no kind of card"),
            ("emulated:0", "1 to 1024"),
            ("emulated:two", "1 to 1024"),
            ("serial", "serial:PATH"),
            ("serial:@9600", "serial:PATH"),
            ("serial:/dev/ttyUSB0@fast", "no speed"),
            ("serial:/dev/ttyUSB0@0", "no speed"),
            ("serial:/dev/ttyUSB0@2400", "4800 or more"),
            ("tcp", "tcp:HOST:PORT"),
            ("tcp:localhost", "tcp:HOST:PORT"),
            ("tcp:localhost:0", "tcp:HOST:PORT"),
            ("tcp:localhost:65536", "tcp:HOST:PORT"),
            ("tcp::7000", "no host"),
            ("tcp:::1:7000", "in brackets"),
            ("unix:", "unix:PATH"),
        ] {
            let error = text.parse::<CardAddress>().unwrap_err();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
