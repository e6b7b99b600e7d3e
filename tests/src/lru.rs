//! A cache written down as its definition reads, slow and plain: what the firmware's are compared with.

/// A cache as its definition reads: for every set the blocks it holds, the one used last at the end.
pub struct LruOracle {
    sets: Vec<Vec<u32>>,
    ways: usize,
    lines: u32,
    /// The set of a block.
    set: Box<dyn Fn(u32) -> u32>,
}

impl LruOracle {
    /// A cache that holds nothing: `ways` lines to a set, each of `lines` of card memory, in the set that `set` gives.
    pub fn new(sets: u32, ways: u32, lines: u32, set: impl Fn(u32) -> u32 + 'static) -> Self {
        Self { sets: vec![Vec::new(); sets as usize], ways: ways as usize, lines, set: Box::new(set) }
    }

    /// Whether a line is there; it is from now on.
    ///
    /// # Panics
    /// If there is no such set.
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
