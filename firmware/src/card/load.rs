//! Loading of a card image. The lines arrive in any order; then the checksum of all lines and the header are
//! checked.

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::checksum::ImageChecksum;
use photoncard_shared::image::{HEADER_LINES, Header, HeaderError};
use photoncard_shared::message::{CHECKSUMS_PER_REPLY, CHUNK_LINES, Fault, FaultCode};

use crate::memory::{CardMemory, Stage, outside};
use crate::scene::SceneImage;
use crate::self_test::MemoryTester;

/// Fault of a command that the card does not accept in its present state.
pub(super) const OUT_OF_ORDER: Fault = Fault { code: FaultCode::Order, detail: 0 };

/// State of the card image in memory, or of a memory test.
#[repr(u8)]
pub(super) enum ImageState {
    // 0, so that a static card is zeroed memory: see `Slot`.
    None = 0,
    Loading(Loader),
    /// All lines have been received; their checksum is being computed.
    Checking(Check),
    Ready(SceneImage),
    /// The memory holds patterns of a memory test.
    Testing(MemoryTester),
}

impl ImageState {
    /// Returns the loader of the card image.
    ///
    /// # Errors
    /// [`FaultCode::Order`] if no card image is being loaded.
    pub(super) fn loader(&self) -> Result<Loader, Fault> {
        match self {
            Self::Loading(loader) => Ok(*loader),
            _ => Err(OUT_OF_ORDER),
        }
    }

    /// Returns the scene if a card image was loaded and checked.
    pub(super) fn scene(&self) -> Option<&SceneImage> {
        match self {
            Self::Ready(scene) => Some(scene),
            _ => None,
        }
    }
}

/// The card image that is being loaded: its announced number of lines and checksum.
#[derive(Clone, Copy)]
pub(super) struct Loader {
    lines: u32,
    checksum: u64,
}

impl Loader {
    pub(super) fn new(memory: &impl CardMemory, lines: u32, checksum: u64) -> Result<Self, Fault> {
        let available = memory.lines();
        if lines == 0 || lines > available {
            return Err(Fault { code: FaultCode::ImageTooLarge, detail: available });
        }
        Ok(Self { lines, checksum })
    }

    /// Writes lines from line `first` on. Returns the index past the last line.
    ///
    /// # Errors
    /// [`FaultCode::Lines`] if `data` does not consist of whole lines, or exceeds the card image. Nothing is
    /// written then. [`FaultCode::Memory`] if the memory's device fails, or the lines are read-only.
    pub(super) fn write(self, memory: &mut impl CardMemory, first: u32, data: &[u8]) -> Result<u32, Fault> {
        let fault = Fault { code: FaultCode::Lines, detail: first };
        let (lines, rest) = data.as_chunks::<LINE_BYTES>();
        let count = u32::try_from(lines.len()).map_err(|_| fault)?;
        let end =
            first.checked_add(count).filter(|&end| end <= self.lines && rest.is_empty()).ok_or(fault)?;
        let written = memory.write(Structure::Header, LineAddress(first), lines);
        written.ok_or_else(|| memory.failure().unwrap_or(fault))?;
        Ok(end)
    }

    pub(super) fn check(self) -> Check {
        Check { loader: self, next: 0, checksum: ImageChecksum::default() }
    }
}

/// Check of a loaded card image against the announced checksum, in chunks of `CHUNK_LINES` lines.
pub(super) struct Check {
    loader: Loader,
    next: u32,
    checksum: ImageChecksum,
}

impl Check {
    /// Adds the next chunk to the checksum. Returns the scene when the check is complete, `None` before.
    ///
    /// # Errors
    /// [`FaultCode::ImageChecksum`] or [`FaultCode::ImageHeader`] if the card image is not the announced one.
    pub(super) fn step(&mut self, memory: &mut impl CardMemory) -> Result<Option<SceneImage>, Fault> {
        let Loader { lines, checksum } = self.loader;
        let known = memory.known_checksum(lines);
        if known.is_none() {
            let count = CHUNK_LINES.min(lines - self.next);
            update(&mut self.checksum, memory, self.next, count)?;
            self.next += count;
            if self.next < lines {
                return Ok(None);
            }
        }
        let found = known.unwrap_or_else(|| self.checksum.value());
        if found != checksum {
            return Err(Fault { code: FaultCode::ImageChecksum, detail: found as u32 });
        }
        memory.enter(Stage::Begin);
        let mut head = [Line::ZERO; HEADER_LINES];
        for (address, line) in (0..).map(LineAddress).zip(&mut head) {
            *line = *memory.read(Structure::Header, address, 0..LINE_BYTES as u32)?;
        }
        let unsound = |detail: u32| Fault { code: FaultCode::ImageHeader, detail };
        let header = Header::read(&head).map_err(|error| match error {
            HeaderError::Version(version) => unsound(version as u32),
            _ => unsound(0),
        })?;
        if header.lines != lines {
            return Err(unsound(0));
        }
        Ok(Some(SceneImage { header }))
    }
}

/// Maximum length of the checksums in one reply, bytes.
pub(super) const CHECKSUMS_BYTES: usize = 8 * CHECKSUMS_PER_REPLY as usize;

/// Computation of the checksums that the host requested, one for each chunk of `CHUNK_LINES` lines.
pub(super) struct Checksums {
    pub(super) first: u32,
    end: u32,
    next: u32,
}

impl Checksums {
    /// Prepares the checksums of `count` chunks from chunk `first` on, in a memory whose first `written`
    /// lines were written.
    ///
    /// # Errors
    /// [`FaultCode::Chunks`] if `count` is 0 or above [`CHECKSUMS_PER_REPLY`], or a chunk was not written.
    pub(super) fn new(first: u32, count: u32, written: u32) -> Result<Self, Fault> {
        let fault = Fault { code: FaultCode::Chunks, detail: first };
        let in_all = written.div_ceil(CHUNK_LINES);
        let end = first.checked_add(count).filter(|&end| end <= in_all).ok_or(fault)?;
        if count == 0 || count > CHECKSUMS_PER_REPLY {
            return Err(fault);
        }
        Ok(Self { first, end, next: first })
    }

    /// Returns the checksum of the next chunk, and whether it is the last one requested. The last chunk in
    /// memory may be shorter than others.
    pub(super) fn step(&mut self, memory: &mut impl CardMemory, written: u32) -> Result<(u64, bool), Fault> {
        let begin = self.next.saturating_mul(CHUNK_LINES);
        let mut checksum = ImageChecksum::default();
        update(&mut checksum, memory, begin, CHUNK_LINES.min(written.saturating_sub(begin)))?;
        self.next += 1;
        Ok((checksum.value(), self.next >= self.end))
    }
}

/// Adds `count` lines of the memory from line `first` on to a checksum.
///
/// # Errors
/// [`FaultCode::LineRange`] if some of them are not in the memory, [`FaultCode::Memory`] if its device fails.
fn update(
    checksum: &mut ImageChecksum,
    memory: &mut impl CardMemory,
    first: u32,
    count: u32,
) -> Result<(), Fault> {
    let end = first.saturating_add(count);
    let mut next = first;
    while next < end {
        next += match memory.stored(LineAddress(next), end - next) {
            Some(lines) if !lines.is_empty() => {
                checksum.update(lines);
                lines.len() as u32
            }
            _ => return Err(memory.failure().unwrap_or(outside(LineAddress(next)))),
        };
    }
    Ok(())
}
