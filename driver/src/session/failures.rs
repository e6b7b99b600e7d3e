//! What a card is at fault for: a link that was closed, or a silent one, is not.

use super::SessionError;

/// Times that a card may fail without having completed a tile: what it crashes at, it is given again.
const MAX_FAILURES: u32 = 4;

/// What a card was at fault for.
#[derive(Default)]
pub(super) struct Failures {
    /// Times that it was reset or came no further, since it completed a tile.
    failed: u32,
    /// Lines that it has written: fewer in its next hello tell that it was reset.
    written_lines: u32,
}

impl Failures {
    /// It was reset or came no further.
    ///
    /// # Errors
    /// If it has failed too often.
    pub(super) fn count(&mut self) -> Result<(), SessionError> {
        self.failed += 1;
        if self.failed > MAX_FAILURES { Err(SessionError::Failures(self.failed)) } else { Ok(()) }
    }

    /// It is known to have been reset: its next hello tells nothing new.
    pub(super) fn forget_lines(&mut self) {
        self.written_lines = 0;
    }

    /// It says hello. Returns whether it was reset since it was loaded.
    pub(super) fn says_hello(&mut self, written_lines: u32) -> bool {
        std::mem::replace(&mut self.written_lines, written_lines) > written_lines
    }

    /// It has an image of so many lines.
    pub(super) fn is_loaded(&mut self, lines: u32) {
        self.written_lines = lines;
    }

    /// It has completed a tile.
    pub(super) fn completes_tile(&mut self) {
        self.failed = 0;
    }
}
