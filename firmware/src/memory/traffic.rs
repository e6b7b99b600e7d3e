//! Memory traffic by stage of rendering and structure.

use photoncard_shared::address::{STAGES, STRUCTURES, Stage, Structure};

/// Reads of one structure in one stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reads {
    /// Number of reads.
    pub requests: u64,
    /// Number of bytes used by the chip.
    pub bytes: u64,
    /// Number of misses of the cache between the chip and this memory; 0 without a cache.
    pub misses: u64,
}

impl Reads {
    const ZERO: Self = Self { requests: 0, bytes: 0, misses: 0 };

    fn add(&mut self, other: &Self) {
        self.requests += other.requests;
        self.bytes += other.bytes;
        self.misses += other.misses;
    }
}

/// Traffic of a memory: reads by stage and structure, and bytes written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Traffic {
    reads: [[Reads; STRUCTURES]; STAGES],
    /// Number of bytes written of each structure.
    written: [u64; STRUCTURES],
}

impl Traffic {
    /// Traffic without reads and writes.
    pub const ZERO: Self = Self { reads: [[Reads::ZERO; STRUCTURES]; STAGES], written: [0; STRUCTURES] };

    /// Adds the traffic of another memory.
    pub fn add(&mut self, other: &Self) {
        let pairs = self.reads.as_flattened_mut().iter_mut().zip(other.reads.as_flattened());
        pairs.for_each(|(reads, other)| reads.add(other));
        self.written.iter_mut().zip(other.written).for_each(|(written, other)| *written += other);
    }

    /// Counts one read.
    #[inline(always)]
    #[expect(clippy::indexing_slicing, reason = "stages and structures number the rows and columns")]
    pub(super) fn count(&mut self, stage: Stage, structure: Structure, bytes: u32) {
        let reads = &mut self.reads[stage as usize][structure as usize];
        reads.requests += 1;
        reads.bytes += bytes as u64;
    }

    /// Counts written bytes.
    #[expect(clippy::indexing_slicing, reason = "structures number the elements")]
    pub(super) fn count_written(&mut self, structure: Structure, bytes: u64) {
        self.written[structure as usize] += bytes;
    }

    /// Number of bytes written of the structures for which `chosen` returns true.
    pub fn written_bytes(&self, chosen: impl Fn(Structure) -> bool) -> u64 {
        let of_structures = Structure::ALL.into_iter().zip(self.written);
        of_structures.filter(|&(structure, _)| chosen(structure)).map(|(_, bytes)| bytes).sum()
    }

    /// Counts a miss of the cache between the chip and this memory.
    #[inline(always)]
    #[expect(clippy::indexing_slicing, reason = "stages and structures number the rows and columns")]
    pub(super) fn count_miss(&mut self, stage: Stage, structure: Structure) {
        self.reads[stage as usize][structure as usize].misses += 1;
    }

    /// Reads of a structure in a stage.
    #[expect(clippy::indexing_slicing, reason = "stages and structures number the rows and columns")]
    pub fn reads(&self, stage: Stage, structure: Structure) -> Reads {
        self.reads[stage as usize][structure as usize]
    }

    /// Sum of the reads of structures for which `chosen` returns true, over the stages of tiles: all but
    /// [`Stage::Begin`].
    pub fn of_tiles(&self, chosen: impl Fn(Structure) -> bool) -> Reads {
        self.sum(|stage, structure| stage != Stage::Begin && chosen(structure))
    }

    /// Sum of the reads over all pairs of stage and structure for which `chosen` returns true.
    pub fn sum(&self, chosen: impl Fn(Stage, Structure) -> bool) -> Reads {
        let mut sum = Reads::ZERO;
        for stage in Stage::ALL {
            let structures = Structure::ALL.into_iter().filter(|&structure| chosen(stage, structure));
            structures.for_each(|structure| sum.add(&self.reads(stage, structure)));
        }
        sum
    }
}
