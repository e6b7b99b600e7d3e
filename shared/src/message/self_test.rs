//! Messages of a card's self-test.

use serde::{Deserialize, Serialize};

use crate::address::LINE_BYTES;

/// Words of 32 bits in a line.
pub const WORDS_PER_LINE: u32 = (LINE_BYTES / 4) as u32;

/// Pattern of a memory test. It defines the content of every 32-bit word as a function of the word's index.
/// Each pattern is written to the whole memory before it is read back, so that a data cache cannot hide
/// errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MemoryPattern {
    /// One bit is set, at a different position in each word of a line. Finds data lines that are stuck at 0
    /// or connected.
    WalkingOne,
    /// One bit is clear, at a different position in each word of a line. Finds data lines that are stuck at 1
    /// or connected.
    WalkingZero,
    /// The word's own index. Finds address lines that are stuck, shorted together or missing, and memory that
    /// repeats at other addresses.
    Address,
    /// The complement of the word's index: the pattern [`Self::Address`] with every bit inverted.
    Complement,
    /// The complement of the word's index, in which one byte is then replaced by a one-byte store. Finds
    /// defects of byte lanes.
    ByteLanes,
}

impl MemoryPattern {
    /// All patterns, in the order of the test.
    pub const ALL: [Self; 5] =
        [Self::WalkingOne, Self::WalkingZero, Self::Address, Self::Complement, Self::ByteLanes];

    /// The pattern after this one; `None` after the last.
    pub fn next(self) -> Option<Self> {
        Self::ALL.get(self as usize + 1).copied()
    }

    /// Name of the pattern in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::WalkingOne => "walking one",
            Self::WalkingZero => "walking zero",
            Self::Address => "address",
            Self::Complement => "complement",
            Self::ByteLanes => "byte lanes",
        }
    }
}

/// A word whose value differs from the written one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WrongWord {
    /// Index of the 32-bit word, counted from the start of card memory.
    pub index: u32,
    /// The written value.
    pub expected: u32,
    /// The value read.
    pub found: u32,
}

/// Summary of the wrong words of one pattern.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WrongWords {
    /// Number of wrong words, at most `u32::MAX`.
    pub count: u32,
    /// Bitwise OR of `expected ^ found` over all wrong words.
    pub bits: u32,
    /// The wrong word with the lowest index.
    pub first: Option<WrongWord>,
}

/// Progress of a memory test. The test ends with the last line of the last pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryTest {
    /// Number of lines of the memory.
    pub lines: u32,
    /// Pattern that is being written or checked.
    pub pattern: MemoryPattern,
    /// Number of lines to which the pattern was written so far.
    pub written: u32,
    /// Number of lines that were read back so far.
    pub checked: u32,
    /// Wrong words in the lines read back.
    pub wrong: WrongWords,
}

impl MemoryTest {
    /// Returns true at the end of the pattern.
    pub fn is_end_of_pattern(&self) -> bool {
        self.checked == self.lines
    }

    /// Returns true at the end of the test.
    pub fn is_over(&self) -> bool {
        self.is_end_of_pattern() && self.pattern.next().is_none()
    }
}

/// Bytes of one operand triple of [`super::Command::Compute`]: three little-endian `f32`.
pub const OPERAND_BYTES: usize = 12;

/// Maximum number of operand triples of one [`super::Command::Compute`].
pub const CASES_PER_COMMAND: usize = 8;

/// Number of 32-bit results of one operand triple.
pub const RESULTS: usize = 21;

/// Bytes of the results of one operand triple.
pub const RESULT_BYTES: usize = 4 * RESULTS;
