//! Reuse of cache lines: distances between reads of one line, and the classes of misses that follow from
//! them.
//!
//! The reuse distance of a read is the number of other lines that were read through the same cache since the
//! last read of its line: the stack distance of R. Mattson et al. (1970), counted by the method of B. Bennett
//! and V. Kruskal (1975), in `O(log n)`. Misses are classified after M. Hill and A. Smith, "Evaluating
//! Associativity in CPU Caches" (1989): the first read of a line is *compulsory*; a read whose distance is as
//! large as the cache, so that a fully associative one with LRU replacement misses too, is of *capacity*; the
//! other misses are *conflicts*. A set-associative cache may hit what a fully associative one misses:
//! conflicts are a difference, which may be negative.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use photoncard_firmware::memory::{CardMemory, MemoryPort, Stage, Work};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, STRUCTURES, Structure};
use photoncard_shared::message::Fault;
use serde::{Deserialize, Serialize};

use super::memory_model::{CacheSettings, CacheSpec, MeasuredMemory, MemoryTraffic};
use super::trace::TraceFile;

/// Number of bins of a histogram: distance 0, and distances of 1 to 32 bits.
pub const BINS: usize = 33;

/// Reads of one structure through its cache, by reuse distance in lines of the cache.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReuseCounts {
    /// First reads of a line since the cache was emptied.
    pub compulsory: u64,
    /// Other reads that miss in a fully associative cache of equal size with LRU replacement.
    pub capacity: u64,
    /// Misses of the cache.
    pub misses: u64,
    /// Number of reads by distance, compulsory ones left out: bin 0 has the distance 0, bin `b` the distances
    /// from `2^(b - 1)` to `2^b - 1`. Bins at the end without reads are left out.
    pub distances: Vec<u64>,
}

impl ReuseCounts {
    /// Number of misses that are neither compulsory nor of capacity. It is negative if the cache hits more
    /// often than a fully associative one.
    pub fn conflict(&self) -> i64 {
        self.misses as i64 - self.compulsory as i64 - self.capacity as i64
    }

    /// Smallest and largest distance in a bin.
    pub fn bin(bin: usize) -> [u64; 2] {
        if bin == 0 { [0; 2] } else { [1 << (bin - 1), (1 << bin) - 1] }
    }

    fn count(&mut self, distance: Option<u64>, lines: u64) {
        let Some(distance) = distance else {
            self.compulsory += 1;
            return;
        };
        self.capacity += u64::from(distance >= lines);
        let bin = (u64::BITS - distance.leading_zeros()) as usize;
        if self.distances.len() <= bin {
            self.distances.resize(bin + 1, 0);
        }
        self.distances[bin] += 1;
    }
}

/// Counts of each structure, in the order of [`Structure::ALL`].
pub type Reuse = [ReuseCounts; STRUCTURES];

/// Counts that a memory delivers when it is dropped.
#[derive(Clone, Debug, Default)]
pub(super) struct Delivered(Arc<Mutex<Reuse>>);

impl Delivered {
    /// Takes the counts. `traffic` is the traffic of the same memory, which has the numbers of misses.
    pub(super) fn take(&self, traffic: &MemoryTraffic) -> Reuse {
        let mut reuse = std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        for (structure, counts) in Structure::ALL.into_iter().zip(&mut reuse) {
            let [_, fetched] = traffic.of(|other| other == structure && is_cached(other));
            counts.misses = fetched.misses;
        }
        reuse
    }
}

/// Returns whether reads of a structure go through a cache.
fn is_cached(structure: Structure) -> bool {
    !matches!(structure, Structure::IrradianceRecords | Structure::Waiting)
}

/// Memory that counts the reuse of lines in the caches below it.
pub(super) struct Reused<M> {
    memory: M,
    photon: LruStack,
    /// Stack of the scene's cache; `None` if one cache holds everything.
    scene: Option<LruStack>,
    /// Stacks of the caches by work, if there are any: casting, gathering.
    by_work: Option<[LruStack; 2]>,
    work: Option<Work>,
    counts: Reuse,
    stage: Stage,
    delivered: Delivered,
}

impl<M> Reused<M> {
    /// Wraps `memory`, which has the caches `caches`.
    pub(super) fn new(memory: M, caches: &CacheSettings, delivered: Delivered) -> Self {
        let (photon, scene, by_work) = match caches {
            CacheSettings::Split { photon, scene, by_work } => {
                (photon, Some(LruStack::new(scene)), by_work.as_ref())
            }
            CacheSettings::Unified(both) => (both, None, None),
        };
        Self {
            memory,
            photon: LruStack::new(photon),
            scene,
            by_work: by_work.map(|caches| [&caches.casting, &caches.gathering].map(LruStack::new)),
            work: None,
            counts: Reuse::default(),
            stage: Stage::Begin,
            delivered,
        }
    }

    fn clear(&mut self) {
        let by_work = self.by_work.iter_mut().flatten();
        [&mut self.photon].into_iter().chain(&mut self.scene).chain(by_work).for_each(LruStack::clear);
    }

