//! Lines of little-endian 32-bit words, and a stream of them. Floats are stored as their bits.

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, Invariant};

use super::MemoryPort;

/// Number of words of a line.
pub const WORDS: usize = LINE_BYTES / 4;

/// Words of a line.
pub fn words_of(line: &Line) -> [u32; WORDS] {
    let mut words = [0; WORDS];
    for (word, bytes) in words.iter_mut().zip(line.0.as_chunks().0) {
        *word = u32::from_le_bytes(*bytes);
    }
    words
}

/// Line of words.
pub fn line_of(words: [u32; WORDS]) -> Line {
    let mut line = Line::ZERO;
    for (bytes, word) in line.0.as_chunks_mut().0.iter_mut().zip(words) {
        *bytes = word.to_le_bytes();
    }
    line
}

/// Lines of card memory for what waits ([`Structure::Waiting`]), which are written one after another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    next: u32,
    end: u32,
}

impl Room {
    /// Room without lines.
    pub const NONE: Self = Self { next: 0, end: 0 };

    /// Room of `lines` lines from line `first` on.
    pub const fn new(first: u32, lines: u32) -> Self {
        Self { next: first, end: first.saturating_add(lines) }
    }

    /// Address of the next line.
    pub const fn next(&self) -> u32 {
        self.next
    }

    /// Address past the last line.
    pub const fn end(&self) -> u32 {
        self.end
    }

    /// Writes the next line and returns its address.
    ///
    /// # Errors
    /// [`Invariant::Room`] if there is none.
    pub fn write(&mut self, memory: &mut impl MemoryPort, line: &Line) -> Result<u32, Fault> {
        let address = self.next;
        let written = (address < self.end)
            .then(|| memory.write(Structure::Waiting, LineAddress(address), &[line.0]))
            .flatten();
        written.ok_or(Invariant::Room.fault())?;
        self.next += 1;
        Ok(address)
    }
}

/// Stream of words that fills consecutive lines of a [`Room`].
pub struct WordWriter<'a, M> {
    memory: &'a mut M,
    room: &'a mut Room,
    words: [u32; WORDS],
    filled: usize,
}

impl<'a, M: MemoryPort> WordWriter<'a, M> {
    /// Begins a stream at the next line of the room.
    pub fn new(memory: &'a mut M, room: &'a mut Room) -> Self {
        Self { memory, room, words: [0; WORDS], filled: 0 }
    }

    /// Appends a word.
    ///
    /// # Errors
    /// [`Invariant::Room`] if the room has no line left.
    pub fn word(&mut self, word: u32) -> Result<(), Fault> {
        if let Some(place) = self.words.get_mut(self.filled) {
            *place = word;
            self.filled += 1;
        }
        if self.filled == WORDS { self.end() } else { Ok(()) }
    }

    /// Appends words.
    ///
    /// # Errors
    /// As [`Self::word`].
    pub fn all(&mut self, words: impl IntoIterator<Item = u32>) -> Result<(), Fault> {
        words.into_iter().try_for_each(|word| self.word(word))
    }

    /// Appends numbers of `BITS` bits, a divisor of 32, as many in each word as fit.
    ///
    /// # Errors
    /// As [`Self::word`].
    pub fn packed<const BITS: u32>(
        &mut self,
        values: impl ExactSizeIterator<Item = u32>,
    ) -> Result<(), Fault> {
        let (mut word, mut filled, count) = (0, 0, values.len());
        for (index, value) in values.enumerate() {
            word |= value << filled;
            filled += BITS;
            if filled == u32::BITS || index + 1 == count {
                self.word(word)?;
                (word, filled) = (0, 0);
            }
        }
        Ok(())
    }

    /// Writes the last line of the stream, if it has words.
    ///
    /// # Errors
    /// As [`Self::word`].
    pub fn end(&mut self) -> Result<(), Fault> {
        if self.filled > 0 {
            self.room.write(self.memory, &line_of(core::mem::replace(&mut self.words, [0; WORDS])))?;
            self.filled = 0;
        }
        Ok(())
    }
}

/// Reader of a stream of words that a [`WordWriter`] has written.
pub struct WordReader<'a, M> {
    memory: &'a mut M,
    structure: Structure,
    address: u32,
    words: [u32; WORDS],
    read: usize,
}

impl<'a, M: MemoryPort> WordReader<'a, M> {
    /// Reader of the stream that begins at line `first`. Its lines are counted for `structure`.
    pub fn new(memory: &'a mut M, structure: Structure, first: u32) -> Self {
        Self { memory, structure, address: first, words: [0; WORDS], read: WORDS }
    }

    /// Next word.
    ///
    /// # Errors
    /// If the memory ends before the word.
    pub fn word(&mut self) -> Result<u32, Fault> {
        if self.read == WORDS {
            let line = self.memory.read(self.structure, LineAddress(self.address), 0..LINE_BYTES as u32)?;
            self.words = words_of(line);
            self.address = self.address.wrapping_add(1);
            self.read = 0;
        }
        let word = self.words.get(self.read).copied().unwrap_or(0);
        self.read += 1;
        Ok(word)
    }

    /// Next `N` words.
    ///
    /// # Errors
    /// As [`Self::word`].
    pub fn array<const N: usize>(&mut self) -> Result<[u32; N], Fault> {
        let mut words = [0; N];
        for word in &mut words {
            *word = self.word()?;
        }
        Ok(words)
    }

    /// Calls `take` with the index and value of the next `count` numbers that [`WordWriter::packed`] has
    /// written.
    ///
    /// # Errors
    /// As [`Self::word`], and those of `take`.
    pub fn packed<const BITS: u32>(
        &mut self,
        count: usize,
        mut take: impl FnMut(usize, u32) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let (mut word, mut left) = (0, 0);
        for index in 0..count {
            if left == 0 {
                (word, left) = (self.word()?, u32::BITS);
            }
            take(index, word & ((1 << BITS) - 1))?;
            word >>= BITS;
            left -= BITS;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::Dram;

    #[test]
    fn a_stream_is_read_as_written_and_ends_with_its_room() {
        for words in [0, 1, 31, 32, 33, 96] {
            let mut lines = [Line::ZERO; 5];
            let mut memory = Dram::new(&mut lines);
            let mut room = Room::new(1, 3);
            let mut writer = WordWriter::new(&mut memory, &mut room);
            assert_eq!(writer.all((0..words).map(|word| word ^ 0x1234_5678)), Ok(()));
            assert_eq!(writer.end(), Ok(()));
            assert_eq!(room.next(), 1 + words.div_ceil(32));
            let mut reader = WordReader::new(&mut memory, Structure::Waiting, 1);
            for word in 0..words {
                assert_eq!(reader.word(), Ok(word ^ 0x1234_5678));
            }
        }
        let (mut lines, mut room) = ([Line::ZERO; 5], Room::new(1, 3));
        let mut memory = Dram::new(&mut lines);
        let mut writer = WordWriter::new(&mut memory, &mut room);
        assert_eq!(writer.all(0..128), Err(Invariant::Room.fault()));
        assert_eq!(room.next(), 4);
    }
}
