//! Traces of a chip's memory: every read of its tiles, in the classic input format of the cache simulator Dinero.
//!
//! Each line of text is one access: a label, a blank, a byte address in hexadecimal. Label 0 is a read of data; label 4 is
//! Dinero's escape that flushes its caches, written at the beginning of every tile with address 0. See `docs/memory.md`.

use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use flate2::Compression;
use flate2::write::GzEncoder;
use photoncard_firmware::memory::{CardMemory, MemoryPort, Stage};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

use crate::output::{OutputError, PendingFile};

/// Size of a block of text that is compressed at once, bytes.
const BUFFER: usize = 64 << 10;
/// Maximum length of a line: a label, a blank, 39 bits in hexadecimal, the line feed.
const LONGEST_LINE: usize = 16;

const READ: u8 = 0;
const FLUSH: u8 = 4;

/// Unfinished trace file, compressed by gzip. The file appears under its name only when the trace is finished.
pub struct TraceFile {
    encoder: GzEncoder<PendingFile>,
    buffer: Vec<u8>,
    path: PathBuf,
    /// First failure, after which nothing is written.
    error: Option<io::Error>,
    has_failed: Arc<AtomicBool>,
}

impl TraceFile {
    /// Creates a trace that will be stored as `path`.
    ///
    /// # Errors
    /// As [`crate::output::check_writable`].
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        Ok(Self {
            encoder: GzEncoder::new(PendingFile::create(path)?, Compression::fast()),
            buffer: Vec::with_capacity(BUFFER),
            path: path.to_owned(),
            error: None,
            has_failed: Arc::default(),
        })
    }

    /// Flag that is set once the file cannot be written. The render may end then, as there will be no trace.
    pub fn has_failed(&self) -> Arc<AtomicBool> {
        self.has_failed.clone()
    }

    fn add(&mut self, label: u8, address: u64) {
        if self.buffer.len() > BUFFER - LONGEST_LINE {
            self.compress();
        }
        // Writing to a vector cannot fail.
        let _ = writeln!(self.buffer, "{label} {address:x}");
    }

    fn compress(&mut self) {
        if self.error.is_none()
            && let Err(error) = self.encoder.write_all(&self.buffer)
        {
            self.error = Some(error);
            self.has_failed.store(true, Ordering::Relaxed);
        }
        self.buffer.clear();
    }

    /// Ends the trace and moves the file to its path.
    ///
    /// # Errors
    /// If any part of it could not be written.
    pub fn finish(mut self) -> Result<(), OutputError> {
        self.compress();
        let Self { encoder, path, error, .. } = self;
        let ended = match error {
            None => encoder.finish(),
            Some(error) => Err(error),
        };
        ended.map_err(|source| OutputError::Write { path, source })?.commit()
    }
}

/// Memory that records its reads in a trace, if it has one.
pub struct Traced<M> {
    memory: M,
    trace: Option<TraceFile>,
    /// False before the first tile: earlier reads are not recorded.
    in_tiles: bool,
}

impl<M> Traced<M> {
    /// Memory that records the reads of `memory` in `trace`.
    pub fn new(memory: M, trace: Option<TraceFile>) -> Self {
        Self { memory, trace, in_tiles: false }
    }

    /// The memory below.
    pub fn below(&self) -> &M {
        &self.memory
    }

    /// Takes the trace; later reads are not recorded.
    pub fn take_trace(&mut self) -> Option<TraceFile> {
        self.trace.take()
    }
}

impl<M: MemoryPort> MemoryPort for Traced<M> {
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        let place = address.0 as u64 * LINE_BYTES as u64 + used.start as u64;
        let line = self.memory.read(structure, address, used)?;
        if let Some(trace) = self.trace.as_mut().filter(|_| self.in_tiles) {
            trace.add(READ, place);
        }
        Ok(line)
    }

    #[inline(always)]
    fn enter(&mut self, stage: Stage) {
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.in_tiles = true;
        if let Some(trace) = &mut self.trace {
            trace.add(FLUSH, 0);
        }
        self.memory.begin_tile();
    }
}

impl<M: CardMemory> CardMemory for Traced<M> {
    fn lines(&self) -> u32 {
        self.memory.lines()
    }

    fn stored(&self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.memory.stored(first, count)
    }

    fn write(&mut self, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.memory.write(first, lines)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use flate2::read::GzDecoder;
    use photoncard_firmware::memory::Lines;

    use super::*;

    #[test]
    fn a_trace_has_a_flush_for_a_tile_and_a_line_for_a_read_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.din.gz");
        let lines = [Line::ZERO; 3];
        let mut memory = Traced::new(Lines(&lines), Some(TraceFile::create(&path).unwrap()));
        memory.read(Structure::Header, LineAddress(0), 0..128).unwrap();
        for line in [2, 1] {
            memory.begin_tile();
            memory.read(Structure::Photons, LineAddress(line), 20..40).unwrap();
            memory.read(Structure::Photons, LineAddress(3), 0..20).unwrap_err();
        }
        let trace = memory.take_trace().unwrap();
        assert!(!path.exists());
        trace.finish().unwrap();
        let text = io::read_to_string(GzDecoder::new(fs::File::open(&path).unwrap())).unwrap();
        assert_eq!(text, "4 0\n0 114\n4 0\n0 94\n");
    }
}