    #[inline(always)]
    fn note(&mut self, structure: Structure, address: LineAddress) {
        if !is_cached(structure) {
            return;
        }
        let stack = match (&mut self.by_work, self.work, &mut self.scene) {
            (Some([casting, _]), Some(Work::Casting), _) => casting,
            (Some([_, gathering]), Some(Work::Gathering), _) => gathering,
            (_, _, Some(scene)) if !structure.is_photon_map() => scene,
            _ => &mut self.photon,
        };
        let distance = stack.read(address);
        if self.stage != Stage::Begin {
            self.counts[structure as usize].count(distance, stack.lines);
        }
    }
}

impl<M> Drop for Reused<M> {
    fn drop(&mut self) {
        *self.delivered.0.lock().unwrap_or_else(PoisonError::into_inner) = std::mem::take(&mut self.counts);
    }
}

impl<M: MemoryPort> MemoryPort for Reused<M> {
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        self.note(structure, address);
        self.memory.read(structure, address, used)
    }

    fn write(&mut self, structure: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.memory.write(structure, first, lines)
    }

    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.work = None;
        self.clear();
        self.memory.begin_tile();
    }

    fn begin_work(&mut self, work: Work) {
        self.work = Some(work);
        self.clear();
        self.memory.begin_work(work);
    }

    fn end_tile(&mut self, tile: u32) {
        self.memory.end_tile(tile);
    }
}

impl<M: MeasuredMemory> MeasuredMemory for Reused<M> {
    fn traffic(&self) -> MemoryTraffic {
        self.memory.traffic()
    }

    fn take_trace(&mut self) -> Option<TraceFile> {
        self.memory.take_trace()
    }
}

impl<M: CardMemory> CardMemory for Reused<M> {
    fn lines(&self) -> u32 {
        self.memory.lines()
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.memory.stored(first, count)
    }

    fn known_checksum(&self, lines: u32) -> Option<u64> {
        self.memory.known_checksum(lines)
    }
}

/// Lines of a cache in the order of their last reads.
struct LruStack {
    /// Capacity of the cache, in its own lines.
    lines: u64,
    /// Lines of card memory in a line of the cache.
    width: u32,
    /// Time of the last read of each line of the cache.
    last: HashMap<u32, usize>,
    /// For each time, whether it is that of the last read of a line: a Fenwick tree of sums, whose first
    /// element is not used.
    marks: Vec<u32>,
    /// Next time.
    now: usize,
}

/// Smallest number of times between two compactions.
const LEAST_TIMES: usize = 1024;

impl LruStack {
    fn new(cache: &CacheSpec) -> Self {
        let CacheSpec { bytes, line_bytes, .. } = *cache;
        Self {
            lines: u64::from(bytes / line_bytes),
            width: line_bytes / LINE_BYTES as u32,
            last: HashMap::new(),
            marks: vec![0; LEAST_TIMES + 1],
            now: 0,
        }
    }

    fn clear(&mut self) {
        self.last.clear();
        self.marks.clear();
        self.marks.resize(LEAST_TIMES + 1, 0);
        self.now = 0;
    }

    /// Reads a line of card memory. Returns the number of other lines of the cache that were read since the
    /// last read of its line; `None` at the first read.
    fn read(&mut self, address: LineAddress) -> Option<u64> {
        if self.now + 1 == self.marks.len() {
            self.compact();
        }
        let time = self.now;
        self.now += 1;
        let before = self.last.insert(address.0 / self.width, time);
        let distance = before.map(|before| {
            let since = self.last.len() as u64 - self.marked_until(before);
            self.mark(before, u32::MAX);
            since
        });
        self.mark(time, 1);
        distance
    }

    /// Adds to the mark of a time; `u32::MAX` subtracts 1.
    fn mark(&mut self, time: usize, change: u32) {
        let mut index = time + 1;
        while let Some(sum) = self.marks.get_mut(index) {
            *sum = sum.wrapping_add(change);
            index += index & index.wrapping_neg();
        }
    }

    /// Number of marks at times up to `time`.
    fn marked_until(&self, time: usize) -> u64 {
        let mut index = time + 1;
        let mut sum = 0;
        while index > 0 {
            sum += u64::from(self.marks[index]);
            index &= index - 1;
        }
        sum
    }

