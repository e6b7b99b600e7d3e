//! Fuzzing targets: readers of foreign bytes.

use std::fs;
use std::path::Path;

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

/// Writes a file in place of that of the input before, which is removed. Some file systems write the contents
/// of a file that is truncated to the disk when it is closed, which takes milliseconds.
///
/// # Panics
/// If there is no room for the file.
pub(super) fn write_anew(path: &Path, contents: &[u8]) {
    let _ = fs::remove_file(path);
    fs::write(path, contents).expect("there is room for a file");
}
