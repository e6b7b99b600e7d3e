//! A memory port that counts reads and written bytes.

use core::ops::Range;

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

use super::{CardMemory, MemoryPort, Stage, Traffic, Work};

/// Memory port that counts the traffic to the memory it wraps. Between chip and cache it counts the chip's
/// requests. Between cache and DRAM it counts the cache's misses and the reads that fill its lines.
pub struct Counted<M> {
    memory: M,
    stage: Stage,
    traffic: Traffic,
}

impl<M> Counted<M> {
    /// Wraps `memory` and counts its traffic.
    pub const fn new(memory: M) -> Self {
        Self { memory, stage: Stage::Begin, traffic: Traffic::ZERO }
    }

    /// Traffic counted so far.
    pub fn traffic(&self) -> &Traffic {
        &self.traffic
    }

    /// The wrapped memory.
    pub fn below(&self) -> &M {
        &self.memory
    }

    /// The wrapped memory, mutable.
    pub fn below_mut(&mut self) -> &mut M {
        &mut self.memory
    }
}

impl<M: MemoryPort> MemoryPort for Counted<M> {
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        let bytes = used.end.saturating_sub(used.start);
        // Failed reads are not counted: of a cache line that extends past the end of the memory, only the
        // lines inside count.
        let line = self.memory.read(structure, address, used)?;
        self.traffic.count(self.stage, structure, bytes);
        Ok(line)
    }

    fn write(&mut self, structure: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.memory.write(structure, first, lines)?;
        self.traffic.count_written(structure, lines.len() as u64 * LINE_BYTES as u64);
        Some(())
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

    fn begin_work(&mut self, work: Work) {
        self.memory.begin_work(work);
    }
}

impl<M: CardMemory> CardMemory for Counted<M> {
    fn lines(&self) -> u32 {
        self.memory.lines()
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.memory.stored(first, count)
    }

    fn known_checksum(&self, lines: u32) -> Option<u64> {
        self.memory.known_checksum(lines)
    }

    fn resident_lines(&self) -> u32 {
        self.memory.resident_lines()
    }

    fn failure(&self) -> Option<Fault> {
        self.memory.failure()
    }
}
