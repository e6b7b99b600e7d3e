//! Test of card memory with several patterns: their times and wrong words.

use std::time::Duration;

use photoncard_cards::session::Event;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::link::Port;
use photoncard_shared::message::{MemoryPattern, MemoryTest, WrongWords};

use super::bench::Bench;
use crate::Phase;
use crate::greeting::GreetingError;

/// Result of the test of a memory with one pattern.
#[derive(Clone, Copy, Debug)]
pub struct PatternTest {
    /// The pattern.
    pub pattern: MemoryPattern,
    /// Time to write the pattern over the whole memory, measured by the host.
    pub write: Duration,
    /// Time to read the pattern back, measured by the host.
    pub check: Duration,
    /// Words whose value differs from the written one.
    pub wrong: WrongWords,
}

/// Runs the test of card memory. Returns the number of lines of the memory, and the result for each pattern.
pub(super) fn test<P: Port>(bench: &mut Bench<P>) -> Result<(u32, Vec<PatternTest>), GreetingError> {
    let mut patterns = Vec::new();
    bench.session.test_memory(bench.now());
    let mut before = bench.now();
    let mut write = Duration::ZERO;
    loop {
        let Event::MemoryTested(progress) = bench.next_event()? else { continue };
        let (done, total) = bytes(&progress);
        bench.observer.progress(Phase::SelfTest, done, total);
        let now = bench.now();
        if progress.written == progress.lines && progress.checked == 0 {
            write = now - std::mem::replace(&mut before, now);
        }
        if progress.is_end_of_pattern() {
            let check = now - std::mem::replace(&mut before, now);
            patterns.push(PatternTest { pattern: progress.pattern, write, check, wrong: progress.wrong });
        }
        if progress.is_over() {
            return Ok((progress.lines, patterns));
        }
    }
}

/// Number of bytes written or read so far, and total number in the whole test.
fn bytes(progress: &MemoryTest) -> (u64, u64) {
    let MemoryTest { lines, pattern, written, checked, .. } = *progress;
    let [lines, written, checked] = [lines, written, checked].map(u64::from);
    let done = pattern as u64 * 2 * lines + written + checked;
    let total = MemoryPattern::ALL.len() as u64 * 2 * lines;
    (done * LINE_BYTES as u64, total * LINE_BYTES as u64)
}
