//! What a card is at fault for: a link that was closed, or a silent one, is not.

use super::SessionError;

/// Times that a card may fail without having completed a tile: what it crashes at, it is given again.
const MOST_FAILURES: u32 = 4;

/// What a card was at fault for.
#[derive(Default)]
pub(super) struct Failures {
    /// Times that it was reset or came no further, since it completed a tile.
    count: u32,
    /// Lines that it has written: fewer in its next hello tell that it was reset.
    written_lines: u32,
}

impl Failures {
    /// It came no further.
    ///
    /// # Errors
    /// As all of these: if it has failed too often.
    pub(super) fn stands_still(&mut self) -> Result<(), SessionError> {
        self.count += 1;
        if self.count > MOST_FAILURES { Err(SessionError::Failures(self.count)) } else { Ok(()) }
    }

    /// It does not know the session, or leaves its greeting without a reply.
    pub(super) fn is_reset(&mut self) -> Result<(), SessionError> {
        // Its next hello tells of the same.
        self.written_lines = 0;
        self.stands_still()
    }

    /// It says hello.
    pub(super) fn says_hello(&mut self, written_lines: u32) -> Result<(), SessionError> {
        let was_reset = written_lines < self.written_lines;
        self.written_lines = written_lines;
        if was_reset { self.stands_still() } else { Ok(()) }
    }

    /// It has an image of so many lines.
    pub(super) fn is_loaded(&mut self, lines: u32) {
        self.written_lines = lines;
    }

    /// It has completed a tile.
    pub(super) fn completes_tile(&mut self) {
        self.count = 0;
    }
}
