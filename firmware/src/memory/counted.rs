//! Memory whose reads are counted.

use core::ops::Range;

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

use super::{CardMemory, MemoryPort, Stage, Traffic};

/// A memory, and what was read of it. Above a cache it counts what the chip asks for, below it what the cache misses.
pub struct Counted<M> {
    memory: M,
    stage: Stage,
    traffic: Traffic,
}

impl<M> Counted<M> {
    /// Counts the reads of `memory`.
    pub const fn new(memory: M) -> Self {
        Self { memory, stage: Stage::Begin, traffic: Traffic::ZERO }
    }

    /// What was counted.
    pub fn traffic(&self) -> &Traffic {
        &self.traffic
    }

    /// The memory below.
    pub fn below(&self) -> &M {
        &self.memory
    }

    /// The memory below, to be changed.
    pub fn below_mut(&mut self) -> &mut M {
        &mut self.memory
    }
}

impl<M: MemoryPort> MemoryPort for Counted<M> {
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        let bytes = used.end.saturating_sub(used.start);
        // Where there is no memory nothing is read: of a cache's line that goes past the end it counts the lines before it.
        let line = self.memory.read(structure, address, used)?;
        self.traffic.count(self.stage, structure, bytes);
        Ok(line)
    }

    #[inline(always)]
    fn missed(&mut self, structure: Structure) {
        self.traffic.count_miss(self.stage, structure);
        self.memory.missed(structure);
    }

    #[inline(always)]
    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.memory.begin_tile();
    }
}

impl<M: CardMemory> CardMemory for Counted<M> {
    fn lines(&self) -> u32 {
        self.memory.lines()
    }

    fn stored(&self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.memory.stored(first, count)
    }

    fn write(&mut self, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.memory.write(first, lines)?;
        self.traffic.written_bytes += lines.len() as u64 * LINE_BYTES as u64;
        Some(())
    }
}
