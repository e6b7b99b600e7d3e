//! Emulated cards: the firmware on threads of this process, one chip a thread, each on a loopback link.

pub mod direct;
mod dram;
pub mod memory_model;
pub mod trace;
pub mod whole_frame;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use photoncard_firmware::card::{MICRO_SRAM_BYTES, MicroCard, REFERENCE_SRAM_BYTES, ReferenceCard};
use photoncard_firmware::chip::{MicroChip, ReferenceChip, sram_bytes, tag_bytes};
use photoncard_firmware::memory::CardMemory;
use photoncard_firmware::serve::serve;
use photoncard_shared::budget::{Budget, MICRO, REFERENCE, TechniqueMemory};
use photoncard_shared::link::Port;

use self::dram::EmulatedDram;
pub use self::dram::SharedImage;
use self::memory_model::{CacheSettings, MeasuredMemory, MemoryTraffic};
use self::trace::{TraceFile, Traced};
use crate::link::{LoopbackPort, loopback};

/// The kind of chip on an emulated card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipKind {
    /// [`REFERENCE`].
    Reference,
    /// [`MICRO`].
    Micro,
}

impl ChipKind {
    /// On-chip memory that the firmware takes with its caches and stack, bytes.
    pub fn sram_bytes(self) -> usize {
        match self {
            Self::Reference => REFERENCE_SRAM_BYTES,
            Self::Micro => MICRO_SRAM_BYTES,
        }
    }

    /// On-chip memory that each technique adds, bytes.
    pub fn techniques(self) -> TechniqueMemory {
        match self {
            Self::Reference => ReferenceChip::TECHNIQUES,
            Self::Micro => MicroChip::TECHNIQUES,
        }
    }

    /// On-chip memory of the tags of its caches, bytes.
    pub fn tag_bytes(self) -> usize {
        tag_bytes(&self.budget())
    }

    pub(crate) fn budget(self) -> Budget {
        match self {
            Self::Reference => REFERENCE,
            Self::Micro => MICRO,
        }
    }

    /// On-chip memory of the tile's and the link's buffers, bytes.
    pub fn buffer_bytes(self) -> usize {
        self.sram_bytes() - sram_bytes(&self.budget(), 0)
    }
}

/// Bytes that wait in each direction of a loopback link.
const LINK_CAPACITY: usize = 64 << 10;
/// Stack of a chip's thread: its buffers are built there before they move to the heap.
pub(crate) const THREAD_STACK: usize = 16 << 20;

/// What is modelled of a card's memory.
pub struct MemoryModel {
    /// Its caches.
    pub caches: CacheSettings,
    /// Where its reads are written to.
    pub trace: Option<TraceFile>,
}

/// What a card whose memory is modelled leaves at its end.
pub struct MemoryRecord {
    /// What was read.
    pub traffic: MemoryTraffic,
    /// The trace, still to be finished.
    pub trace: Option<TraceFile>,
}

/// A running emulated card. Its thread ends when the port is dropped.
pub struct EmulatedCard {
    thread: Option<JoinHandle<Option<MemoryRecord>>>,
    port: Option<LoopbackPort>,
    trace_has_failed: Option<Arc<AtomicBool>>,
}

impl EmulatedCard {
    /// Starts a card; without a model its memory costs nothing and tells nothing. Of an image that is loaded into it the
    /// lines may be those of `shared`.
    ///
    /// # Errors
    /// If the system has no thread for it.
    pub fn start(kind: ChipKind, model: Option<MemoryModel>, shared: SharedImage) -> std::io::Result<Self> {
        let (host, mut card) = loopback(LINK_CAPACITY);
        let trace = model.as_ref().and_then(|model| model.trace.as_ref());
        let trace_has_failed = trace.map(TraceFile::has_failed);
        let thread = std::thread::Builder::new()
            .name("chip".into())
            .stack_size(THREAD_STACK)
            .spawn(move || run(kind, model, shared, &mut card))?;
        Ok(Self { thread: Some(thread), port: Some(host), trace_has_failed })
    }

    /// The host's end of the link.
    ///
    /// # Panics
    /// Never: the port is there until the card is dropped.
    pub fn port(&mut self) -> &mut LoopbackPort {
        self.port.as_mut().expect("the port lives as long as the card")
    }

    /// Whether its trace cannot be written.
    pub fn trace_has_failed(&self) -> bool {
        self.trace_has_failed.as_ref().is_some_and(|failed| failed.load(Ordering::Relaxed))
    }

    /// Ends the card. Returns what its memory leaves, if it is modelled.
    ///
    /// # Panics
    /// If the chip did.
    pub fn finish(mut self) -> Option<MemoryRecord> {
        drop(self.port.take());
        let record = self.thread.take()?.join();
        record.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

impl Drop for EmulatedCard {
    fn drop(&mut self) {
        drop(self.port.take());
        if let Some(thread) = self.thread.take() {
            // A chip that panicked has already closed its link, which the session has told.
            let _ = thread.join();
        }
    }
}

/// Serves a card on a port that others reach, until the port fails.
///
/// # Errors
/// If the system has no thread for it.
///
/// # Panics
/// If the chip did.
pub fn serve_card(kind: ChipKind, mut port: impl Port + Send) -> std::io::Result<()> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new()
            .name("chip".into())
            .stack_size(THREAD_STACK)
            .spawn_scoped(scope, || run(kind, None, SharedImage::default(), &mut port))?;
        thread.join().map(drop).or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn run(
    kind: ChipKind,
    model: Option<MemoryModel>,
    shared: SharedImage,
    port: &mut impl Port,
) -> Option<MemoryRecord> {
    let dram = EmulatedDram::new(kind.budget().dram_bytes, shared);
    match model {
        None => serve_on(kind, dram, port, |_| None),
        Some(MemoryModel { caches, trace }) => {
            let memory = Traced::new(caches.over(dram), trace);
            serve_on(kind, memory, port, |memory| {
                let trace = memory.take_trace();
                Some(MemoryRecord { traffic: MeasuredMemory::traffic(memory.below()), trace })
            })
        }
    }
}

/// Serves a card with some memory until the host drops its end of the link. Returns what `end` makes of the memory then.
fn serve_on<M: CardMemory, R>(
    kind: ChipKind,
    memory: M,
    port: &mut impl Port,
    end: impl FnOnce(&mut M) -> R,
) -> R {
    // The end of the link is no error: it is how the host ends a card.
    match kind {
        ChipKind::Reference => {
            let mut card = Box::new(ReferenceCard::new(REFERENCE, memory));
            let _ = serve(&mut *card, port);
            end(card.memory())
        }
        ChipKind::Micro => {
            let mut card = Box::new(MicroCard::new(MICRO, memory));
            let _ = serve(&mut *card, port);
            end(card.memory())
        }
    }
}
