//! Set-associative caches of lines with LRU replacement.
//!
//! [`LineCaches`] serves two purposes. On a board with slow DRAM, it keeps lines in on-chip memory. Around a
//! [`super::Counted`], it simulates the fetches of a chip with caches of the given shape. The cached data are
//! used in both cases, so that simulated hits are hits by construction, and a wrong line would show in the
//! picture.

use core::fmt;
use core::ops::Range;

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, FaultCode};

use super::{CardMemory, MemoryPort, Stage, Work, outside};
use crate::sampler::hash;

/// Mapping from the index of a block to its set in the cache. A block is a part of card memory as long as a
/// cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SetIndex {
    /// Index modulo the number of sets.
    #[default]
    Modulo,
    /// Hash of the index.
    Hashed,
}

/// Shape of a cache: size, line size, associativity and set index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CacheShape {
    sets: u32,
    ways: u32,
    /// Number of card memory lines per cache line.
    lines: u32,
    index: SetIndex,
}

/// Invalid parameter of a [`CacheShape`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ShapeError {
    /// The cache line is not a whole number of card memory lines, or larger than
    /// [`CacheShape::MAX_LINE_BYTES`].
    LineBytes,
    /// The number of ways is 0 or above the number of cache lines.
    Ways,
    /// The size is 0, not a whole number of sets, or above [`CacheShape::MAX_BYTES`].
    Bytes,
}

impl fmt::Display for ShapeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::LineBytes => {
                "the lines of the cache are no whole number of card memory lines, or too large"
            }
            Self::Ways => "the cache has no ways, or more than lines",
            Self::Bytes => "the cache is empty, no whole number of sets, or too large",
        })
    }
}

impl core::error::Error for ShapeError {}

impl CacheShape {
    /// Maximum size of a cache, bytes.
    pub const MAX_BYTES: u32 = 64 << 20;
    /// Maximum size of a cache line, bytes.
    pub const MAX_LINE_BYTES: u32 = 4096;

    /// Shape of a cache of `bytes` bytes with cache lines of `line_bytes` bytes and `ways` ways per set.
    ///
    /// # Errors
    /// The first invalid parameter.
    pub const fn new(bytes: u32, line_bytes: u32, ways: u32, index: SetIndex) -> Result<Self, ShapeError> {
        let lines = line_bytes / LINE_BYTES as u32;
        if lines == 0 || !line_bytes.is_multiple_of(LINE_BYTES as u32) || line_bytes > Self::MAX_LINE_BYTES {
            return Err(ShapeError::LineBytes);
        }
        if bytes == 0 || bytes > Self::MAX_BYTES || !bytes.is_multiple_of(line_bytes) {
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

    /// Number of cache lines. Each has a [`CacheEntry`].
    pub const fn entries(&self) -> usize {
        self.sets as usize * self.ways as usize
    }

    /// Capacity of the cache, in lines of card memory.
    pub const fn lines(&self) -> usize {
        self.entries() * self.lines as usize
    }

    /// Set of a block. A block is an aligned run of card memory lines that fills one cache line.
    #[inline(always)]
    pub fn set(&self, block: u32) -> u32 {
        match self.index {
            SetIndex::Modulo => block % self.sets,
            SetIndex::Hashed => ((hash(block) as u64 * self.sets as u64) >> 32) as u32,
        }
    }

    /// Indices of the cache entries in a block's set.
    #[inline(always)]
    fn entries_of(&self, block: u32) -> Range<usize> {
        let first = self.set(block) as usize * self.ways as usize;
        first..first + self.ways as usize
    }
}

/// Tag of a cache line: the block that it holds.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CacheEntry {
    /// Index of the block in card memory; [`NOTHING`] for an empty cache line.
    block: u32,
    /// Index of the cache line that holds the block.
    slot: u32,
}

/// Block number of an empty entry. No cache line ever holds that block.
const NOTHING: u32 = u32::MAX;

impl CacheEntry {
    /// Tag of an empty cache line.
    pub const EMPTY: Self = Self { block: NOTHING, slot: 0 };
}

/// Set-associative cache with LRU replacement. The caller provides its buffers, [`CacheShape::entries`] tags
/// and [`CacheShape::lines`] lines: arrays on a board, vectors on a host.
pub struct LineCache<E, L> {
    shape: CacheShape,
    /// Tags by set; within a set, from the most to the least recently used.
    entries: E,
    lines: L,
    /// True if the cache is known to be empty. The thousands of writes that load a card image then need not
    /// invalidate lines.
    is_clear: bool,
    /// Number of lines of the memory. It becomes known when a cache line that extends past the end of the
    /// memory is filled; `u32::MAX` before.
    end: u32,
}

impl<E: AsRef<[CacheEntry]> + AsMut<[CacheEntry]>, L: AsRef<[Line]> + AsMut<[Line]>> LineCache<E, L> {
    /// Creates an empty cache; `None` if the buffers do not have the sizes of the shape.
    pub fn new(shape: CacheShape, entries: E, lines: L) -> Option<Self> {
        let fits = entries.as_ref().len() == shape.entries() && lines.as_ref().len() == shape.lines();
        let mut cache = Self { shape, entries, lines, is_clear: false, end: u32::MAX };
        cache.clear();
        fits.then_some(cache)
    }

