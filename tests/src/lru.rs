//! Set-associative LRU cache in its simplest form, the oracle for the firmware's caches.

/// Set-associative cache with least-recently-used replacement. The blocks of a set are listed with the last
/// used at the end.
pub struct LruOracle {
    sets: Vec<Vec<u32>>,
    ways: usize,
    lines: u32,
    /// Maps a block to its set.
    set: Box<dyn Fn(u32) -> u32>,
}

impl LruOracle {
    /// Creates an empty cache with `ways` blocks per set. A block has `lines` lines of card memory; `set`
    /// maps it to its set.
    pub fn new(sets: u32, ways: u32, lines: u32, set: impl Fn(u32) -> u32 + 'static) -> Self {
        Self { sets: vec![Vec::new(); sets as usize], ways: ways as usize, lines, set: Box::new(set) }
    }

    /// Reads a line and returns whether it hits. On a miss its block enters the cache.
    ///
    /// # Panics
    /// If `set` gives no valid set.
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
