//! A measured memory of any kind, as a trait object.

use std::ops::Range;

use photoncard_firmware::memory::{CardMemory, MemoryPort, Stage, Work};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

use super::memory_model::{MeasuredMemory, MemoryTraffic};
use super::trace::TraceFile;

/// Memory that measures its traffic, of any type, behind a trait object.
///
/// The chip's code is compiled anew for each type of memory. With this type, it is compiled only once for all
/// measured memories.
pub struct Measured<'a>(Box<dyn MeasuredCard + Send + 'a>);

trait MeasuredCard: CardMemory + MeasuredMemory {}

impl<M: CardMemory + MeasuredMemory> MeasuredCard for M {}

impl<'a> Measured<'a> {
    /// Wraps a memory.
    pub fn new(memory: impl CardMemory + MeasuredMemory + Send + 'a) -> Self {
        Self(Box::new(memory))
    }
}

impl MemoryPort for Measured<'_> {
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        self.0.read(structure, address, used)
    }

    fn write(&mut self, structure: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.0.write(structure, first, lines)
    }

    #[inline(always)]
    fn enter(&mut self, stage: Stage) {
        self.0.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.0.begin_tile();
    }

    fn begin_work(&mut self, work: Work) {
        self.0.begin_work(work);
    }

    fn end_tile(&mut self, tile: u32) {
        self.0.end_tile(tile);
    }
}

impl CardMemory for Measured<'_> {
    fn lines(&self) -> u32 {
        self.0.lines()
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.0.stored(first, count)
    }

    fn known_checksum(&self, lines: u32) -> Option<u64> {
        self.0.known_checksum(lines)
    }
}

impl MeasuredMemory for Measured<'_> {
    fn traffic(&self) -> MemoryTraffic {
        self.0.traffic()
    }

    fn take_trace(&mut self) -> Option<TraceFile> {
        self.0.take_trace()
    }
}
