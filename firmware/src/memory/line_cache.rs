//! Set-associative caches of lines, the least recently used of a set first out.
//!
//! One type for both uses: on a board whose DRAM is slow a cache holds the lines in on-chip memory; under a
//! [`super::Counted`] it tells how many lines a chip of that shape would fetch. It holds the data in either case, so the
//! hits are the same by construction, and a wrong line would be a wrong picture.

use core::ops::Range;

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::Fault;

use super::{CardMemory, MemoryPort, Stage, outside};
use crate::sampler::hash;

/// How a line finds its set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SetIndex {
    /// The remainder of its number by the number of sets.
    #[default]
    Modulo,
    /// A hash of its number.
    Hashed,
}

/// The shape of a cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheShape {
    sets: u32,
    ways: u32,
    /// Lines of card memory in a line of the cache.
    lines: u32,
    index: SetIndex,
}

/// Why there is no cache of some shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeError {
    /// A cache's line is one or several whole lines of card memory, up to [`CacheShape::MOST_LINE_BYTES`].
    LineBytes,
    /// The number of ways is not from 1 to the cache's lines.
    Ways,
    /// The size is no whole number of sets, or larger than [`CacheShape::MOST_BYTES`].
    Bytes,
}

impl CacheShape {
    /// The largest cache.
    pub const MOST_BYTES: u32 = 64 << 20;
    /// The largest line of a cache.
    pub const MOST_LINE_BYTES: u32 = 4096;

    /// A cache of `bytes` in lines of `line_bytes`, `ways` to a set.
    ///
    /// # Errors
    /// If there is none.
    pub const fn new(bytes: u32, line_bytes: u32, ways: u32, index: SetIndex) -> Result<Self, ShapeError> {
        let lines = line_bytes / LINE_BYTES as u32;
        if lines == 0 || !line_bytes.is_multiple_of(LINE_BYTES as u32) || line_bytes > Self::MOST_LINE_BYTES {
            return Err(ShapeError::LineBytes);
        }
        if bytes == 0 || bytes > Self::MOST_BYTES || !bytes.is_multiple_of(line_bytes) {
            return Err(ShapeError::Bytes);
        }
        let entries = bytes / line_bytes;
        if ways == 0 || ways > entries {
            return Err(ShapeError::Ways);
        }
        if !entries.is_multiple_of(ways) {
            return Err(ShapeError::Bytes);
        }
        Ok(Self { sets: entries / ways, ways, lines, index })
    }

    /// Lines of the cache, each with an entry.
    pub const fn entries(&self) -> usize {
        self.sets as usize * self.ways as usize
    }

    /// Lines of card memory that it holds.
    pub const fn lines(&self) -> usize {
        self.entries() * self.lines as usize
    }

    /// The set of a block: of the lines of card memory from `block` times those in a line of the cache on.
    #[inline(always)]
    pub fn set(&self, block: u32) -> u32 {
        match self.index {
            SetIndex::Modulo => block % self.sets,
            SetIndex::Hashed => ((hash(block) as u64 * self.sets as u64) >> 32) as u32,
        }
    }

    /// The entries of the set of a block.
    #[inline(always)]
    fn entries_of(&self, block: u32) -> Range<usize> {
        let first = self.set(block) as usize * self.ways as usize;
        first..first + self.ways as usize
    }
}

/// What a cache knows of one of its lines.
#[derive(Clone, Copy, Debug)]
pub struct CacheEntry {
    /// Number of the line of the cache's size in card memory.
    block: u32,
    /// Where the cache keeps it.
    slot: u32,
}

/// No block that is held has this number.
const NOTHING: u32 = u32::MAX;

impl CacheEntry {
    /// The entry of a line that is not there.
    pub const EMPTY: Self = Self { block: NOTHING, slot: 0 };
}

/// A cache in buffers of someone's: one [`CacheEntry`] and [`CacheShape::lines`] over [`CacheShape::entries`] lines for
/// each of its lines. Arrays on a board, vectors on a host.
pub struct LineCache<E, L> {
    shape: CacheShape,
    /// By set; the most recently used of a set first.
    entries: E,
    lines: L,
    /// Whether it is known to hold nothing: an image is loaded in thousands of writes, each of which clears it.
    is_clear: bool,
    /// The first line that was found to be outside the memory, while a line of the cache before it was filled.
    end: u32,
}

impl<E: AsRef<[CacheEntry]> + AsMut<[CacheEntry]>, L: AsRef<[Line]> + AsMut<[Line]>> LineCache<E, L> {
    /// An empty cache; `None` if the buffers are not of the shape's size.
    pub fn new(shape: CacheShape, entries: E, lines: L) -> Option<Self> {
        let fits = entries.as_ref().len() == shape.entries() && lines.as_ref().len() == shape.lines();
        let mut cache = Self { shape, entries, lines, is_clear: false, end: u32::MAX };
        cache.clear();
        fits.then_some(cache)
    }

