//! Loading the image: what the card has of it already is not sent again.

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::message::{self, CHECKSUMS_PER_REPLY, CHUNK_LINES, Command, LINES_PER_WRITE};
use photoncard_shared::transport::Transport;

use super::SessionError;

/// How far the image is loaded.
#[derive(Default)]
pub(super) struct Load {
    /// Lines that the card has written, of any image.
    written: u32,
    /// Chunks that were asked for.
    asked: u32,
    /// Those of them whose checksums have come.
    compared: u32,
    /// Chunks of the image that the card has.
    there: Vec<u32>,
    /// The next line to look at.
    next: usize,
}

impl Load {
    /// Nothing is known but how many lines the card has written.
    pub(super) fn new(written: u32) -> Self {
        Self { written, ..Self::default() }
    }

    /// Lines that are done with.
    pub(super) fn done(&self) -> usize {
        self.next
    }

    /// The question for the next checksums; `None` if all that can be known is.
    pub(super) fn next_question(&mut self, image: &[Line]) -> Option<Command<'static>> {
        // A chunk that either ends within is not compared.
        let chunks = (self.written.min(image.len() as u32)) / CHUNK_LINES;
        let first = self.asked;
        let count = chunks.saturating_sub(first).min(CHECKSUMS_PER_REPLY);
        self.asked += count;
        (count > 0).then_some(Command::ReadChecksums { first, count })
    }

    /// Compares the checksums of some chunks with the image's.
    ///
    /// # Errors
    /// If they are not those that were asked for last.
    pub(super) fn compare(&mut self, image: &[Line], first: u32, data: &[u8]) -> Result<(), SessionError> {
        let (checksums, rest) = data.as_chunks::<8>();
        let end = first.checked_add(checksums.len() as u32);
        let begins_as_asked = first == self.compared;
        if end != Some(self.asked) || !rest.is_empty() || checksums.is_empty() || !begins_as_asked {
            return Err(SessionError::Unexpected("checksums that were not asked for"));
        }
        self.compared = self.asked;
        let mut chunks = image.chunks(CHUNK_LINES as usize).skip(first as usize);
        for (number, found) in (first..).zip(checksums) {
            if image_checksum(chunks.next().unwrap_or(&[])) == u64::from_le_bytes(*found) {
                self.there.push(number);
            }
        }
        Ok(())
    }

    /// Sends the next lines that the card does not have. Returns their bytes; 0 if it has all.
    pub(super) fn next_lines(&mut self, image: &[Line], transport: &mut Transport) -> usize {
        while self.there.binary_search(&(self.next as u32 / CHUNK_LINES)).is_ok() {
            self.next = (self.next / CHUNK_LINES as usize + 1) * CHUNK_LINES as usize;
        }
        let end = (self.next + LINES_PER_WRITE).min(image.len());
        let Some(lines) = image.get(self.next..end).filter(|lines| !lines.is_empty()) else { return 0 };
        let mut data = [0; LINE_BYTES * LINES_PER_WRITE];
        for (target, line) in data.as_chunks_mut().0.iter_mut().zip(lines) {
            *target = line.0;
        }
        let data = &data[..lines.len() * LINE_BYTES];
        let command = Command::WriteLines { first: self.next as u32, data };
        transport.send(|bytes| message::encode(&command, bytes));
        self.next = end;
        data.len()
    }
}
