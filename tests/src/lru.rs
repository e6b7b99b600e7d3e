//! Set-associative LRU cache in its simplest form: the oracle for the firmware's caches.

/// A set-associative cache with least-recently-used replacement: for every set its blocks, the last used at
/// the end.
pub struct LruOracle {
    sets: Vec<Vec<u32>>,
    ways: usize,
    lines: u32,
    /// Function from a block to its set.
    set: Box<dyn Fn(u32) -> u32>,
}

impl LruOracle {
    /// An empty cache of `ways` blocks per set, each of `lines` lines of card memory, in the set that `set`
    /// gives.
    pub fn new(sets: u32, ways: u32, lines: u32, set: impl Fn(u32) -> u32 + 'static) -> Self {
        Self { sets: vec![Vec::new(); sets as usize], ways: ways as usize, lines, set: Box::new(set) }
    }

    /// Reads a line: returns whether it hits, and brings its block into the cache if it misses.
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
