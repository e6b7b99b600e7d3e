//! Pseudo-random numbers as a function of target, seed and input number: `SplitMix64` (Steele, Lea, Flood
//! 2014).

/// Sequence of pseudo-random numbers.
pub struct Random(u64);

const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

impl Random {
    /// Creates the sequence of input `number` of a target.
    pub fn new(target: &str, seed: u64, number: u64) -> Self {
        let mut random = Self(0);
        for part in target.bytes().map(u64::from).chain([seed, number]) {
            random.0 ^= part;
            random.0 = random.next();
        }
        random
    }

    /// Next number of the sequence.
    #[expect(clippy::should_implement_trait, reason = "a sequence without an end")]
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        let mut value = self.0;
        value = (value ^ value >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        value = (value ^ value >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        value ^ value >> 31
    }

    /// Pseudo-random number below `limit`; 0 for a limit of 0.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % (limit.max(1) as u64)) as usize
    }

    /// Returns true with probability `1 / n`.
    pub fn once_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// Pseudo-random item of a non-empty list.
    pub fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }

    /// Number of edits of an input, 1 to 8: n has the probability `2^-n`, and 8 the rest.
    pub fn edits(&mut self) -> u32 {
        1 + self.next().trailing_zeros().min(7)
    }
}
