//! Emulated cards: the firmware runs on threads of this process, one chip and one loopback link per thread.

mod capacities;
pub mod contents;
pub mod direct;
mod dram;
mod emulated;
mod measured;
pub mod memory_model;
mod polled;
pub mod reuse;
mod tile_lines;
pub mod trace;
mod traced;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use photoncard_firmware::card::Card;
use photoncard_firmware::kind::{
    self, ChipKind as _, Large, Micro, Nano, Reference, TechniqueMemory, cache_bytes, tag_bytes,
};
use photoncard_firmware::memory::{CacheEntry, CardMemory};
use photoncard_firmware::serve::serve;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::Budget;
use photoncard_shared::frame::MAX_FRAME;
use photoncard_shared::link::Port;
use photoncard_shared::transport::WINDOW;

pub use self::capacities::{Capacities, ChipError, MIN_DRAM_BYTES, SramParts};
use self::dram::EmulatedDram;
pub(crate) use self::dram::SharedImage;
pub use self::emulated::{Emulated, EmulatedChip};
pub use self::measured::Measured;
use self::memory_model::{CacheSettings, CacheSpec, CachesByWork, MeasuredMemory, MemoryTraffic};
pub use self::polled::PolledCard;
pub(crate) use self::tile_lines::TileLines;
use self::tile_lines::TileMeter;
use self::trace::TraceFile;
use self::traced::Traced;
use photoncard_cards::link::{LoopbackPort, loopback};
use photoncard_picture::choice::Choice;

/// Kind of the chip on an emulated card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmulatedKind {
    /// Chip with the budget [`REFERENCE`](photoncard_firmware::kind::REFERENCE).
    Reference,
    /// Chip with the budget [`LARGE`](photoncard_firmware::kind::LARGE).
    Large,
    /// Chip with the budget [`MICRO`](photoncard_firmware::kind::MICRO).
    Micro,
    /// Chip with the budget [`NANO`](photoncard_firmware::kind::NANO).
    Nano,
    /// Chip with the capacities in a file.
    File(Emulated),
}

impl Choice for EmulatedKind {
    const ALL: &'static [Self] = &[Self::Reference, Self::Large, Self::Micro, Self::Nano];

    fn name(self) -> &'static str {
        match self {
            Self::Reference => "emulated",
            Self::Large => "emulated-large",
            Self::Micro => "emulated-micro",
            Self::Nano => "emulated-nano",
            Self::File(_) => "chip",
        }
    }

    fn about(self) -> &'static str {
        match self {
            Self::Reference => "The reference chip",
            Self::Large => "The large chip",
            Self::Micro => "The micro chip",
            Self::Nano => "The nano chip",
            Self::File(_) => "The chip of a file",
        }
    }
}

impl EmulatedKind {
    /// On-chip memory of the firmware, including caches and stack, bytes.
    pub fn sram_bytes(self) -> usize {
        self.emulated().sram_bytes()
    }

    /// On-chip memory, bytes, that reordering, irradiance cache and importance sampling each add.
    pub fn techniques(self) -> TechniqueMemory {
        self.emulated().techniques()
    }

    /// On-chip memory of the caches' tags, bytes.
    pub fn tag_bytes(self) -> usize {
        tag_bytes(&self.budget())
    }

    /// Name of the kind of chip, emulated or on a board, with this budget: `reference`, `large`, `micro`,
    /// `nano` or `other`. The size of card memory does not matter.
    pub fn name_of(budget: &Budget) -> &'static str {
        let is = |kind: &Budget| Budget { dram_bytes: kind.dram_bytes, ..*budget } == *kind;
        let kinds = [
            (&kind::REFERENCE, "reference"),
            (&kind::LARGE, "large"),
            (&kind::MICRO, "micro"),
            (&kind::NANO, "nano"),
        ];
        kinds.into_iter().find(|(kind, _)| is(kind)).map_or("other", |(_, name)| name)
    }

    /// Capacities of this kind, as the run-time values of an emulated chip.
    pub fn emulated(self) -> Emulated {
        match self {
            Self::Reference => Emulated::like::<Reference>(),
            Self::Large => Emulated::like::<Large>(),
            Self::Micro => Emulated::like::<Micro>(),
            Self::Nano => Emulated::like::<Nano>(),
            Self::File(kind) => kind,
        }
    }

    /// Budget of a chip of the kind.
    pub fn budget(self) -> Budget {
        *self.emulated().budget()
    }

    /// Model of the caches of this kind: the sizes of its budget, with four ways. While gathers wait in card
    /// memory, one cache takes their memory and that which the chip leaves free.
    pub fn caches(self) -> CacheSettings {
        let budget = self.budget();
        let cache = |bytes: u32| CacheSpec { bytes, ..CacheSpec::PHOTON };
        let all = |free: usize| {
            let lines = (cache_bytes(&budget) + free) / (LINE_BYTES + size_of::<CacheEntry>());
            cache((lines * LINE_BYTES) as u32).in_whole_sets()
        };
        let [casting, gathering] = self.emulated().free_bytes().map(all);
        CacheSettings::Split {
            photon: cache(budget.photon_cache_bytes),
            scene: cache(budget.scene_cache_bytes),
            by_work: (budget.waiting_blocks > 0).then_some(CachesByWork { casting, gathering }),
        }
    }

    /// On-chip memory of the buffers for tiles and link, bytes.
    pub fn buffer_bytes(self) -> usize {
        let budget = self.budget();
        self.sram_bytes() - cache_bytes(&budget) - budget.stack_bytes as usize
    }
}

