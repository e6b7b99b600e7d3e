//! Fuzzing targets: readers of foreign bytes.

use super::random::Random;

/// Reader of foreign bytes that is fuzzed.
pub trait Target: Send + Sync {
    /// Name on the command line.
    fn name(&self) -> &'static str;

    /// Maximum number of bytes that an input of `input` bytes may allocate at once.
    fn allocation_bound(&self, input: usize) -> usize;

    /// Generates an input.
    fn input(&self, random: &mut Random) -> Vec<u8>;

    /// Reads an input. Returns whether it is valid.
    ///
    /// # Panics
    /// If the input is read incorrectly.
    fn read(&self, input: &[u8]) -> bool;
}

/// Bound of allocations, bytes: 64 MiB plus `for_each` per byte of the input.
pub(super) const fn bound(input: usize, for_each: usize) -> usize {
    (64 << 20) + input * for_each
}
