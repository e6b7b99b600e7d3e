//! Set-associative LRU cache in its simplest form: the oracle for the firmware's caches.

/// Set-associative cache with least-recently-used replacement. A set lists its blocks in the order of their
/// last use, the most recent one at the end.
pub struct LruOracle {
    sets: Vec<Vec<u32>>,
    ways: usize,
    lines: u32,
    /// Index of a block's set.
    set: Box<dyn Fn(u32) -> u32>,
}

impl LruOracle {
    /// Creates an empty cache of `sets` sets with `ways` blocks each. A block has `lines` lines of card
    /// memory; `set` returns the index of a block's set.
    pub fn new(sets: u32, ways: u32, lines: u32, set: impl Fn(u32) -> u32 + 'static) -> Self {
        Self { sets: vec![Vec::new(); sets as usize], ways: ways as usize, lines, set: Box::new(set) }
    }

    /// Reads a line, and returns whether its block was in the cache. If not, the block enters the cache.
    ///
    /// # Panics
    /// If `set` returns an index of no set.
    pub fn hits(&mut self, line: u32) -> bool {
        let block = line / self.lines;
        let set = &mut self.sets[(self.set)(block) as usize];
        let held = set.iter().position(|&held| held == block);
        match held {
            Some(place) => {
                set.remove(place);
            }
            None if set.len() == self.ways => {
                set.remove(0);
            }
            None => {}
        }
        set.push(block);
        held.is_some()
    }
}
