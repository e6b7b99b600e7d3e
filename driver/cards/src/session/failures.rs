//! Counts a card's failures: resets and lack of progress. Closed links and silence are no failures.

use super::SessionError;

/// Maximum number of failures without a completed tile. A card receives the tile at which it crashed again.
const MAX_FAILURES: u32 = 4;

#[derive(Default)]
pub(super) struct Failures {
    /// Number of resets and standstills since the last completed tile.
    failed: u32,
    /// Number of lines that the card has written. A smaller number in its next hello reveals a reset.
    written_lines: u32,
}

impl Failures {
    /// Counts a reset or a standstill.
    ///
    /// # Errors
    /// If there are more than [`MAX_FAILURES`].
    pub(super) fn count(&mut self) -> Result<(), SessionError> {
        self.failed += 1;
        if self.failed > MAX_FAILURES { Err(SessionError::Failures(self.failed)) } else { Ok(()) }
    }

    /// Forgets the written lines after a known reset, so that the next hello does not count it again.
    pub(super) fn forget_lines(&mut self) {
        self.written_lines = 0;
    }

    /// Compares the number of written lines in a hello with the last one. Returns whether the card was reset
    /// since it was loaded.
    pub(super) fn says_hello(&mut self, written_lines: u32) -> bool {
        std::mem::replace(&mut self.written_lines, written_lines) > written_lines
    }

    /// Records that the card holds an image of `lines` lines.
    pub(super) fn is_loaded(&mut self, lines: u32) {
        self.written_lines = lines;
    }

    /// Resets the count after a completed tile.
    pub(super) fn completes_tile(&mut self) {
        self.failed = 0;
    }
}
