//! Addresses of cards, and their text form.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use photoncard_cards::link::RemoteAddress;
use photoncard_picture::choice::Choice;

use super::RenderError;
use crate::emulator::EmulatedKind;

/// Address of one card, or of several emulated cards: an element of `cards.addresses`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CardAddress {
    /// Emulated chips in this process.
    Emulated {
        /// Kind of the chips.
        kind: EmulatedKind,
        /// Number of chips.
        chips: usize,
        /// Memory of each card, bytes.
        memory: u64,
    },
    /// A card at the other end of a link.
    Remote(RemoteAddress),
}

/// Assumed memory of a remote card while a scene is loaded for it, bytes. The card states its memory later.
const REMOTE_DRAM_BYTES: u64 = 4 << 30;
/// Maximum number of chips that one process emulates.
const MAX_CHIPS: usize = 1024;
impl Default for CardAddress {
    /// One emulated reference chip.
    fn default() -> Self {
        Self::chips(EmulatedKind::Reference, 1)
    }
}

impl CardAddress {
    /// Emulated chips of a kind in this process, one per processor core.
    pub fn emulated(kind: EmulatedKind) -> Self {
        Self::chips(kind, std::thread::available_parallelism().map_or(1, usize::from))
    }

    /// Emulated chips of a kind in this process, each with the memory of its kind.
    fn chips(kind: EmulatedKind, chips: usize) -> Self {
        Self::Emulated { kind, chips, memory: kind.budget().dram_bytes }
    }

    /// Applies `change` to the kind of emulated chips, and sets their memory to the memory of the new kind.
    /// The address of a remote card does not change.
    #[must_use]
    pub fn of_kind(self, change: impl Fn(EmulatedKind) -> EmulatedKind) -> Self {
        match self {
            Self::Emulated { kind, chips, .. } => Self::chips(change(kind), chips),
            remote @ Self::Remote(_) => remote,
        }
    }

    /// Replaces the memory of emulated cards by `bytes`. The address of a remote card does not change.
    #[must_use]
    pub fn with_memory(self, bytes: u64) -> Self {
        match self {
            Self::Emulated { kind, chips, .. } => Self::Emulated { kind, chips, memory: bytes },
            remote @ Self::Remote(_) => remote,
        }
    }

    /// Card on a serial port at the default speed.
    pub fn serial(path: impl Into<PathBuf>) -> Self {
        Self::Remote(RemoteAddress::serial(path))
    }

    /// Text that lists the valid forms of an address, for help and errors.
    pub fn forms() -> String {
        let emulated: String =
            EmulatedKind::ALL.iter().map(|kind| format!("{}[:CHIPS], ", kind.name())).collect();
        format!("{emulated}{}", RemoteAddress::FORMS)
    }

    /// Number of chips at this address that this process emulates.
    pub(super) fn emulated_chips(&self) -> usize {
        match *self {
            Self::Emulated { chips, .. } => chips,
            Self::Remote(_) => 0,
        }
    }

    /// Name of card number `index` of a render in error messages. The name of a remote card includes this
    /// address.
    pub(super) fn name_of(&self, index: usize) -> String {
        match self {
            Self::Emulated { .. } => format!("card {index}"),
            Self::Remote(address) => format!("card {index} ({address})"),
        }
    }

    /// Memory of a card at this address, bytes. It limits the memory that a scene file may take. A remote
    /// card states its memory only after the scene is loaded; 4 GiB are assumed for it.
    pub fn dram_bytes(&self) -> u64 {
        match *self {
            Self::Emulated { memory, .. } => memory,
            Self::Remote(_) => REMOTE_DRAM_BYTES,
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
        field: "cards.addresses",
        value: format!("with {chips} chips in all"),
        reason: format!("one process emulates at most {MAX_CHIPS}"),
        remedy: "use fewer chips".into(),
    })
}

/// Returns whether the addresses name exactly one card, which is emulated.
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
            Self::Emulated { kind, chips, .. } => write!(f, "{}:{chips}", kind.name()),
            Self::Remote(address) => address.fmt(f),
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
        let remote = RemoteAddress::parse(kind, rest.unwrap_or_default());
        let unknown = || format!("{kind:?} is no kind of card; use {}", Self::forms());
        remote.ok_or_else(unknown)?.map(Self::Remote)
    }
}

fn emulated(kind: EmulatedKind, chips: Option<&str>) -> Result<CardAddress, String> {
    let Some(text) = chips else { return Ok(CardAddress::emulated(kind)) };
    let chips = text.parse().ok().filter(|count| (1..=MAX_CHIPS).contains(count));
    let chips = chips.ok_or_else(|| format!("{text:?} is no number of chips; use 1 to {MAX_CHIPS}"))?;
    Ok(CardAddress::chips(kind, chips))
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
