//! Options of cards and of their links.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use photoncard_driver::choice::Choice;
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::emulator::trace::{TraceFormat, TraceSettings};
use photoncard_driver::emulator::{Emulated, EmulatedKind};
use photoncard_driver::link::LineFaults;
use photoncard_driver::render::{CardAddress, CardSet};

use super::choice::choice;
use super::files::file;

#[derive(Args)]
#[command(next_help_heading = "Cards")]
pub(crate) struct CardOptions {
    #[arg(
        long = "card",
        value_name = "CARD",
        help = format!("Where to render: {}; may be repeated [default: a chip a core]", CardAddress::forms())
    )]
    cards: Vec<CardAddress>,
    #[command(flatten)]
    pub(super) chip: ChipOption,
    /// Share of the tiles, above 0 and at most 1, that two cards render and that are compared bit for bit
    ///
    /// Of three cards the outvoted one is given up, and others render its tiles.
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true, hide_short_help = true)]
    verify: Option<f64>,
    /// Inject faults into the links to the cards, to test their repair: rates per byte as
    /// flips=1e-5,drops=1e-6,repeats=1e-6,delays=1e-4,seed=1
    #[arg(long, value_name = "FAULTS", hide_short_help = true)]
    pub(super) faults: Option<LineFaults>,
    /// Model the memory of emulated chips, and report its reads in the statistics
    #[arg(long, hide_short_help = true)]
    counters: bool,
    /// Caches of the modelled memory, SIZE/LINE/WAYS each: photon=...,scene=...[,index=hash] or unified=...
    /// [default: the sizes of the first card's kind, such as photon=128K/128/4,scene=75K/128/4]
    #[arg(long, value_name = "CACHES", hide_short_help = true)]
    cache: Option<CacheSettings>,
    /// Write every read of an emulated chip for a simulator of caches or of DRAM, compressed by gzip; a frame
    /// has billions: use --crop
    #[arg(long, value_name = "OUT.gz", value_parser = file(), hide_short_help = true)]
    pub(crate) trace: Option<PathBuf>,
    /// Reads and format of the trace
    #[arg(
        long,
        default_value = TraceFormat::default().name(),
        value_parser = choice::<TraceFormat>(),
        requires = "trace",
        hide_short_help = true
    )]
    trace_format: TraceFormat,
    /// Follow each read of a trace for Dinero by its structure, its stage and its number of bytes, which
    /// Dinero ignores
    #[arg(long, requires = "trace", hide_short_help = true)]
    trace_labels: bool,
}

impl CardOptions {
    /// Returns the cards that these options state, or one emulated reference chip.
    pub(super) fn settings(&self) -> CardSet {
        let emulated = || vec![CardAddress::emulated(EmulatedKind::Reference)];
        let addresses = if self.cards.is_empty() { emulated() } else { self.cards.clone() };
        let cards = CardSet {
            addresses: addresses.into_iter().map(|card| card.of_kind(|kind| self.chip.or(kind))).collect(),
            faults: self.faults,
            verify: self.verify,
            caches: self.cache,
            trace: self.trace.clone().map(|path| TraceSettings {
                path,
                format: self.trace_format,
                has_labels: self.trace_labels,
            }),
        };
        let own = self.counters.then(|| cards.own_caches());
        CardSet { caches: cards.caches.or(own), ..cards }
    }
}

#[derive(Args)]
pub(crate) struct ChipOption {
    /// Emulate chips with the capacities in a JSON file, whatever kind --card names
    #[arg(long, value_name = "CHIP.json", value_parser = kind_of_file(), help_heading = "Cards", hide_short_help = true)]
    chip: Option<EmulatedKind>,
}

impl ChipOption {
    /// Kind of chip in the file of `--chip`, or `kind` without such a file.
    pub(crate) fn or(&self, kind: EmulatedKind) -> EmulatedKind {
        self.chip.unwrap_or(kind)
    }

    /// Returns whether `--chip` is stated.
    pub(crate) fn is_stated(&self) -> bool {
        self.chip.is_some()
    }
}

/// Parser of the path of a JSON file, which reads the kind of chip in it.
fn kind_of_file() -> impl TypedValueParser<Value = EmulatedKind> {
    PathBufValueParser::new().try_map(|path| Emulated::read(&path).map(EmulatedKind::File))
}
