//! Upload of a card image to cards. Checksums are computed once for all cards. Only runs of lines that the
//! card lacks are sent. These runs are known if the card holds this card image or the previous one. Otherwise
//! they follow from the checksums of the chunks in the card's memory.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::message::{self, CHECKSUMS_PER_REPLY, CHUNK_LINES, Command, LINES_PER_WRITE};
use photoncard_shared::transport::Transport;

use super::SessionError;

/// Ascending, disjoint runs of consecutive lines of a card image.
pub(super) type Runs = Arc<[Range<usize>]>;

/// Lines of a card image that the host keeps in memory.
type SharedLines = Arc<dyn AsRef<[Line]> + Send + Sync>;

/// Card image as it is sent to cards. Checksums and changed lines are computed once for all cards.
pub struct Upload {
    lines: SharedLines,
    checksum: u64,
    /// Checksums of all whole chunks, computed when they are first compared with those of a card.
    chunks: OnceLock<Vec<u64>>,
    /// Checksum of the previous card image, and the runs of lines in which the present image differs from it.
    change: Option<(u64, Runs)>,
}

impl Upload {
    /// Creates the upload of a card image to cards with unknown contents.
    pub fn new(lines: Arc<impl AsRef<[Line]> + Send + Sync + 'static>) -> Self {
        let checksum = image_checksum((*lines).as_ref());
        Self { lines, checksum, chunks: OnceLock::new(), change: None }
    }

    /// Records the difference from the previous card image `before`, for cards that hold that image.
    #[must_use]
    pub fn after(self, before: &Self) -> Self {
        let runs = changed_runs(before.lines(), self.lines());
        Self { change: Some((before.checksum, runs.into())), ..self }
    }

    /// Lines of the card image.
    pub fn lines(&self) -> &[Line] {
        (*self.lines).as_ref()
    }

    /// [`image_checksum`] of the lines.
    pub fn checksum(&self) -> u64 {
        self.checksum
    }

    /// Checksums of all whole chunks of [`CHUNK_LINES`] lines.
    pub(super) fn chunks(&self) -> &[u64] {
        let sums = || self.lines().chunks_exact(CHUNK_LINES as usize).map(image_checksum).collect();
        self.chunks.get_or_init(sums)
    }

    /// Runs of lines that a card lacks if it holds the card image with checksum `held`; `None` if they are
    /// unknown.
    pub(super) fn missing_from(&self, held: u64) -> Option<Runs> {
        if held == self.checksum {
            return Some(Runs::default());
        }
        self.change.as_ref().filter(|(before, _)| *before == held).map(|(_, runs)| runs.clone())
    }
}

/// Returns the runs of lines of `after` that differ from the line of `before` at the same index, or lie
/// beyond the end of `before`.
pub fn changed_runs(before: &[Line], after: &[Line]) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    for (index, line) in after.iter().enumerate() {
        if before.get(index) != Some(line) {
            add_run(&mut runs, index..index + 1);
        }
    }
    runs
}

/// Appends a run, which must follow all others, and merges it with an adjacent one.
pub(super) fn add_run(runs: &mut Vec<Range<usize>>, run: Range<usize>) {
    match runs.last_mut() {
        Some(last) if last.end == run.start => last.end = run.end,
        _ if run.is_empty() => {}
        _ => runs.push(run),
    }
}

/// Comparison of chunk checksums between the card's memory and the card image.
#[derive(Default)]
pub(super) struct Comparison {
    /// Number of lines that the card has written, of any card image.
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

    /// Number of lines that the card has written.
    pub(super) fn written(&self) -> u32 {
        self.written
    }

    /// Command that requests the next checksums; `None` after all chunks that the card has written.
    pub(super) fn next_question(&mut self, upload: &Upload) -> Option<Command<'static>> {
        // An incomplete chunk, of the card or of the card image, is not compared.
        let chunks = (self.written.min(upload.lines().len() as u32)) / CHUNK_LINES;
        let first = self.asked;
        let count = chunks.saturating_sub(first).min(CHECKSUMS_PER_REPLY);
        self.asked += count;
        (count > 0).then_some(Command::ReadChecksums { first, count })
    }

    /// Compares received checksums with those of the card image.
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
    /// True if the runs are the difference to the card image that the card held.
    pub(super) is_change: bool,
}

impl Load {
    pub(super) fn new(runs: Runs, is_change: bool) -> Self {
        Self { runs, run: 0, next: 0, is_change }
    }

    /// Number of lines, from the first, that the card has or was sent.
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

#[cfg(test)]
mod tests {
    use photoncard_shared::address::LINE_BYTES;
    use proptest::prelude::*;

    use super::*;

    fn lines(bytes: &[u8]) -> Vec<Line> {
        bytes.iter().map(|&byte| Line([byte; LINE_BYTES])).collect()
    }

    proptest! {
        #[test]
        fn changed_runs_turn_one_image_into_the_other_without_equal_lines(
            before in proptest::collection::vec(0..3_u8, 0..40),
            after in proptest::collection::vec(0..3_u8, 0..40),
        ) {
            let runs = changed_runs(&lines(&before), &lines(&after));
            let mut made = before.clone();
            made.resize(after.len(), u8::MAX);
            let mut end_of_last = None;
            for run in runs {
                prop_assert!(run.start < run.end && end_of_last.is_none_or(|end| end < run.start));
                prop_assert!(run.clone().all(|line| before.get(line) != Some(&after[line])));
                made[run.clone()].copy_from_slice(&after[run.clone()]);
                end_of_last = Some(run.end);
            }
            prop_assert_eq!(made, after);
        }
    }

    #[test]
    fn a_card_lacks_changed_lines_of_the_previous_image_and_none_of_the_same() {
        let [first, other] =
            [[1, 2, 3, 4, 5], [1, 7, 8, 4, 9]].map(|bytes| Upload::new(Arc::new(lines(&bytes))));
        let [held, checksum] = [first.checksum(), other.checksum()];
        assert_eq!(other.missing_from(held), None);
        let other = other.after(&first);
        assert_eq!(other.missing_from(checksum).as_deref(), Some(&[][..]));
        assert_eq!(other.missing_from(held).as_deref(), Some(&[1..3, 4..5][..]));
        assert_eq!(other.missing_from(!held), None);
    }
}
