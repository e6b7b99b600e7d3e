//! Fuzzing targets: readers of bytes that other programs wrote.

use super::random::Random;

/// A reader of bytes that other programs wrote.
pub trait Target: Send + Sync {
    /// Its name on the command line.
    fn name(&self) -> &'static str;

    /// The most bytes that it may have allocated at once for an input of so many bytes.
    fn allocation_bound(&self, input: usize) -> usize;

    /// Makes an input.
    fn input(&self, random: &mut Random) -> Vec<u8>;

    /// Reads an input. Returns whether it was sound.
    ///
    /// # Panics
    /// If it is read otherwise than it must be.
    fn read(&self, input: &[u8]) -> bool;
}

/// A bound on allocations, bytes: 64 MiB, and `for_each` for each byte of the input.
pub(super) const fn bound(input: usize, for_each: usize) -> usize {
    (64 << 20) + input * for_each
}