    /// Renumbers the times, so that those of last reads come first.
    fn compact(&mut self) {
        let mut lines: Vec<_> = self.last.iter().map(|(&line, &time)| (time, line)).collect();
        lines.sort_unstable();
        self.marks.clear();
        self.marks.resize((2 * lines.len()).max(LEAST_TIMES) + 1, 0);
        self.now = lines.len();
        for (time, (_, line)) in lines.into_iter().enumerate() {
            self.last.insert(line, time);
            self.mark(time, 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::memory::{Lines, SetIndex};
    use proptest::prelude::{ProptestConfig, any, prop, prop_assert_eq, proptest};

    use super::*;

    fn cache(bytes: u32, line_bytes: u32, ways: u32) -> CacheSpec {
        CacheSpec { bytes, line_bytes, ways, index: SetIndex::Modulo }
    }

    /// List of lines from the most to the least recently read, as a cache without a bound keeps it.
    #[derive(Default)]
    struct Naive(Vec<u32>);

    impl Naive {
        fn read(&mut self, line: u32) -> Option<u64> {
            let place = self.0.iter().position(|&other| other == line);
            if let Some(place) = place {
                self.0.remove(place);
            }
            self.0.insert(0, line);
            place.map(|place| place as u64)
        }
    }

    /// Counts of reads of photons through one cache.
    fn counted(reads: &[u32], cache: CacheSpec) -> ReuseCounts {
        let lines = [Line::ZERO; 64];
        let (delivered, caches) = (Delivered::default(), CacheSettings::Unified(cache));
        let mut memory = Reused::new(caches.over(Lines(&lines)), &caches, delivered.clone());
        memory.begin_tile();
        memory.enter(Stage::Gather);
        for &line in reads {
            memory.read(Structure::Photons, LineAddress(line), 0..1).unwrap();
        }
        let traffic = memory.traffic();
        drop(memory);
        delivered.take(&traffic)[Structure::Photons as usize].clone()
    }

    #[test]
    fn two_lines_of_one_set_conflict_in_a_cache_that_could_hold_both() {
        // Lines 0 and 4 share a set of the four sets of one way.
        let reads = [0, 4, 0, 4, 0, 4];
        let direct = counted(&reads, cache(512, 128, 1));
        assert_eq!((direct.compulsory, direct.capacity, direct.conflict()), (2, 0, 4));
        assert_eq!(direct.distances, [0, 4]);
        let associative = counted(&reads, cache(512, 128, 4));
        assert_eq!((associative.compulsory, associative.capacity, associative.conflict()), (2, 0, 0));
    }

    #[test]
    fn a_loop_over_more_lines_than_the_cache_has_misses_by_capacity() {
        let reads: Vec<_> = (0..5).chain(0..5).chain(0..5).collect();
        let counts = counted(&reads, cache(512, 128, 4));
        assert_eq!((counts.compulsory, counts.capacity, counts.conflict()), (5, 10, 0));
        assert_eq!(counts.distances, [0, 0, 0, 10]);
        // A cache of one way keeps lines 1 to 3, for which no other line competes.
        assert_eq!(counted(&reads, cache(512, 128, 1)).conflict(), -6);
    }

    #[test]
    fn caches_of_scene_and_photon_map_are_apart_and_emptied_with_a_tile() {
        let lines = [Line::ZERO; 8];
        let (delivered, caches) = (Delivered::default(), CacheSettings::default());
        let mut memory = Reused::new(caches.over(Lines(&lines)), &caches, delivered.clone());
        for _ in 0..2 {
            memory.begin_tile();
            memory.enter(Stage::Gather);
            for (structure, line) in [(Structure::Photons, 0), (Structure::Nodes, 1), (Structure::Photons, 0)]
            {
                memory.read(structure, LineAddress(line), 0..1).unwrap();
            }
            memory.read(Structure::Waiting, LineAddress(2), 0..1).unwrap();
        }
        let traffic = memory.traffic();
        drop(memory);
        let reuse = delivered.take(&traffic);
        let photons = &reuse[Structure::Photons as usize];
        assert_eq!((photons.compulsory, photons.misses, photons.distances.as_slice()), (2, 2, &[2][..]));
        assert_eq!(reuse[Structure::Nodes as usize].compulsory, 2);
        assert_eq!(reuse[Structure::Waiting as usize], ReuseCounts::default());
    }

    #[test]
    fn bins_are_adjacent_and_cover_all_distances() {
        let mut next = 0;
        for bin in 0..BINS {
            let [least, most] = ReuseCounts::bin(bin);
            assert_eq!(least, next);
            let mut counts = ReuseCounts::default();
            counts.count(Some(least), u64::MAX);
            counts.count(Some(most), u64::MAX);
            assert_eq!(counts.distances[bin], 2);
            next = most + 1;
        }
        assert!(next > u64::from(u32::MAX));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// Distances are those of a list, also where times are renumbered; the fully associative cache of the
        /// model misses what is compulsory or of capacity, and nothing else.
        #[test]
        fn distances_and_misses_are_those_of_a_list(
            reads in prop::collection::vec((0..64_u32, any::<bool>()), 1..400),
            exponent in 0..6_u32,
            wide in any::<bool>(),
        ) {
            let line_bytes = if wide { 256 } else { 128 };
            let lines = 1 << exponent;
            let spec = cache(lines * line_bytes, line_bytes, lines);
            // Half of the reads are near each other.
            let reads: Vec<_> = reads.into_iter().map(|(line, near)| if near { line % 8 } else { line }).collect();
            let (mut naive, mut expected, mut stack) = (Naive::default(), ReuseCounts::default(), LruStack::new(&spec));
            for repeat in 0..8 {
                for &line in &reads {
                    let distance = naive.read(line / (line_bytes / 128));
                    prop_assert_eq!(stack.read(LineAddress(line)), distance);
                    if repeat == 0 {
                        expected.count(distance, u64::from(lines));
                    }
                }
            }
            let counts = counted(&reads, spec);
            expected.misses = expected.compulsory + expected.capacity;
            prop_assert_eq!(counts, expected);
        }
    }
}
