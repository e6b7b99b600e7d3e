//! Interface of a reader of foreign bytes for fuzzing.

use std::fs;
use std::path::Path;

use super::random::Random;

/// Reader of foreign bytes that is fuzzed.
pub trait Target: Send + Sync {
    /// Name on the command line.
    fn name(&self) -> &'static str;

    /// Maximum number of bytes in use at once while an input of `input` bytes is read.
    fn allocation_bound(&self, input: usize) -> usize;

    /// Generates an input from random numbers.
    fn input(&self, random: &mut Random) -> Vec<u8>;

    /// Reads an input. Returns whether it is valid.
    ///
    /// # Panics
    /// If the reader under test is wrong.
    fn read(&self, input: &[u8]) -> bool;
}

/// Bound of the bytes in use: 64 MiB, and `for_each` for each byte of the input.
pub(super) const fn bound(input: usize, for_each: usize) -> usize {
    (64 << 20) + input * for_each
}

/// Removes the file of the previous input, and writes a new file. Some file systems write a truncated file to
/// disk when it is closed, which takes milliseconds.
///
/// # Panics
/// If the file cannot be written.
pub(super) fn write_anew(path: &Path, contents: &[u8]) {
    let _ = fs::remove_file(path);
    fs::write(path, contents).expect("there is room for a file");
}