/// Capacity of a loopback link in each direction, bytes.
const LINK_CAPACITY: usize = 64 << 10;
/// Number of unread bytes from a card at which the host is woken: a third of the frames in flight.
const WOKEN_AT: usize = WINDOW * MAX_FRAME / 3;

/// Model of an emulated card's memory.
pub(crate) struct MemoryModel {
    /// Caches between chip and DRAM.
    pub(crate) caches: CacheSettings,
    /// File to which the chip's reads are written, if any.
    pub(crate) trace: Option<TraceFile>,
}

/// Traffic and trace of a modelled memory, returned when its card ends.
pub(crate) struct MemoryRecord {
    /// Traffic from the start of the card to its end.
    pub(crate) traffic: MemoryTraffic,
    /// Unfinished trace of the reads.
    pub(crate) trace: Option<TraceFile>,
}

/// A running emulated card. Its thread ends when the port is dropped.
pub(crate) struct EmulatedCard {
    thread: Option<JoinHandle<Option<MemoryRecord>>>,
    port: Option<LoopbackPort>,
    trace_has_failed: Option<Arc<AtomicBool>>,
    tile_lines: TileLines,
    /// Handle by which the empty memory can get a card image by reference. `None` after it was taken, and for
    /// a modelled memory.
    held: Option<SharedImage>,
}

impl EmulatedCard {
    /// Starts a card. Without a model, its memory has neither caches nor counters. If the card is loaded with
    /// the image in `shared`, it stores no copy.
    ///
    /// # Errors
    /// If the card's thread cannot be started.
    pub(crate) fn start(
        chip: Emulated,
        model: Option<MemoryModel>,
        shared: SharedImage,
    ) -> std::io::Result<Self> {
        // A browser has no threads, and its module is small without the code of this one.
        if cfg!(target_family = "wasm") {
            return Err(std::io::ErrorKind::Unsupported.into());
        }
        let (host, card) = loopback(LINK_CAPACITY);
        let mut card = card.patient(WOKEN_AT);
        let trace = model.as_ref().and_then(|model| model.trace.as_ref());
        let trace_has_failed = trace.map(TraceFile::has_failed);
        let tile_lines = TileLines::default();
        let noted = tile_lines.clone();
        let held = SharedImage::default();
        let dram = EmulatedDram::new(chip.budget().dram_bytes, shared, held.clone());
        let held = model.is_none().then_some(held);
        let thread = std::thread::Builder::new()
            .name("chip".into())
            .spawn(move || run(chip, model.map(|model| (model, noted)), dram, &mut card))?;
        Ok(Self { thread: Some(thread), port: Some(host), trace_has_failed, tile_lines, held })
    }

    /// Takes the handle by which a memory into which nothing was loaded can get a card image by reference.
    /// Returns `None` from the second call on, and for a modelled memory.
    pub(crate) fn take_empty_memory(&mut self) -> Option<SharedImage> {
        self.held.take()
    }

    /// Host's end of the link.
    ///
    /// # Panics
    /// Never: the port exists until the card is dropped.
    pub(crate) fn port(&mut self) -> &mut LoopbackPort {
        self.port.as_mut().expect("the port lives as long as the card")
    }

    /// Returns whether writing the trace failed.
    pub(crate) fn trace_has_failed(&self) -> bool {
        self.trace_has_failed.as_ref().is_some_and(|failed| failed.load(Ordering::Relaxed))
    }

