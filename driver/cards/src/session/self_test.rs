//! Self-test of a card: the requested part, and the check of its replies.

use photoncard_shared::message::{
    MemoryPattern, MemoryTest, RESULT_BYTES, Reply, WORDS_PER_LINE, WrongWords,
};

use super::{Event, SessionError};

/// Requested part of the self-test.
#[derive(Clone, Copy)]
pub(super) enum Request {
    Nothing,
    /// Checksums of a number of chunks from the first, for the host of a relay.
    Checksums {
        first: u32,
        count: u32,
    },
    /// Results of this number of operand triples.
    Compute(usize),
    /// Memory test with the last reported progress; `None` before the first report.
    Memory(Option<MemoryTest>),
}

impl Request {
    /// Returns the event of a valid reply, and whether the reply is the last one.
    ///
    /// # Errors
    /// If the reply does not answer the request.
    pub(super) fn take(&mut self, reply: &Reply) -> Result<(Event, bool), SessionError> {
        match (self, reply) {
            (Self::Compute(cases), Reply::Computed { results }) if results.len() == *cases * RESULT_BYTES => {
                Ok((Event::Computed(results.to_vec()), true))
            }
            (Self::Memory(last), Reply::MemoryTested(progress)) if follows(progress, last.as_ref()) => {
                *last = Some(*progress);
                Ok((Event::MemoryTested(*progress), progress.is_over()))
            }
            _ => Err(SessionError::Unexpected("not a result of the self-test that was asked for")),
        }
    }
}

/// Returns whether a report of a memory test is consistent, and possible after the last report.
fn follows(progress: &MemoryTest, last: Option<&MemoryTest>) -> bool {
    let MemoryTest { lines, pattern, written, checked, wrong } = *progress;
    let WrongWords { count, bits, first } = wrong;
    let words = u64::from(checked) * u64::from(WORDS_PER_LINE);
    let is_wrong = count > 0;
    let names_first = first.is_some_and(|word| {
        let differing = word.expected ^ word.found;
        u64::from(word.index) < words && differing != 0 && differing & !bits == 0
    });
    let is_sound = written <= lines
        && (checked == 0 || written == lines && checked <= lines)
        && u64::from(count) <= words
        && is_wrong == (bits != 0)
        && (if is_wrong { names_first } else { first.is_none() });
    let goes_on = match last {
        None => pattern == MemoryPattern::ALL[0],
        Some(last) if last.is_end_of_pattern() => last.lines == lines && last.pattern.next() == Some(pattern),
        Some(last) => {
            last.lines == lines
                && last.pattern == pattern
                && (last.written, last.checked) < (written, checked)
                && last.wrong.count <= count
                && last.wrong.first.is_none_or(|word| first == Some(word))
        }
    };
    is_sound && goes_on
}