    /// Invalidates all lines.
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

    /// Invalidates the cache lines that hold lines in `written`.
    fn forget(&mut self, written: &Range<u32>) {
        // A cache line at the end of a memory that grows is incomplete.
        if written.end > self.end {
            self.clear();
        }
        if self.is_clear {
            return;
        }
        for block in written.start / self.shape.lines..written.end.div_ceil(self.shape.lines) {
            let set = self.entries.as_mut().get_mut(self.shape.entries_of(block)).unwrap_or_default();
            set.iter_mut().filter(|entry| entry.block == block).for_each(|entry| entry.block = NOTHING);
        }
    }

    /// Reads a line from the cache, after filling it from `memory` on a miss.
    #[inline(always)]
    fn read(
        &mut self,
        memory: &mut impl MemoryPort,
        structure: Structure,
        address: LineAddress,
    ) -> Result<&Line, Fault> {
        // Line 2^32 - 1 is never read, as its block may be NOTHING.
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
        // LRU: the tag moves to the front of its set, or replaces the last.
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

/// Fills a cache line with a block. Returns the first line of the block that is outside the memory, if any.
///
/// # Errors
/// If the line at `address` is outside the memory, or the memory's device fails at any line of the block.
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
            Err(fault) if fault.code != FaultCode::LineRange => return Err(fault),
            Err(_) if number > address.0 => return Ok(Some(number)),
            // A line before `address` is outside the memory, so `address` is too.
            Err(fault) => return Err(Fault { detail: address.0, ..fault }),
        }
    }
    Ok(None)
}

/// A memory behind caches: one for the photon maps and one for the scene, or one for both. A tile that begins
/// while no other is in flight finds empty caches, so that its misses do not depend on earlier tiles.
///
/// While gathers wait in card memory, a cache for everything may take their place: a larger one for each kind
/// of [`Work`], in the memory that the work leaves free. All caches are empty when another work begins.
pub struct LineCaches<M, E, L> {
    memory: M,
    /// Cache of the photon maps; of everything if there is no cache of the scene.
    first: LineCache<E, L>,
    scene: Option<LineCache<E, L>>,
    by_work: Option<CachesByWork<E, L>>,
    work: Option<Work>,
}

struct CachesByWork<E, L> {
    casting: LineCache<E, L>,
    gathering: LineCache<E, L>,
}

impl<M, E, L> LineCaches<M, E, L> {
    /// Memory behind one cache for the photon maps and one for the scene.
    pub const fn new(memory: M, photon_map: LineCache<E, L>, scene: LineCache<E, L>) -> Self {
        Self { memory, first: photon_map, scene: Some(scene), by_work: None, work: None }
    }

    /// Memory behind one cache for everything.
    pub const fn unified(memory: M, cache: LineCache<E, L>) -> Self {
        Self { memory, first: cache, scene: None, by_work: None, work: None }
    }

    /// Adds the caches for everything of a chip whose gathers wait in card memory: while it casts rays, and
    /// while it does gathers.
    #[must_use]
    pub fn with_work(self, casting: LineCache<E, L>, gathering: LineCache<E, L>) -> Self {
        Self { by_work: Some(CachesByWork { casting, gathering }), ..self }
    }

    fn caches(&mut self) -> impl Iterator<Item = &mut LineCache<E, L>> {
        let by_work = self.by_work.iter_mut().flat_map(|caches| [&mut caches.casting, &mut caches.gathering]);
        [&mut self.first].into_iter().chain(&mut self.scene).chain(by_work)
    }

    /// Memory behind the caches.
    pub fn below(&self) -> &M {
        &self.memory
    }

    /// Memory behind the caches, mutable.
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
        if matches!(structure, Structure::IrradianceRecords | Structure::Waiting) {
            // Each of these lines is read once, and would evict lines that are read again.
            self.memory.missed(structure);
            return self.memory.read(structure, address, 0..LINE_BYTES as u32);
        }
        let cache = match (&mut self.by_work, self.work, &mut self.scene) {
            (Some(caches), Some(Work::Casting), _) => &mut caches.casting,
            (Some(caches), Some(Work::Gathering), _) => &mut caches.gathering,
            (_, _, Some(scene)) if !structure.is_photon_map() => scene,
            _ => &mut self.first,
        };
        cache.read(&mut self.memory, structure, address)
    }

    fn write(&mut self, structure: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.memory.write(structure, first, lines)?;
        let written = first.0..first.0.saturating_add(lines.len() as u32);
        self.caches().for_each(|cache| cache.forget(&written));
        Some(())
    }

    #[inline(always)]
    fn enter(&mut self, stage: Stage) {
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.work = None;
        self.caches().for_each(LineCache::clear);
        self.memory.begin_tile();
    }

    fn begin_work(&mut self, work: Work) {
        self.work = Some(work);
        self.caches().for_each(LineCache::clear);
        self.memory.begin_work(work);
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

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.memory.stored(first, count)
    }

    fn known_checksum(&self, lines: u32) -> Option<u64> {
        self.memory.known_checksum(lines)
    }

    fn resident_lines(&self) -> u32 {
        self.memory.resident_lines()
    }

    fn failure(&self) -> Option<Fault> {
        self.memory.failure()
    }
}
