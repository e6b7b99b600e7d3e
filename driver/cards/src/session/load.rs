//! Loads the image: sends only runs of lines that the card lacks. They follow from the image that the card
//! holds or, if that is unknown, from the checksums of its chunks.

use std::ops::Range;

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::message::{self, CHECKSUMS_PER_REPLY, CHUNK_LINES, Command, LINES_PER_WRITE};
use photoncard_shared::transport::Transport;

use super::SessionError;
use super::upload::{Runs, Upload, add_run};

/// Comparison of chunk checksums between the card's memory and the image.
#[derive(Default)]
pub(super) struct Comparison {
    /// Number of lines that the card has written, of any image.
    written: u32,
    /// Number of chunks whose checksums were requested.
    asked: u32,
    /// Number of chunks whose checksums were received.
    compared: u32,
    /// Runs of compared lines that differ.
    lacking: Vec<Range<usize>>,
}

impl Comparison {
    /// Starts a comparison. `written` is the number of lines that the card has written.
    pub(super) fn new(written: u32) -> Self {
        Self { written, ..Self::default() }
    }

    /// Command that requests the next checksums; `None` after all chunks that the card has written.
    pub(super) fn next_question(&mut self, upload: &Upload) -> Option<Command<'static>> {
        // An incomplete chunk, of the card or of the image, is not compared.
        let chunks = (self.written.min(upload.lines().len() as u32)) / CHUNK_LINES;
        let first = self.asked;
        let count = chunks.saturating_sub(first).min(CHECKSUMS_PER_REPLY);
        self.asked += count;
        (count > 0).then_some(Command::ReadChecksums { first, count })
    }

    /// Compares received checksums with those of the image.
    ///
    /// # Errors
    /// If they are not the checksums that were last requested.
    pub(super) fn compare(&mut self, upload: &Upload, first: u32, data: &[u8]) -> Result<(), SessionError> {
        let (checksums, rest) = data.as_chunks::<8>();
        let end = first.checked_add(checksums.len() as u32);
        let begins_as_asked = first == self.compared;
        if end != Some(self.asked) || !rest.is_empty() || checksums.is_empty() || !begins_as_asked {
            return Err(SessionError::Unexpected("checksums that were not asked for"));
        }
        self.compared = self.asked;
        for (chunk, found) in (first as usize..).zip(checksums) {
            if upload.chunks().get(chunk) != Some(&u64::from_le_bytes(*found)) {
                let lines = CHUNK_LINES as usize;
                add_run(&mut self.lacking, chunk * lines..(chunk + 1) * lines);
            }
        }
        Ok(())
    }

    /// Runs of lines that the card lacks, once all checksums are compared.
    pub(super) fn finish(&mut self, upload: &Upload) -> Runs {
        let compared = (self.compared * CHUNK_LINES) as usize;
        add_run(&mut self.lacking, compared..upload.lines().len());
        std::mem::take(&mut self.lacking).into()
    }
}

/// Progress of sending lines to a card.
#[derive(Default)]
pub(super) struct Load {
    runs: Runs,
    /// Number of runs that were sent completely.
    run: usize,
    /// Index of the next line, in or before the next run.
    next: usize,
    /// True if the runs are the difference to the image that the card held.
    pub(super) is_change: bool,
}

impl Load {
    pub(super) fn new(runs: Runs, is_change: bool) -> Self {
        Self { runs, run: 0, next: 0, is_change }
    }

    /// Number of lines that the card has or that were sent.
    pub(super) fn done(&self) -> usize {
        self.next
    }

    /// Sends the next lines that the card lacks. Returns their size in bytes; 0 after the last ones.
    pub(super) fn next_lines(&mut self, upload: &Upload, transport: &mut Transport) -> usize {
        let Some(run) = self.runs.get(self.run) else { return 0 };
        let first = self.next.max(run.start);
        let end = (first + LINES_PER_WRITE).min(run.end);
        let Some(lines) = upload.lines().get(first..end).filter(|lines| !lines.is_empty()) else { return 0 };
        let mut data = [0; LINE_BYTES * LINES_PER_WRITE];
        for (target, line) in data.as_chunks_mut().0.iter_mut().zip(lines) {
            *target = line.0;
        }
        let data = &data[..lines.len() * LINE_BYTES];
        let command = Command::WriteLines { first: first as u32, data };
        transport.send(|bytes| message::encode(&command, bytes));
        self.next = end;
        self.run += usize::from(end == run.end);
        data.len()
    }
}
