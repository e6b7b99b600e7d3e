//! Loading of the image: chunks that the card has already, by their checksums, are not sent.

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::message::{self, CHECKSUMS_PER_REPLY, CHUNK_LINES, Command, LINES_PER_WRITE};
use photoncard_shared::transport::Transport;

use super::SessionError;

/// Progress of loading.
#[derive(Default)]
pub(super) struct Load {
    /// Number of lines that the card has written, of any image.
    written: u32,
    /// Number of chunks whose checksums were requested.
    asked: u32,
    /// Number of chunks whose checksums were received.
    compared: u32,
    /// Indices of chunks that the card has.
    there: Vec<u32>,
    /// Index of the next line.
    next: usize,
}

impl Load {
    /// Start of loading; `written` is the number of lines that the card has written.
    pub(super) fn new(written: u32) -> Self {
        Self { written, ..Self::default() }
    }

    /// Number of lines that the card has or that were sent.
    pub(super) fn done(&self) -> usize {
        self.next
    }

    /// Request for the next checksums; `None` after all chunks that the card has written.
    pub(super) fn next_question(&mut self, image: &[Line]) -> Option<Command<'static>> {
        // An incomplete chunk, of the card or of the image, is not compared.
        let chunks = (self.written.min(image.len() as u32)) / CHUNK_LINES;
        let first = self.asked;
        let count = chunks.saturating_sub(first).min(CHECKSUMS_PER_REPLY);
        self.asked += count;
        (count > 0).then_some(Command::ReadChecksums { first, count })
    }

    /// Compares received checksums with the image's.
    ///
    /// # Errors
    /// If they are not the checksums that were last requested.
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

    /// Sends the next lines that the card lacks. Returns their size in bytes; 0 at the end of the image.
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
