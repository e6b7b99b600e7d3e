//! Trace files of a chip's memory reads for its tiles. A trace records the reads above the caches, for a
//! cache simulator, or below them, for a DRAM simulator.
//!
//! Above the caches, a trace has Dinero's classic input format. Each line of text is one access: a label, a
//! blank, and a byte address in hexadecimal. Label 0 is a read of data, label 1 a write of a line. Label 4
//! is Dinero's escape that flushes its caches; it is written with address 0 at the beginning of every tile,
//! and where a chip whose gathers wait in card memory begins to cast rays or to do gathers. A labelled
//! trace adds the structure, the stage and the number of bytes of the read to the line; Dinero ignores
//! them. Below the caches, each line of text is a fetch or a write of one line of card memory, in the
//! format of Ramulator 2 or of `DRAMsim3`. See `docs/memory.md`.

use std::fmt::Arguments;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use flate2::Compression;
use flate2::write::GzEncoder;
use photoncard_firmware::memory::{Stage, Work};
use photoncard_picture::choice::{Choice, choices};
use photoncard_picture::output::{OutputError, PendingFile};
use photoncard_shared::address::{LINE_BYTES, Structure};

/// Size of the blocks in which the text is compressed, bytes.
const BUFFER: usize = 64 << 10;
/// Maximum length of a line of text, bytes: a label, an address of 39 bits in hexadecimal, the names of a
/// structure and of a stage, a byte count of three digits, blanks and the line feed.
const LONGEST_LINE: usize = 64;

const READ: u8 = 0;
const WRITE: u8 = 1;
const FLUSH: u8 = 4;

/// Format of a trace.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TraceFormat {
    /// Accesses above the caches, for Dinero.
    #[default]
    Dinero,
    /// Lines read from and written to DRAM, for Ramulator 2's load-store trace.
    Ramulator,
    /// Lines read from and written to DRAM, for `DRAMsim3`. Each access is one cycle after the previous one,
    /// so that the DRAM always has work.
    Dramsim3,
}

choices!(TraceFormat {
    Dinero = "dinero": "Accesses above the caches, for Dinero",
    Ramulator = "ramulator": "Lines from DRAM, for Ramulator 2",
    Dramsim3 = "dramsim3": "Lines from DRAM, for DRAMsim3",
});

impl TraceFormat {
    /// Returns true for traces of the DRAM, false for traces of the chip's requests.
    pub fn is_below_caches(self) -> bool {
        self != Self::Dinero
    }
}

/// Path and format of a trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TraceSettings {
    /// Path of the file.
    pub path: PathBuf,
    /// Format of the lines.
    pub format: TraceFormat,
    /// True if each access in a trace of [`TraceFormat::Dinero`] is followed by its structure, stage and byte
    /// count.
    pub has_labels: bool,
}

/// Trace file that is being written, compressed by gzip. It appears under its path only when it is finished.
pub struct TraceFile {
    encoder: GzEncoder<PendingFile>,
    buffer: Vec<u8>,
    settings: TraceSettings,
    /// Number of fetches and writes below the caches that are in the trace.
    accesses: u64,
    /// First failure. Nothing is written after it.
    error: Option<io::Error>,
    has_failed: Arc<AtomicBool>,
}

impl TraceFile {
    /// Creates a trace that will be stored at the path in `settings`.
    ///
    /// # Errors
    /// As [`photoncard_picture::output::check_writable`].
    pub fn create(settings: &TraceSettings) -> Result<Self, OutputError> {
        Ok(Self {
            encoder: GzEncoder::new(PendingFile::create(&settings.path)?, Compression::fast()),
            buffer: Vec::with_capacity(BUFFER),
            settings: settings.clone(),
            accesses: 0,
            error: None,
            has_failed: Arc::default(),
        })
    }

    /// Flag that is set when the file cannot be written. The render can then end, because there will be no
    /// trace.
    pub fn has_failed(&self) -> Arc<AtomicBool> {
        self.has_failed.clone()
    }

    /// Returns whether the trace records fetches from DRAM, below the caches.
    pub fn is_below_caches(&self) -> bool {
        self.settings.format.is_below_caches()
    }

    pub(super) fn add_read(&mut self, address: u64, structure: Structure, stage: Stage, bytes: usize) {
        if self.is_below_caches() {
            self.add_access(address, false);
        } else if self.settings.has_labels {
            let (structure, stage) = (structure.name(), stage.name());
            self.add(format_args!("{READ} {address:x} {structure} {stage} {bytes}"));
        } else {
            self.add(format_args!("{READ} {address:x}"));
        }
    }

    /// Adds a write of a line.
    pub(super) fn add_write(&mut self, address: u64, structure: Structure, stage: Stage) {
        if self.is_below_caches() {
            self.add_access(address, true);
        } else if self.settings.has_labels {
            let (structure, stage) = (structure.name(), stage.name());
            self.add(format_args!("{WRITE} {address:x} {structure} {stage} {LINE_BYTES}"));
        } else {
            self.add(format_args!("{WRITE} {address:x}"));
        }
    }

    /// Adds a fetch of a line from DRAM, or a write to it.
    fn add_access(&mut self, address: u64, is_write: bool) {
        let cycle = self.accesses;
        let [ramulator, dramsim3] = if is_write { ["ST", "WRITE"] } else { ["LD", "READ"] };
        match self.settings.format {
            TraceFormat::Ramulator => self.add(format_args!("{ramulator} 0x{address:x}")),
            _ => self.add(format_args!("0x{address:x} {dramsim3} {cycle}")),
        }
        self.accesses += 1;
    }

    /// Marks the beginning of a tile in the trace. A cache simulator empties its caches there.
    pub(super) fn begin_tile(&mut self) {
        if !self.is_below_caches() {
            self.add(format_args!("{FLUSH} 0"));
        }
    }

    /// Marks the beginning of another kind of work, at which caches are empty too.
    pub(super) fn begin_work(&mut self, work: Work) {
        if self.settings.has_labels {
            self.add(format_args!("{FLUSH} 0 {}", work.name()));
        } else {
            self.begin_tile();
        }
    }

    fn add(&mut self, line: Arguments) {
        if self.buffer.len() > BUFFER - LONGEST_LINE {
            self.compress();
        }
        // Writing to a vector cannot fail.
        let _ = writeln!(self.buffer, "{line}");
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
    /// If any part of the trace could not be written.
    pub fn finish(mut self) -> Result<(), OutputError> {
        self.compress();
        let Self { encoder, settings: TraceSettings { path, .. }, error, .. } = self;
        let ended = match error {
            None => encoder.finish(),
            Some(error) => Err(error),
        };
        ended.map_err(|source| OutputError::Write { path, source })?.commit()
    }
}

#[cfg(test)]
mod tests {
    use photoncard_shared::address::LINE_BYTES;

    use super::*;

    /// Text must be compressed when the next line might not fit into the buffer.
    #[test]
    fn the_longest_line_fits_into_the_reserved_room() {
        let longest = |names: Vec<&str>| names.into_iter().map(str::len).max().unwrap();
        let structure = longest(Structure::ALL.iter().map(|structure| structure.name()).collect());
        let stage = longest(Stage::ALL.iter().map(|stage| stage.name()).collect());
        let address = format!("{:x}", u32::MAX as u64 * LINE_BYTES as u64).len();
        assert!(
            "0 ".len() + address + " ".len() + structure + " ".len() + stage + " 128\n".len() <= LONGEST_LINE
        );
        assert!("0x READ \n".len() + address + u64::MAX.to_string().len() <= LONGEST_LINE);
    }
}
