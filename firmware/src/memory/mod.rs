//! Card memory as the chip reads it: lines, by index.
//!
//! Each layer between a chip and its DRAM is a [`MemoryPort`] that wraps another: [`LineCaches`] caches
//! lines, [`Counted`] counts reads. The plain [`Dram`] has no overhead: it borrows slices, and neither copies
//! nor counts. A board whose processor does not address its memory reads lines into a buffer ([`Unmapped`]),
//! and a board with a scene in flash reads it in place ([`Resident`]).

mod counted;
mod dram;
mod line_cache;
mod resident;
mod traffic;
mod unmapped;
mod words;

use core::ops::Range;

pub use counted::Counted;
pub use dram::{Dram, Lines};
pub use line_cache::{CacheEntry, CacheShape, LineCache, LineCaches, SetIndex, ShapeError};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
pub use photoncard_shared::address::{STAGES, Stage};
use photoncard_shared::message::{Fault, FaultCode};
pub use resident::Resident;
pub use traffic::{Reads, Traffic};
pub use unmapped::{LineDevice, Unmapped};
pub use words::{Room, WORDS, WordReader, WordWriter, line_of, words_of};

/// Kinds of work of a chip whose gathers wait in card memory
/// ([`Drain::Buckets`](photoncard_shared::message::Drain::Buckets)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Rays are cast, and pixels completed. Of the gather queue, only the lines of the buckets are in use.
    Casting,
    /// Gathers are done. Buffers of gather points, pixels and irradiance records are empty, and no ray reads
    /// the scene.
    Gathering,
}

impl Work {
    /// Name in traces and in the text of caches.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Casting => "casting",
            Self::Gathering => "gathering",
        }
    }
}

/// Access of a chip to card memory. Caches and counters are `MemoryPort`s that wrap another `MemoryPort`.
pub trait MemoryPort {
    /// Reads a line that belongs to `structure`. The chip uses the bytes in `used`.
    ///
    /// # Errors
    /// [`FaultCode::LineRange`] if the line is outside the memory.
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault>;

    /// Returns a line to be prefetched, if the processor addresses the memory directly; `None` if reads are
    /// cached or counted. The call is not counted as a read.
    #[inline(always)]
    fn near(&self, _: LineAddress) -> Option<&Line> {
        None
    }

    /// Writes lines that belong to `structure`, from line `first` on. Lines of a card image are counted for
    /// [`Structure::Header`], whatever they hold. Returns `None`, and writes nothing, if some lines are
    /// outside the memory or the memory is read-only.
    fn write(
        &mut self,
        _structure: Structure,
        _first: LineAddress,
        _lines: &[[u8; LINE_BYTES]],
    ) -> Option<()> {
        None
    }

    /// Sets the stage under which the following reads are counted.
    #[inline(always)]
    fn enter(&mut self, _: Stage) {}

    /// Begins another kind of work of a frame whose gathers wait in card memory, until [`Self::begin_tile`].
    /// The memory of buffers that it leaves empty is free for caches, which are cleared.
    fn begin_work(&mut self, _: Work) {}

    /// Notifies the port that its last reads filled one line of the cache that wraps it.
    #[inline(always)]
    fn missed(&mut self, _: Structure) {}

    /// Begins a tile while no other is in flight. Caches are cleared, so that the tile's misses do not depend
    /// on earlier tiles.
    #[inline(always)]
    fn begin_tile(&mut self) {}

    /// Notifies the port that the tile with this number has ended, before the card reports this to its host.
    #[inline(always)]
    fn end_tile(&mut self, _: u32) {}
}

/// Memory that a card image is loaded into.
pub trait CardMemory: MemoryPort {
    /// Number of lines.
    fn lines(&self) -> u32;

    /// Reads lines from line `first` on, bypassing caches and counters: `count` of them if the processor
    /// addresses the memory directly, else as many of them as a buffer holds, at least one. `None` if some of
    /// the `count` lines are outside the memory, or its device fails.
    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]>;

    /// [`image_checksum`](photoncard_shared::checksum::image_checksum) of the first `lines` lines, if it is
    /// known without reading them. An emulated card knows it: its memory is a card image whose checksum the
    /// host computed.
    fn known_checksum(&self, _lines: u32) -> Option<u64> {
        None
    }

    /// Number of leading lines that hold a card image when the card is switched on, as lines in flash do.
    fn resident_lines(&self) -> u32 {
        0
    }

    /// Cause of a write, or of [`Self::stored`], that just gave `None`: the failure of the memory's device,
    /// or read-only lines. `None` if lines are outside the memory.
    fn failure(&self) -> Option<Fault> {
        None
    }

    /// Writes one byte of a line that was written before. Returns `None`, and writes nothing, if the byte is
    /// outside the memory. A memory that the processor addresses directly stores only that byte.
    fn write_byte(&mut self, address: LineAddress, place: usize, byte: u8) -> Option<()> {
        let mut line = *self.stored(address, 1)?.first()?;
        *line.0.get_mut(place)? = byte;
        self.write(Structure::Header, address, &[line.0])
    }
}

/// Copies lines into memory, as many as the shorter slice has.
pub fn copy_lines(from: &[[u8; LINE_BYTES]], to: &mut [Line]) {
    for (line, bytes) in to.iter_mut().zip(from) {
        line.0 = *bytes;
    }
}

/// Fault of an access to a line outside the memory.
#[cold]
pub(crate) fn outside(address: LineAddress) -> Fault {
    Fault { code: FaultCode::LineRange, detail: address.0 }
}
