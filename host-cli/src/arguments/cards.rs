//! Options of cards and of their links.

use std::path::PathBuf;

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::emulator::trace::{TraceFormat, TraceSettings};
use photoncard_driver::emulator::{EmulatedKind, MIN_DRAM_BYTES};
use photoncard_driver::link::LineFaults;
use photoncard_driver::render::{CardAddress, CardSet, ChipModel, MAX_DRAM_BYTES};
use photoncard_shared::address::LINE_BYTES;

use super::choice::choice;
use super::files::file;
use crate::memory::free_memory;

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
    pub(super) memory: MemoryOption,
    /// Share of the tiles, above 0 and at most 1, that are rendered by two cards each and compared bit for
    /// bit
    ///
    /// If the two differ, a third card decides: the outvoted card is given up, and other cards render its
    /// unconfirmed tiles again.
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true, hide_short_help = true)]
    verify: Option<f64>,
    /// Inject faults into the links to the cards, to test that the links repair them: rates per byte and a
    /// seed, such as flips=1e-5,drops=1e-6,repeats=1e-6,delays=1e-4,seed=1
    #[arg(long, value_name = "FAULTS", hide_short_help = true)]
    pub(super) faults: Option<LineFaults>,
    /// Model the caches and the DRAM of emulated chips, and report their reads in the statistics
    #[arg(long, hide_short_help = true)]
    counters: bool,
    /// Caches of the memory model, SIZE/LINE/WAYS each: photon=...,scene=...[,index=hash] or unified=...;
    /// implies --counters [default: the caches of the first card's chip, such as
    /// photon=128K/128/4,scene=75K/128/4]
    #[arg(long, value_name = "CACHES", hide_short_help = true)]
    cache: Option<CacheSettings>,
    /// Write every access to memory of an emulated chip to a file for a simulator of caches or of DRAM,
    /// compressed by gzip; a large picture has billions of accesses: use --crop
    #[arg(long, value_name = "OUT.gz", value_parser = file(), hide_short_help = true)]
    pub(crate) trace: Option<PathBuf>,
    /// Accesses that the trace contains, and the trace's format
    #[arg(
        long,
        default_value = TraceFormat::default().name(),
        value_parser = choice::<TraceFormat>(),
        requires = "trace",
        hide_short_help = true
    )]
    trace_format: TraceFormat,
    /// Add the structure, the stage and the number of bytes to each access in a trace for Dinero, which
    /// ignores them
    #[arg(long, requires = "trace", hide_short_help = true)]
    trace_labels: bool,
}

impl CardOptions {
    /// Returns the cards of `--card` with the settings of these options. The default is one emulated
    /// reference chip per core.
    pub(super) fn settings(&self) -> CardSet {
        let emulated = || vec![CardAddress::emulated(EmulatedKind::Reference)];
        let addresses = if self.cards.is_empty() { emulated() } else { self.cards.clone() };
        let cards = CardSet {
            addresses: addresses.into_iter().map(|card| self.memory.of(card)).collect(),
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

/// Model of emulated chips that a command takes without their number.
#[derive(Args)]
pub(crate) struct ChipOption {
    #[arg(
        long = "card",
        value_name = "CHIP",
        default_value_t = ChipModel::from(EmulatedKind::Reference),
        help_heading = "Cards",
        help = format!("The chips: {}", ChipModel::forms())
    )]
    pub(crate) model: ChipModel,
}

#[derive(Args)]
pub(crate) struct MemoryOption {
    /// Memory of each emulated card, in bytes or with the suffix K, M or G [default: a quarter of the
    /// machine's free memory, at least 512M; emulated-micro, emulated-nano and chips of a file have their
    /// own memory]
    #[arg(long, value_name = "SIZE", value_parser = memory_size, help_heading = "Cards", hide_short_help = true)]
    card_memory: Option<u64>,
}

impl MemoryOption {
    /// Returns `address` with its card memory set to `--card-memory` if the card is emulated. Without this
    /// option, a reference or large chip has a quarter of the machine's free memory (the host itself takes up
    /// to four times a card's memory), but at least the memory of its kind. Other cards keep the memory of
    /// their kind.
    pub(super) fn of(&self, address: CardAddress) -> CardAddress {
        self.with_free(free_memory(), address)
    }

