//! Card memory as the chip reads it: lines, by index.
//!
//! Layers between a chip and its DRAM are [`MemoryPort`]s over a [`MemoryPort`]: [`LineCaches`] caches lines,
//! [`Counted`] counts reads. The plain [`Dram`] costs nothing: borrowed slices, no copy, no count.

mod counted;
mod dram;
mod line_cache;
mod traffic;

use core::ops::Range;

pub use counted::Counted;
pub use dram::{Dram, Lines};
pub use line_cache::{CacheEntry, CacheShape, LineCache, LineCaches, SetIndex, ShapeError};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
pub use photoncard_shared::address::{STAGES, Stage};
use photoncard_shared::message::{Fault, FaultCode};
pub use traffic::{Reads, Traffic};

/// Access of a chip to card memory. A cache or a counter is a `MemoryPort` over a `MemoryPort`.
pub trait MemoryPort {
    /// Reads a line of a structure; the chip uses the bytes in `used`.
    ///
    /// # Errors
    /// [`FaultCode::LineRange`] outside the memory.
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault>;

    /// A line to be prefetched, if the processor addresses the memory directly. Not a read: `None` where
    /// reads are cached or counted.
    #[inline(always)]
    fn near(&self, _: LineAddress) -> Option<&Line> {
        None
    }

    /// Writes lines from line `first`; `None`, and nothing is written, if they are not all in the memory, or
    /// it can be read alone.
    fn write(&mut self, _first: LineAddress, _lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        None
    }

    /// Sets the stage of the following reads.
    #[inline(always)]
    fn enter(&mut self, _: Stage) {}

    /// Notifies that the last reads filled one line of a cache above.
    #[inline(always)]
    fn missed(&mut self, _: Structure) {}

    /// Begins a tile: caches are cleared, so that its misses do not depend on the tiles before it.
    #[inline(always)]
    fn begin_tile(&mut self) {}

    /// Ends a tile, before its end is sent.
    #[inline(always)]
    fn end_tile(&mut self, _: u32) {}
}

/// Memory that a card image is loaded into.
pub trait CardMemory: MemoryPort {
    /// Number of lines.
    fn lines(&self) -> u32;

    /// `count` lines from line `first`, bypassing caches and counters; `None` if they are not all in the
    /// memory.
    fn stored(&self, first: LineAddress, count: u32) -> Option<&[Line]>;

    /// [`image_checksum`](photoncard_shared::checksum::image_checksum) of the first `lines` lines, if it is
    /// known without reading them: the memory of an emulated card is an image whose checksum its host has
    /// computed.
    fn known_checksum(&self, _lines: u32) -> Option<u64> {
        None
    }

    /// Writes one byte of a written line; `None`, and nothing is written, if it is not in the memory. A
    /// memory that the processor addresses directly stores the byte alone.
    fn write_byte(&mut self, address: LineAddress, place: usize, byte: u8) -> Option<()> {
        let mut line = *self.stored(address, 1)?.first()?;
        *line.0.get_mut(place)? = byte;
        self.write(address, &[line.0])
    }
}

/// Copies lines into a memory's, as many as the shorter slice has.
pub fn copy_lines(from: &[[u8; LINE_BYTES]], to: &mut [Line]) {
    for (line, bytes) in to.iter_mut().zip(from) {
        line.0 = *bytes;
    }
}

/// The fault of a line outside the memory.
#[cold]
pub(crate) fn outside(address: LineAddress) -> Fault {
    Fault { code: FaultCode::LineRange, detail: address.0 }
}
