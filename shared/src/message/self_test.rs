//! Messages of a card's self-test: progress of the test of its memory.

use serde::{Deserialize, Serialize};

use crate::address::LINE_BYTES;

/// Words of 32 bits in a line.
pub const WORDS_PER_LINE: u32 = (LINE_BYTES / 4) as u32;

/// Pattern of a memory test: the contents of every 32-bit word, a function of the word's index. Each pattern
/// is written over the whole memory and then read back, so that what a data cache holds of it is evicted in
/// between.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum MemoryPattern {
    /// One bit set, another in each word of a line: data lines that are stuck at 0, or connected.
    WalkingOne,
    /// One bit clear, another in each word of a line: data lines that are stuck at 1, or connected.
    WalkingZero,
    /// The word's own index: address lines that are stuck, connected or missing, and memory that is mirrored.
    Address,
    /// The complement of the word's index: every bit has the other value.
    Complement,
    /// The complement of the word's index, of which one byte is then replaced by a store of that byte alone:
    /// byte lanes.
    ByteLanes,
}

impl MemoryPattern {
    /// All patterns, in the order of the test.
    pub const ALL: [Self; 5] =
        [Self::WalkingOne, Self::WalkingZero, Self::Address, Self::Complement, Self::ByteLanes];

    /// The next pattern of the test, if any.
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

/// A word that holds another value than was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WrongWord {
    /// Index of the word, from the start of card memory.
    pub index: u32,
    /// The written value.
    pub expected: u32,
    /// The value read.
    pub found: u32,
}

/// Wrong words of one pattern.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WrongWords {
    /// Number of wrong words, at most `u32::MAX`.
    pub count: u32,
    /// Bits that differ in any of them.
    pub bits: u32,
    /// The wrong word of the lowest index.
    pub first: Option<WrongWord>,
}

/// Progress of a memory test. The test is over with the last pattern's last line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemoryTest {
    /// Lines of the memory.
    pub lines: u32,
    /// Pattern at work.
    pub pattern: MemoryPattern,
    /// Lines that hold the pattern.
    pub written: u32,
    /// Lines that were read back.
    pub checked: u32,
    /// Wrong words in them.
    pub wrong: WrongWords,
}

impl MemoryTest {
    /// True at the end of the pattern.
    pub fn is_end_of_pattern(&self) -> bool {
        self.checked == self.lines
    }

    /// True at the end of the test.
    pub fn is_over(&self) -> bool {
        self.is_end_of_pattern() && self.pattern.next().is_none()
    }
}

/// Bytes of the three operands of one [`super::Command::Compute`] case: `f32`, little-endian.
pub const OPERAND_BYTES: usize = 12;

/// Maximum number of operand triples of one [`super::Command::Compute`].
pub const CASES_PER_COMMAND: usize = 8;

/// Number of 32-bit results of one operand triple.
pub const RESULTS: usize = 21;

/// Bytes of the results of one operand triple.
pub const RESULT_BYTES: usize = 4 * RESULTS;
