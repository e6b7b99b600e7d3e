//! Memory whose reads and writes are recorded in a trace.

use std::ops::Range;

use photoncard_firmware::memory::{CardMemory, MemoryPort, Stage, Work};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

use super::memory_model::{MeasuredMemory, MemoryTraffic};
use super::trace::TraceFile;

/// Memory that records its reads and writes for tiles in a trace, if there is one.
pub(super) struct Traced<M> {
    memory: M,
    trace: Option<TraceFile>,
    stage: Stage,
    /// False before the first tile. Earlier ones are not recorded.
    in_tiles: bool,
}

impl<M> Traced<M> {
    /// Wraps `memory` and records its reads and writes in `trace`.
    pub(super) fn new(memory: M, trace: Option<TraceFile>) -> Self {
        Self { memory, trace, stage: Stage::Begin, in_tiles: false }
    }
}

impl<M: MemoryPort> MemoryPort for Traced<M> {
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        let place = address.0 as u64 * LINE_BYTES as u64 + used.start as u64;
        let bytes = used.len();
        let line = self.memory.read(structure, address, used)?;
        if let Some(trace) = self.trace.as_mut().filter(|_| self.in_tiles && self.stage != Stage::Begin) {
            trace.add_read(place, structure, self.stage, bytes);
        }
        Ok(line)
    }

    fn write(&mut self, structure: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.memory.write(structure, first, lines)?;
        if let Some(trace) = self.trace.as_mut().filter(|_| self.in_tiles && self.stage != Stage::Begin) {
            for (line, _) in (u64::from(first.0)..).zip(lines) {
                trace.add_write(line * LINE_BYTES as u64, structure, self.stage);
            }
        }
        Some(())
    }

    #[inline(always)]
    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.in_tiles = true;
        if let Some(trace) = &mut self.trace {
            trace.begin_tile();
        }
        self.memory.begin_tile();
    }

    fn begin_work(&mut self, work: Work) {
        if let Some(trace) = &mut self.trace {
            trace.begin_work(work);
        }
        self.memory.begin_work(work);
    }
}

impl<M: MeasuredMemory> MeasuredMemory for Traced<M> {
    fn traffic(&self) -> MemoryTraffic {
        self.memory.traffic()
    }

    fn take_trace(&mut self) -> Option<TraceFile> {
        self.trace.take().or_else(|| self.memory.take_trace())
    }
}

impl<M: CardMemory> CardMemory for Traced<M> {
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

#[cfg(test)]
mod tests {
    use std::{fs, io};

    use flate2::read::GzDecoder;
    use photoncard_firmware::memory::Lines;

    use super::*;
    use crate::emulator::dram::EmulatedDram;
    use crate::emulator::trace::{TraceFormat, TraceSettings};

    #[test]
    fn a_trace_has_a_flush_per_tile_and_work_and_the_lines_of_its_reads_and_writes() {
        let folder = tempfile::tempdir().unwrap();
        use TraceFormat::{Dinero, Dramsim3, Ramulator};
        for (format, has_labels, used, expected) in [
            (Dinero, false, 20..40, "4 0\n4 0\n0 114\n4 0\n4 0\n0 94\n1 80\n"),
            (
                Dinero,
                true,
                20..40,
                "4 0\n4 0 casting\n0 114 photons gather 20\n4 0\n4 0 casting\n0 94 photons gather 20\n1 80 waiting gather 128\n",
            ),
            (Ramulator, false, 0..128, "LD 0x100\nLD 0x80\nST 0x80\n"),
            (Dramsim3, false, 0..128, "0x100 READ 0\n0x80 READ 1\n0x80 WRITE 2\n"),
        ] {
            let path = folder.path().join("trace.gz");
            let settings = TraceSettings { path, format, has_labels };
            let lines = [Line::ZERO; 3];
            let dram = EmulatedDram::lent(Lines(&lines), 0);
            let mut memory = Traced::new(dram, Some(TraceFile::create(&settings).unwrap()));
            memory.read(Structure::Header, LineAddress(0), 0..128).unwrap();
            for line in [2, 1] {
                memory.begin_tile();
                memory.begin_work(Work::Casting);
                memory.enter(Stage::Gather);
                memory.read(Structure::Photons, LineAddress(line), used.clone()).unwrap();
                memory.read(Structure::Photons, LineAddress(3), 0..20).unwrap_err();
            }
            memory.write(Structure::Waiting, LineAddress(1), &[[0; LINE_BYTES]]).unwrap();
            let trace = memory.take_trace().unwrap();
            assert!(!settings.path.exists());
            trace.finish().unwrap();
            let file = fs::File::open(&settings.path).unwrap();
            assert_eq!(io::read_to_string(GzDecoder::new(file)).unwrap(), expected);
            fs::remove_file(&settings.path).unwrap();
        }
    }
}
