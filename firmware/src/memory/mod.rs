//! Card memory, as the chip sees it: lines, by number.

mod dram;

pub use dram::{Dram, Lines};
use photoncard_shared::address::{Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, FaultCode};

/// Where a chip reads lines. A cache or a counter is a `MemoryPort` over a `MemoryPort`.
pub trait MemoryPort {
    /// Reads a line for `structure`, which will use `bytes` of it.
    ///
    /// # Errors
    /// [`FaultCode::LineRange`] outside the memory.
    fn read(&mut self, structure: Structure, address: LineAddress, bytes: u32) -> Result<&Line, Fault>;
}

/// Memory that a card image is loaded into.
pub trait CardMemory: MemoryPort {
    /// Lines there are.
    fn lines(&self) -> u32;

    /// The bytes of `count` lines from `first` on, to be written; `None` if they are not all there.
    fn write(&mut self, first: LineAddress, count: u32) -> Option<&mut [Line]>;
}

/// The fault of a line outside the memory.
#[cold]
pub(crate) fn outside(address: LineAddress) -> Fault {
    Fault { code: FaultCode::LineRange, detail: address.0 }
}
