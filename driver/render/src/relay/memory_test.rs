//! One memory test from those of all cards of a relay.

use photoncard_shared::message::{MemoryPattern, MemoryTest, WrongWord, WrongWords};

/// Progress in the order of the test: number of the pattern, lines written, lines read back.
type Position = (usize, u32, u32);

/// Memory test of all cards. Its memory is as large as the largest of theirs, and it is as far as the card
/// that is least far. The wrong words of a pattern are stated at the pattern's end.
pub(super) struct MemoryTests {
    /// Last report of each card.
    latest: Vec<Option<MemoryTest>>,
    /// Wrong words of all cards for each pattern.
    wrong: [WrongWords; MemoryPattern::ALL.len()],
    told: Position,
}

impl MemoryTests {
    pub(super) fn new(cards: usize) -> Self {
        let wrong = [WrongWords::default(); MemoryPattern::ALL.len()];
        Self { latest: vec![None; cards], wrong, told: (0, 0, 0) }
    }

    /// Records a card's report.
    pub(super) fn take(&mut self, card: usize, report: MemoryTest) {
        if report.is_end_of_pattern()
            && let Some(wrong) = self.wrong.get_mut(report.pattern as usize)
        {
            *wrong = both(wrong, &report.wrong);
        }
        if let Some(latest) = self.latest.get_mut(card) {
            *latest = Some(report);
        }
    }

    /// Returns the next report to the host; `None` until the tests of all `cards` have come further.
    pub(super) fn next(&mut self, cards: impl Iterator<Item = usize> + Clone) -> Option<MemoryTest> {
        let report = |card: usize| self.latest.get(card).copied().flatten();
        let reports = cards.map(report).collect::<Option<Vec<_>>>()?;
        let lines = reports.iter().map(|report| report.lines).max()?;
        let (number, written, checked) = reports.iter().map(|report| position(report, lines)).min()?;
        let (told, ..) = self.told;
        let pattern = *MemoryPattern::ALL.get(told)?;
        if number > told {
            self.told = (told + 1, 0, 0);
            return Some(MemoryTest {
                lines,
                pattern,
                written: lines,
                checked: lines,
                wrong: self.wrong[told],
            });
        }
        if (number, written, checked) <= self.told {
            return None;
        }
        self.told = (number, written, checked);
        Some(MemoryTest { lines, pattern, written, checked, wrong: WrongWords::default() })
    }
}

/// Position of a card's test in a test of `lines` lines.
fn position(report: &MemoryTest, lines: u32) -> Position {
    let number = report.pattern as usize;
    if report.is_end_of_pattern() {
        return (number + 1, 0, 0);
    }
    let written = if report.written == report.lines { lines } else { report.written };
    (number, written, report.checked)
}

fn both(a: &WrongWords, b: &WrongWords) -> WrongWords {
    let first = [a.first, b.first].into_iter().flatten().min_by_key(|word: &WrongWord| word.index);
    WrongWords { count: a.count.saturating_add(b.count), bits: a.bits | b.bits, first }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_test_of_two_cards_tells_all_wrong_words_and_no_progress_twice() {
        let mut tests = MemoryTests::new(2);
        let word = |index| WrongWord { index, expected: 1, found: 0 };
        let report = |pattern: usize, lines, written, checked, wrong: Option<u32>| MemoryTest {
            lines,
            pattern: MemoryPattern::ALL[pattern],
            written,
            checked,
            wrong: WrongWords {
                count: wrong.map_or(0, |_| 1),
                bits: wrong.map_or(0, |_| 1),
                first: wrong.map(word),
            },
        };
        let mut told = Vec::new();
        for pattern in 0..MemoryPattern::ALL.len() {
            let large = [(4, 0, None), (9, 0, None), (9, 5, None), (9, 9, Some(70))];
            let small = [(3, 0, None), (3, 2, None), (3, 3, Some(9))];
            for (card, lines, steps) in [(0, 9, &large[..]), (1, 3, &small[..])] {
                for &(written, checked, wrong) in steps {
                    tests.take(card, report(pattern, lines, written, checked, wrong));
                    told.extend(std::iter::from_fn(|| tests.next(0..2)));
                }
            }
        }
        for pattern in 0..MemoryPattern::ALL.len() {
            let end = MemoryTest {
                wrong: WrongWords { count: 2, bits: 1, first: Some(word(9)) },
                ..report(pattern, 9, 9, 9, None)
            };
            let of_pattern: Vec<_> =
                told.iter().filter(|told| told.pattern == end.pattern).copied().collect();
            assert_eq!(of_pattern, [report(pattern, 9, 9, 0, None), report(pattern, 9, 9, 2, None), end]);
        }
        assert!(told.last().unwrap().is_over());
    }
}