    /// Forgets all lines.
    pub fn clear(&mut self) {
        if self.is_clear {
            return;
        }
        for (slot, entry) in (0..).zip(self.entries.as_mut()) {
            *entry = CacheEntry { block: NOTHING, slot };
        }
        self.is_clear = true;
        self.end = u32::MAX;
    }

    /// The line at an address; what is not there is read from `memory`.
    #[inline(always)]
    fn read(
        &mut self,
        memory: &mut impl MemoryPort,
        structure: Structure,
        address: LineAddress,
    ) -> Result<&Line, Fault> {
        // The last line of 2^32 is not used: its block may be NOTHING.
        if address.0 >= self.end {
            return Err(outside(address));
        }
        let block = address.0 / self.shape.lines;
        let set = self.entries.as_mut().get_mut(self.shape.entries_of(block));
        let set = set.ok_or_else(|| outside(address))?;
        let way = set.iter().position(|entry| entry.block == block);
        let recent = match way {
            Some(way) => set.get_mut(..=way),
            None => Some(set),
        };
        // The used line comes first, or takes the place of the last.
        if let Some(recent) = recent {
            recent.rotate_right(1);
            if let Some(entry) = recent.first_mut() {
                let first = entry.slot as usize * self.shape.lines as usize;
                let held = first..first + self.shape.lines as usize;
                let lines = self.lines.as_mut().get_mut(held).ok_or_else(|| outside(address))?;
                if way.is_none() {
                    entry.block = NOTHING;
                    let end = fill(lines, memory, structure, address, block)?;
                    entry.block = block;
                    if let Some(end) = end {
                        self.end = end;
                    }
                    self.is_clear = false;
                    memory.missed(structure);
                }
                let line = lines.get((address.0 % self.shape.lines) as usize);
                return line.ok_or_else(|| outside(address));
            }
        }
        Err(outside(address))
    }
}

/// Reads a block of lines. Those after the one at `address` may be outside the memory: returns the first that is.
#[inline(always)]
fn fill(
    lines: &mut [Line],
    memory: &mut impl MemoryPort,
    structure: Structure,
    address: LineAddress,
    block: u32,
) -> Result<Option<u32>, Fault> {
    let first = block * lines.len() as u32;
    for (number, line) in (first..=u32::MAX).zip(lines) {
        match memory.read(structure, LineAddress(number), 0..LINE_BYTES as u32) {
            Ok(read) => *line = *read,
            Err(_) if number > address.0 => return Ok(Some(number)),
            // Memory ends once: the line asked for comes after one that is not there.
            Err(fault) => return Err(Fault { detail: address.0, ..fault }),
        }
    }
    Ok(None)
}

/// A memory behind caches: one for the photon map and one for the scene, or one for both. Every tile begins with empty
/// caches, so that what it reads does not depend on the tile before it.
pub struct LineCaches<M, E, L> {
    memory: M,
    /// Of the photon map; without a second one of all.
    first: LineCache<E, L>,
    scene: Option<LineCache<E, L>>,
}

impl<M, E, L> LineCaches<M, E, L> {
    /// A memory behind a cache of the photon map and one of the scene.
    pub const fn new(memory: M, photon_map: LineCache<E, L>, scene: LineCache<E, L>) -> Self {
        Self { memory, first: photon_map, scene: Some(scene) }
    }

    /// A memory behind one cache.
    pub const fn unified(memory: M, cache: LineCache<E, L>) -> Self {
        Self { memory, first: cache, scene: None }
    }

    /// The memory below.
    pub fn below(&self) -> &M {
        &self.memory
    }

    /// The memory below, to be changed.
    pub fn below_mut(&mut self) -> &mut M {
        &mut self.memory
    }
}

impl<M: MemoryPort, E, L> MemoryPort for LineCaches<M, E, L>
where
    E: AsRef<[CacheEntry]> + AsMut<[CacheEntry]>,
    L: AsRef<[Line]> + AsMut<[Line]>,
{
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        let cache = match &mut self.scene {
            Some(scene) if !structure.is_photon_map() => scene,
            _ => &mut self.first,
        };
        cache.read(&mut self.memory, structure, address)
    }

    #[inline(always)]
    fn enter(&mut self, stage: Stage) {
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.first.clear();
        if let Some(scene) = &mut self.scene {
            scene.clear();
        }
        self.memory.begin_tile();
    }
}

impl<M: CardMemory, E, L> CardMemory for LineCaches<M, E, L>
where
    E: AsRef<[CacheEntry]> + AsMut<[CacheEntry]>,
    L: AsRef<[Line]> + AsMut<[Line]>,
{
    fn lines(&self) -> u32 {
        self.memory.lines()
    }

    fn stored(&self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.memory.stored(first, count)
    }

    fn write(&mut self, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        // Lines are written while an image is loaded, between tiles: nothing held may outlive it.
        self.begin_tile();
        self.memory.write(first, lines)
    }
}
