//! Number of lines that a chip reads from its DRAM for each tile. The host gets it directly and not over the
//! link, because card and host are in one process.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use photoncard_firmware::memory::{CardMemory, MemoryPort, Stage, Work};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

use super::memory_model::{MeasuredMemory, MemoryTraffic};
use super::trace::TraceFile;

/// Number of DRAM lines read for each tile that a card has rendered, by tile number.
#[derive(Clone, Debug, Default)]
pub(crate) struct TileLines(Arc<Mutex<HashMap<u32, u64>>>);

impl TileLines {
    fn note(&self, tile: u32, lines: u64) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(tile, lines);
    }

    /// Removes and returns the number of lines of a tile that the card has rendered; `None` if its memory is
    /// not modelled. If several tiles are in flight, a tile counts all lines since the previous one ended.
    pub(crate) fn take(&self, tile: u32) -> Option<u64> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(&tile)
    }
}

/// Memory that records the number of DRAM lines read for each tile when the tile ends.
pub(super) struct TileMeter<M> {
    memory: M,
    notes: TileLines,
    /// Number of DRAM lines read for all tiles so far.
    counted: u64,
}

impl<M> TileMeter<M> {
    pub(super) fn new(memory: M, notes: TileLines) -> Self {
        Self { memory, notes, counted: 0 }
    }
}

impl<M: MeasuredMemory> MemoryPort for TileMeter<M> {
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        self.memory.read(structure, address, used)
    }

    fn write(&mut self, structure: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.memory.write(structure, first, lines)
    }

    #[inline(always)]
    fn enter(&mut self, stage: Stage) {
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.memory.begin_tile();
    }

    fn begin_work(&mut self, work: Work) {
        self.memory.begin_work(work);
    }

    fn end_tile(&mut self, tile: u32) {
        let counted = self.memory.traffic().fetched.of_tiles(|_| true).bytes / LINE_BYTES as u64;
        self.notes.note(tile, counted - self.counted);
        self.counted = counted;
    }
}

impl<M: CardMemory + MeasuredMemory> CardMemory for TileMeter<M> {
    fn lines(&self) -> u32 {
        self.memory.lines()
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.memory.stored(first, count)
    }

    fn known_checksum(&self, lines: u32) -> Option<u64> {
        self.memory.known_checksum(lines)
    }
}

impl<M: MeasuredMemory> MeasuredMemory for TileMeter<M> {
    fn traffic(&self) -> MemoryTraffic {
        self.memory.traffic()
    }

    fn take_trace(&mut self) -> Option<TraceFile> {
        self.memory.take_trace()
    }
}