    /// Number of DRAM lines read for each tile that the card has rendered, if its memory is modelled.
    pub(crate) fn tile_lines(&self) -> &TileLines {
        &self.tile_lines
    }

    /// Ends the card. Returns the traffic and the trace of its memory if the memory is modelled.
    ///
    /// # Panics
    /// If the chip panicked.
    pub(crate) fn finish(mut self) -> Option<MemoryRecord> {
        drop(self.port.take());
        let record = self.thread.take()?.join();
        record.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

impl Drop for EmulatedCard {
    fn drop(&mut self) {
        drop(self.port.take());
        if let Some(thread) = self.thread.take() {
            // A chip that panicked has closed its link already, and the session has reported that.
            let _ = thread.join();
        }
    }
}

/// Serves an emulated card to a host in another process, until the port fails.
///
/// # Errors
/// If the card's thread cannot be started.
///
/// # Panics
/// If the chip panicked.
pub fn serve_card(chip: Emulated, port: &mut (dyn Port + Send)) -> std::io::Result<()> {
    let dram = EmulatedDram::new(chip.budget().dram_bytes, SharedImage::default(), SharedImage::default());
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new()
            .name("chip".into())
            .spawn_scoped(scope, || run(chip, None, dram, port))?;
        thread.join().map(drop).or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn run(
    chip: Emulated,
    model: Option<(MemoryModel, TileLines)>,
    dram: EmulatedDram<'static>,
    port: &mut dyn Port,
) -> Option<MemoryRecord> {
    match model {
        None => serve_on(chip, dram, port, |_| None),
        Some((MemoryModel { caches, trace }, tile_lines)) => {
            let (below, above) = match trace {
                Some(trace) if trace.is_below_caches() => (Some(trace), None),
                trace => (None, trace),
            };
            let memory = Traced::new(caches.over(Traced::new(dram, below)), above);
            serve_on(chip, Measured::new(TileMeter::new(memory, tile_lines)), port, |memory| {
                Some(MemoryRecord { traffic: memory.traffic(), trace: memory.take_trace() })
            })
        }
    }
}

/// Serves a card with a given memory until the host drops its end of the link. Returns the result of `end` on
/// the memory.
fn serve_on<M: CardMemory, R>(
    chip: Emulated,
    memory: M,
    port: &mut dyn Port,
    end: impl FnOnce(&mut M) -> R,
) -> R {
    let mut card = Card::with_chip(chip.chip(), memory);
    // The end of the link is no error: a host ends a card by closing the link.
    let _ = serve(&mut card, port);
    end(card.memory())
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::gather::REQUEST_BYTES;

    use super::*;

    /// Memory of a cache with its tags, bytes.
    fn taken(cache: CacheSpec) -> usize {
        cache.bytes as usize / LINE_BYTES * (LINE_BYTES + size_of::<CacheEntry>())
    }

    /// The figures of `docs/memory.md`.
    #[test]
    fn the_reference_and_the_large_chip_have_large_caches_by_work() {
        for (kind, caches) in [
            (
                EmulatedKind::Reference,
                "photon=128K/128/4,scene=75K/128/4,casting=504K/128/4,gathering=835072/128/4",
            ),
            (
                EmulatedKind::Large,
                "photon=128K/128/4,scene=128K/128/4,casting=879K/128/4,gathering=1734144/128/4",
            ),
        ] {
            assert_eq!(kind.caches().to_string(), caches);
        }
    }

    #[test]
    fn caches_by_work_take_the_memory_that_the_work_leaves_free() {
        for kind in EmulatedKind::ALL {
            let CacheSettings::Split { photon, scene, by_work } = kind.caches() else { panic!("{kind:?}") };
            assert_eq!(by_work.is_some(), kind.budget().waiting_blocks > 0, "{kind:?}");
            let Some(by_work) = by_work else { continue };
            let [casting, gathering] = [by_work.casting, by_work.gathering].map(taken);
            let free = kind.emulated().free_bytes();
            let set = taken(CacheSpec { bytes: photon.line_bytes * photon.ways, ..photon });
            for (cache, free) in [casting, gathering].into_iter().zip(free) {
                let room = taken(photon) + taken(scene) + free;
                assert!((room - set..=room).contains(&cache), "{kind:?}: {cache} of {room}");
            }
            // The queue, and what waits or is in use while gathers are done, are beside the cache.
            let queue = kind.budget().gather_queue as usize * REQUEST_BYTES;
            assert!(gathering + queue / 4 < kind.sram_bytes() && casting < kind.sram_bytes());
        }
    }
}
