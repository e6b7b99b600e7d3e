//! Option of a kind of emulated chips that a file describes.

use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use photoncard_driver::emulator::{Emulated, EmulatedKind};

#[derive(Args)]
pub(crate) struct ChipOption {
    /// Emulate chips with the capacities in a JSON file, whatever kind --card names
    #[arg(long, value_name = "CHIP.json", value_parser = kind(), help_heading = "Cards", hide_short_help = true)]
    chip: Option<EmulatedKind>,
}

impl ChipOption {
    /// The kind of the file, or `kind` without one.
    pub(crate) fn or(&self, kind: EmulatedKind) -> EmulatedKind {
        self.chip.unwrap_or(kind)
    }

    /// Returns whether a file is stated.
    pub(crate) fn is_stated(&self) -> bool {
        self.chip.is_some()
    }
}

/// Parser of the name of a file with a kind of chips.
fn kind() -> impl TypedValueParser<Value = EmulatedKind> {
    PathBufValueParser::new().try_map(|path| Emulated::read(&path).map(EmulatedKind::File))
}
