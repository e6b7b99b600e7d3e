//! Addresses of cards, and their text form.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use photoncard_cards::link::RemoteAddress;
use photoncard_picture::choice::Choice;

use super::RenderError;
use crate::chip::{ChipModel, FILE_FORM, is_file};
use crate::emulator::EmulatedKind;

/// Address of one card, or of several emulated cards: an element of `cards.addresses`.
#[derive(Clone, Debug, PartialEq)]
pub enum CardAddress {
    /// Emulated chips in this process.
    Emulated {
        /// Model of the chips.
        model: ChipModel,
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
        Self::chips(EmulatedKind::Reference.into(), 1)
    }
}

impl CardAddress {
    /// Emulated chips of a model in this process, one per processor core.
    pub fn emulated(model: impl Into<ChipModel>) -> Self {
        Self::chips(model.into(), std::thread::available_parallelism().map_or(1, usize::from))
    }

    /// Emulated chips of a model in this process, each with the memory of its kind.
    fn chips(model: ChipModel, chips: usize) -> Self {
        let memory = model.kind().budget().dram_bytes;
        Self::Emulated { model, chips, memory }
    }

    /// Replaces the memory of emulated cards by `bytes`. The address of a remote card does not change.
    #[must_use]
    pub fn with_memory(self, bytes: u64) -> Self {
        match self {
            Self::Emulated { model, chips, .. } => Self::Emulated { model, chips, memory: bytes },
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
        format!("{emulated}{FILE_FORM}[:CHIPS], {}", RemoteAddress::FORMS)
    }

    /// Number of chips at this address that this process emulates.
    pub(super) fn emulated_chips(&self) -> usize {
        match *self {
            Self::Emulated { chips, .. } => chips,
            Self::Remote(_) => 0,
        }
    }

    /// Name of card number `index` of a render in error messages. The name of a remote card includes this
    /// address, and that of a lent card is its own: lent cards come and go.
    pub(super) fn name_of(&self, index: usize) -> String {
        match self {
            Self::Emulated { .. } => format!("card {index}"),
            Self::Remote(RemoteAddress::Lent(card)) => card.to_string(),
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
            Self::Emulated { model, chips, .. } => write!(f, "{model}:{chips}"),
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

/// Emulated chips of a kind, or of the file at the begin of `rest`.
fn emulated(kind: EmulatedKind, rest: Option<&str>) -> Result<CardAddress, String> {
    let Some(rest) = rest else { return Ok(CardAddress::emulated(kind)) };
    let (file, chips) = match rest.rsplit_once(':') {
        _ if is_file(rest) => (Some(rest), None),
        Some((file, chips)) if is_file(file) => (Some(file), Some(chips)),
        _ => (None, Some(rest)),
    };
    let model = match file {
        Some(file) => format!("{}:{file}", kind.name()).parse()?,
        None => ChipModel::from(kind),
    };
    let Some(text) = chips else { return Ok(CardAddress::emulated(model)) };
    let chips = text.parse().ok().filter(|count| (1..=MAX_CHIPS).contains(count));
    let chips = chips.ok_or_else(|| format!("{text:?} is no number of chips; use 1 to {MAX_CHIPS}"))?;
    Ok(CardAddress::chips(model, chips))
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
            ("serial:/dev/a,b/c,rts=off", "serial:/dev/a,b/c@115200,rts=off"),
            ("serial:COM3@9600,wait=5,rts=off,dtr=on", "serial:COM3@9600,dtr=on,rts=off,wait=5"),
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
    fn the_address_of_a_chip_of_a_file_is_read_as_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a: chip.toml");
        std::fs::write(&path, "[memory]\ndram_bytes = 67108864\n").unwrap();
        let text = format!("emulated:{}", path.display());
        let address: CardAddress = format!("{text}:3").parse().unwrap();
        assert_eq!((address.emulated_chips(), address.dram_bytes()), (3, 64 << 20));
        assert_eq!(address.to_string(), format!("{text}:3"));
        assert_eq!(address.to_string().parse(), Ok(address));
        assert!(matches!(text.parse(), Ok(CardAddress::Emulated { .. })));
        for (wrong, said) in [
            ("emulated:absent.toml", "absent.toml cannot be read"),
            ("emulated:absent.toml:2", "absent.toml cannot be read"),
            ("emulated-large:absent.toml", "emulated:CHIP.toml"),
            (&format!("{text}:0"), "1 to 1024"),
        ] {
            let error = wrong.parse::<CardAddress>().unwrap_err();
            assert!(error.contains(said), "{wrong}: {error}");
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
            ("serial:,dtr=on", "serial:PATH"),
            ("serial:/dev/ttyUSB0@fast,dtr=on", "\"fast\" is no speed"),
            ("serial:/dev/ttyUSB0,cts=on", "\"cts=on\" is no option of a serial port; use dtr=on"),
            ("serial:/dev/ttyUSB0@9600,", "\"\" is no option"),
            ("serial:/dev/ttyUSB0,dtr", "\"dtr\" states neither on nor off"),
            ("serial:/dev/ttyUSB0,rts=1", "\"rts=1\" states neither on nor off; use dtr=on"),
            ("serial:/dev/ttyUSB0,dtr=on,dtr=off", "dtr is stated twice"),
            ("serial:/dev/ttyUSB0,wait=soon", "\"wait=soon\" has no number of seconds from 0 to 604800"),
            ("serial:/dev/ttyUSB0,wait=604801", "\"wait=604801\" has no number of seconds"),
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
