//! Test of card memory. Each pattern is written over the whole memory and read back.

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{
    Fault, FaultCode, MemoryPattern, MemoryTest, WORDS_PER_LINE, WrongWord, WrongWords,
};

use crate::memory::{CardMemory, outside};

/// Number of lines written or read per step: 8 KB.
const STEP_LINES: u32 = 64;

/// Number of lines, 1 MB, after which a test reports its progress. A host waits 120 s for progress, which
/// suffices for a memory of 9 KB/s.
const REPORT_LINES: u32 = 8192;

/// Value of word `index` in a pattern. The function is not inlined: otherwise each loop over words would be
/// compiled once per pattern.
#[inline(never)]
pub fn expected(pattern: MemoryPattern, index: u32) -> u32 {
    match pattern {
        MemoryPattern::WalkingOne => 1 << (index % 32),
        MemoryPattern::WalkingZero => !(1 << (index % 32)),
        MemoryPattern::Address => index,
        MemoryPattern::Complement => !index,
        MemoryPattern::ByteLanes => {
            let mut bytes = (!index).to_le_bytes();
            let (lane, value) = replaced(index);
            if let Some(byte) = bytes.get_mut(lane) {
                *byte = value;
            }
            u32::from_le_bytes(bytes)
        }
    }
}

/// Index, in word `index`, of the byte that [`MemoryPattern::ByteLanes`] replaces, and the byte's new value.
fn replaced(index: u32) -> (usize, u8) {
    let lane = index % 4;
    (lane as usize, (index >> (8 * lane)) as u8)
}

/// Bytes of the line at `address` in a pattern.
#[inline(never)]
fn line(pattern: MemoryPattern, address: u32) -> [u8; LINE_BYTES] {
    let mut bytes = [0; LINE_BYTES];
    let first = address.wrapping_mul(WORDS_PER_LINE);
    for (place, word) in (0..).zip(bytes.as_chunks_mut().0) {
        *word = expected(pattern, first.wrapping_add(place)).to_le_bytes();
    }
    bytes
}

/// A memory test in progress.
pub struct MemoryTester {
    progress: MemoryTest,
}

impl MemoryTester {
    /// Prepares a test of a memory.
    ///
    /// # Errors
    /// [`FaultCode::LineRange`] if the memory has no lines.
    pub fn new(memory: &impl CardMemory) -> Result<Self, Fault> {
        let lines = memory.lines();
        if lines == 0 {
            return Err(Fault { code: FaultCode::LineRange, detail: 0 });
        }
        let [pattern, ..] = MemoryPattern::ALL;
        let wrong = WrongWords::default();
        Ok(Self { progress: MemoryTest { lines, pattern, written: 0, checked: 0, wrong } })
    }

    /// Writes or reads back the next lines. Returns the progress whenever it is to be reported: after each
    /// megabyte and at the end of the memory.
    ///
    /// # Errors
    /// [`FaultCode::LineRange`] if the memory has fewer lines than it reports, [`FaultCode::Memory`] if its
    /// device fails or its lines are read-only.
    pub fn step(&mut self, memory: &mut impl CardMemory) -> Result<Option<MemoryTest>, Fault> {
        let progress = &mut self.progress;
        if let (true, Some(pattern)) = (progress.is_end_of_pattern(), progress.pattern.next()) {
            let MemoryTest { lines, .. } = *progress;
            *progress = MemoryTest { lines, pattern, written: 0, checked: 0, wrong: WrongWords::default() };
        }
        let done = if progress.written < progress.lines { self.write(memory)? } else { self.check(memory)? };
        let is_due = done.is_multiple_of(REPORT_LINES) || done == self.progress.lines;
        Ok(is_due.then_some(self.progress))
    }

    /// Writes the next lines. Returns the number of lines that hold the pattern.
    fn write(&mut self, memory: &mut impl CardMemory) -> Result<u32, Fault> {
        let MemoryTest { lines, pattern, written, .. } = self.progress;
        let end = written.saturating_add(STEP_LINES).min(lines);
        for address in written..end {
            match pattern {
                MemoryPattern::ByteLanes => replace_bytes(memory, address),
                pattern => memory.write(Structure::Header, LineAddress(address), &[line(pattern, address)]),
            }
            .ok_or_else(|| memory.failure().unwrap_or(outside(LineAddress(address))))?;
        }
        self.progress.written = end;
        Ok(end)
    }

    /// Compares the next lines with the pattern. Returns the number of lines compared.
    fn check(&mut self, memory: &mut impl CardMemory) -> Result<u32, Fault> {
        let MemoryTest { lines, pattern, checked, .. } = self.progress;
        // A buffer may hold fewer lines, so that a step ends anywhere; a report is due at multiples of steps.
        let end = (checked | (STEP_LINES - 1)).saturating_add(1).min(lines);
        let first = LineAddress(checked);
        let Some(stored) = memory.stored(first, end - checked) else {
            return Err(memory.failure().unwrap_or(outside(first)));
        };
        let mut next = checked;
        for stored in stored {
            let expected = line(pattern, next);
            if stored.0 != expected {
                add(&mut self.progress.wrong, next, &expected, stored);
            }
            next += 1;
        }
        self.progress.checked = next;
        Ok(next)
    }
}

/// Replaces one byte of each word of a line that holds [`MemoryPattern::Complement`].
fn replace_bytes(memory: &mut impl CardMemory, address: u32) -> Option<()> {
    let first = address.wrapping_mul(WORDS_PER_LINE);
    (0..WORDS_PER_LINE).try_for_each(|word| {
        let (lane, value) = replaced(first.wrapping_add(word));
        memory.write_byte(LineAddress(address), 4 * word as usize + lane, value)
    })
}

/// Adds the wrong words of the line at `address` to `wrong`. Lines must be added in the order of their
/// addresses.
#[cold]
#[inline(never)]
fn add(wrong: &mut WrongWords, address: u32, expected: &[u8; LINE_BYTES], stored: &Line) {
    let first = address.wrapping_mul(WORDS_PER_LINE);
    let words = expected.as_chunks().0.iter().zip(stored.0.as_chunks().0);
    for (place, (expected, found)) in (0..).zip(words) {
        let [expected, found] = [expected, found].map(|bytes| u32::from_le_bytes(*bytes));
        if found != expected {
            wrong.count = wrong.count.saturating_add(1);
            wrong.bits |= expected ^ found;
            wrong.first.get_or_insert(WrongWord { index: first.wrapping_add(place), expected, found });
        }
    }
}