    fn with_free(&self, free: Option<u64>, address: CardAddress) -> CardAddress {
        let memory = self.card_memory.or_else(|| match &address {
            CardAddress::Emulated { model, memory, .. }
                if matches!(model.kind(), EmulatedKind::Reference | EmulatedKind::Large) =>
            {
                let quarter = (free? / 4).min(MAX_DRAM_BYTES);
                Some((*memory).max(quarter - quarter % LINE_BYTES as u64))
            }
            _ => None,
        });
        match memory {
            Some(bytes) => address.with_memory(bytes),
            None => address,
        }
    }

    pub(super) fn is_stated(&self) -> bool {
        self.card_memory.is_some()
    }
}

/// Parses a number of bytes, with an optional suffix K, M or G for powers of 1024. The number is rounded down
/// to whole lines of 128 bytes.
pub(super) fn memory_size(text: &str) -> Result<u64, String> {
    let suffixes = [("K", 10), ("M", 20), ("G", 30)];
    let suffix = suffixes.into_iter().find_map(|(suffix, shift)| Some((text.strip_suffix(suffix)?, shift)));
    let (digits, shift) = suffix.unwrap_or((text, 0));
    let bytes = digits.parse().ok().and_then(|number: u64| number.checked_mul(1 << shift));
    bytes
        .filter(|bytes| (MIN_DRAM_BYTES..=MAX_DRAM_BYTES).contains(bytes))
        .map(|bytes| bytes - bytes % LINE_BYTES as u64)
        .ok_or_else(|| {
            format!("use bytes, with K, M or G for powers of 1024, from 1M to {}G", MAX_DRAM_BYTES >> 30)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_memory_are_bytes_or_have_a_suffix() {
        for (text, bytes) in [
            ("1048576", 1 << 20),
            ("1024K", 1 << 20),
            ("1048577", 1 << 20),
            ("512M", 512 << 20),
            ("8G", 8 << 30),
        ] {
            assert_eq!(memory_size(text), Ok(bytes));
        }
        for wrong in ["", "G", "1K", "-1G", "1.5G", "1g", "512", "1T", "600G", "99999999999999G"] {
            assert!(memory_size(wrong).unwrap_err().contains("from 1M to 511G"), "{wrong}");
        }
    }

    #[test]
    fn cards_have_the_stated_memory_or_a_quarter_of_what_is_free() {
        let of = |stated, free, kind| {
            let address = CardAddress::emulated(kind);
            MemoryOption { card_memory: stated }.with_free(free, address).dram_bytes()
        };
        for kind in [EmulatedKind::Reference, EmulatedKind::Large] {
            let own = kind.budget().dram_bytes;
            assert_eq!(of(None, Some(16 << 30), kind), 4 << 30);
            assert_eq!(of(None, Some(1 << 30), kind), own);
            assert_eq!(of(None, None, kind), own);
            assert_eq!(of(None, Some(u64::MAX), kind), MAX_DRAM_BYTES);
            assert_eq!(of(Some(3 << 30), Some(16 << 30), kind), 3 << 30);
        }
        let micro = EmulatedKind::Micro;
        assert_eq!(of(None, Some(16 << 30), micro), micro.budget().dram_bytes);
        assert_eq!(of(Some(1 << 30), None, micro), 1 << 30);
        let remote = CardAddress::serial("/dev/ttyUSB0");
        assert_eq!(MemoryOption { card_memory: Some(1 << 30) }.of(remote.clone()), remote);
    }
}
