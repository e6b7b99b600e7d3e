//! Links that damage bytes at random, as determined by a seed.

use std::collections::VecDeque;

use photoncard_firmware::sampler::hash;

/// Random numbers of a seed.
pub(crate) struct Random(pub(crate) u32);

impl Random {
    /// A number from 0 to below `end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        hash(self.0) as usize % end
    }

    pub(crate) fn happens(&mut self, per_million: usize) -> bool {
        per_million > 0 && self.below(1_000_000) < per_million
    }
}

/// Rates of faults: of lines per million bytes, of cards per million steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Faults {
    pub(crate) flips: usize,
    pub(crate) drops: usize,
    pub(crate) repeats: usize,
    pub(crate) stalls: usize,
    pub(crate) resets: usize,
    pub(crate) deaths: usize,
}

impl Faults {
    /// Random faults, frequent or rare.
    pub(crate) fn of(random: &mut Random) -> Self {
        let rates = [0, 1, 10, 100, 1000];
        let lines = |random: &mut Random| rates[random.below(rates.len())];
        let [flips, drops, repeats] = [lines(random), lines(random), lines(random)];
        let cards = |random: &mut Random, most: usize| [0, 0, 1, most][random.below(4)];
        Self {
            flips,
            drops,
            repeats,
            stalls: cards(random, 10),
            resets: cards(random, 20),
            deaths: cards(random, 2),
        }
    }
}

/// One direction of a link: a queue of small capacity, which may damage bytes.
pub(crate) struct Queue {
    pub(crate) bytes: VecDeque<u8>,
    capacity: usize,
}

impl Queue {
    pub(crate) fn new(random: &mut Random) -> Self {
        // From one byte to more than a frame.
        Self { bytes: VecDeque::new(), capacity: 1 << random.below(13) }
    }

    pub(crate) fn of(capacity: usize) -> Self {
        Self { bytes: VecDeque::new(), capacity }
    }

    /// Appends the first of `bytes`, at most `most`. Returns their number.
    pub(crate) fn push(&mut self, bytes: &[u8], most: usize, faults: &Faults, random: &mut Random) -> usize {
        let count = bytes.len().min(most).min(self.capacity.saturating_sub(self.bytes.len()));
        for &byte in &bytes[..count] {
            if random.happens(faults.drops) {
                continue;
            }
            let byte = if random.happens(faults.flips) { byte ^ 1 << random.below(8) } else { byte };
            let copies = 1 + usize::from(random.happens(faults.repeats));
            self.bytes.extend(std::iter::repeat_n(byte, copies));
        }
        count
    }

    /// Removes and returns the first bytes, at most `most`.
    pub(crate) fn pop(&mut self, most: usize) -> Vec<u8> {
        self.bytes.drain(..most.min(self.bytes.len())).collect()
    }
}
