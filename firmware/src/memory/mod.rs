//! Card memory, as the chip sees it: lines, by number.
//!
//! What stands between a chip and its DRAM is a [`MemoryPort`] over a [`MemoryPort`]: [`LineCaches`] hold lines,
//! [`Counted`] counts them. The plain [`Dram`] costs nothing: borrowed slices, no copy, no count.

mod counted;
mod dram;
mod line_cache;
mod traffic;

use core::ops::Range;

pub use counted::Counted;
pub use dram::{Dram, Lines};
pub use line_cache::{CacheEntry, CacheShape, LineCache, LineCaches, SetIndex, ShapeError};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, FaultCode};
pub use traffic::{Reads, STAGES, Stage, Traffic};

/// Where a chip reads lines. A cache or a counter is a `MemoryPort` over a `MemoryPort`.
pub trait MemoryPort {
    /// Reads a line of a structure, of which the bytes in `used` are asked for.
    ///
    /// # Errors
    /// [`FaultCode::LineRange`] outside the memory.
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault>;

    /// A line that may be read soon, where the processor reads the memory itself: for it to be brought near. This is no
    /// read, and where reads are counted or cached there is none.
    #[inline(always)]
    fn near(&self, _: LineAddress) -> Option<&Line> {
        None
    }

    /// Tells what the reads to come are for.
    #[inline(always)]
    fn enter(&mut self, _: Stage) {}

    /// Tells that the lines just read filled one line of a cache above.
    #[inline(always)]
    fn missed(&mut self, _: Structure) {}

    /// Tells that a tile begins: its reads depend on no tile before it.
    #[inline(always)]
    fn begin_tile(&mut self) {}
}

/// Memory that a card image is loaded into.
pub trait CardMemory: MemoryPort {
    /// Lines there are.
    fn lines(&self) -> u32;

    /// `count` lines from `first` on, past all caches and counts; `None` if they are not all there.
    fn stored(&self, first: LineAddress, count: u32) -> Option<&[Line]>;

    /// Writes lines from `first` on; `None`, and nothing is written, if they are not all there.
    fn write(&mut self, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()>;
}

/// Copies lines into those of a memory, of which there are as many.
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
