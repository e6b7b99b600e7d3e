//! Kind of emulated chips. Its capacities are run-time values, so that one copy of the chip's code serves
//! chips of all capacities.

use std::collections::HashMap;
use std::hash::{BuildHasher, Hash, Hasher};

use photoncard_firmware::chip::Chip;
use photoncard_firmware::kind::{Array, Buffer, Capacity, ChipKind, FixedCapacity, FixedKind, Map, Vacant};
use photoncard_firmware::photon::{CandidateStorage, Candidates};
use photoncard_shared::budget::Budget;
use serde::{Deserialize, Serialize};

/// Kind of chip whose buffers are on the heap. The fields state their sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Emulated {
    pub(super) budget: Budget,
    /// Number of gather points whose rays are cast together.
    pub(super) points: usize,
}

impl Emulated {
    /// Kind with the capacities of the kind `K`.
    pub fn like<K: FixedKind>() -> Self {
        Self { budget: K::BUDGET, points: K::Points::ENTRIES }
    }

    /// Replaces the budget by `budget`, which must be in the ranges that the indices of a chip allow. The
    /// number of gather points does not change.
    #[must_use]
    pub fn with_budget(self, budget: Budget) -> Self {
        Self { budget, ..self }
    }

    /// Replaces the memory of the chip's card by `bytes`, at most
    /// [`MAX_DRAM_BYTES`](photoncard_shared::budget::MAX_DRAM_BYTES).
    #[must_use]
    pub fn with_memory(self, bytes: u64) -> Self {
        let budget = Budget { dram_bytes: bytes, ..self.budget };
        self.with_budget(budget)
    }

    /// Creates a chip of this kind.
    pub fn chip(self) -> EmulatedChip {
        Chip::sized(self, self.points)
    }
}

/// Chip of an emulated kind.
pub type EmulatedChip = Chip<Emulated>;

impl ChipKind for Emulated {
    type TilePixels = Heap;
    type Candidates = Heap;
    type GatherQueue = Heap;
    type Buckets = Heap;
    type WaitingBlocks = Heap;
    type IrradianceRecords = Heap;
    type Points = Heap;
    type Flights = Heap;

    fn budget(&self) -> &Budget {
        &self.budget
    }
}

/// Family of containers on the heap, whose capacities are set at run time.
#[derive(Clone, Copy, Debug)]
pub enum Heap {}

impl Capacity for Heap {
    type Buffer<T> = HeapBuffer<T>;
    type Map<K: Copy + Eq + Hash, V> = HeapMap<K, V>;
    type Array<T: Vacant> = HeapArray<T>;
    type Candidates = HeapCandidates;
}

/// Vector that never grows beyond its reserved entries.
#[derive(Debug)]
pub struct HeapBuffer<T> {
    values: Vec<T>,
    entries: usize,
}

impl<T> Buffer<T> for HeapBuffer<T> {
    const EMPTY: Self = Self { values: Vec::new(), entries: 0 };

    fn reserve(&mut self, entries: usize) {
        self.values.reserve_exact(entries);
        self.entries = entries;
    }

    #[inline(always)]
    fn capacity(&self) -> usize {
        self.entries
    }

    #[inline(always)]
    fn values(&self) -> &[T] {
        &self.values
    }

    #[inline(always)]
    fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.values.clear();
    }

    #[inline(always)]
    fn push(&mut self, value: T) -> Result<(), T> {
        if self.values.len() == self.entries {
            return Err(value);
        }
        self.values.push(value);
        Ok(())
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<T> {
        self.values.pop()
    }

    #[inline(always)]
    fn resize(&mut self, count: usize, value: T) -> bool
    where
        T: Clone,
    {
        let fits = count <= self.entries;
        if fits {
            self.values.resize(count, value);
        }
        fits
    }
}

/// Array on the heap, whose length is set once.
#[derive(Debug)]
pub struct HeapArray<T>(Vec<T>);

impl<T: Vacant> Array<T> for HeapArray<T> {
    const VACANT: Self = Self(Vec::new());

    fn reserve(&mut self, entries: usize) {
        self.0.resize_with(entries, || T::VACANT);
    }

    #[inline(always)]
    fn values(&self) -> &[T] {
        &self.0
    }

    #[inline(always)]
    fn values_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

/// Map that keeps the order of insertion, and never grows beyond its reserved entries.
#[derive(Debug)]
pub struct HeapMap<K, V> {
    entries: Vec<(K, V)>,
    places: HashMap<K, usize, Fnv>,
    capacity: usize,
}

impl<K: Copy + Eq + Hash, V> Map<K, V> for HeapMap<K, V> {
    const EMPTY: Self = Self { entries: Vec::new(), places: HashMap::with_hasher(Fnv), capacity: 0 };

    fn reserve(&mut self, entries: usize) {
        self.entries.reserve_exact(entries);
        self.places.reserve(entries);
        self.capacity = entries;
    }

    #[inline(always)]
    fn capacity(&self) -> usize {
        self.capacity
    }

    #[inline(always)]
    fn entries(&self) -> usize {
        self.entries.len()
    }

    fn clear(&mut self) {
        self.entries.clear();
        self.places.clear();
    }

    #[inline(always)]
    fn get(&self, key: &K) -> Option<&V> {
        self.places.get(key).map(|&place| &self.entries[place].1)
    }

    #[inline(always)]
    fn entry(&self, index: usize) -> Option<(&K, &V)> {
        self.entries.get(index).map(|(key, value)| (key, value))
    }

    #[inline(always)]
    fn entry_mut(&mut self, index: usize) -> Option<(&K, &mut V)> {
        self.entries.get_mut(index).map(|(key, value)| (&*key, value))
    }

    fn insert(&mut self, key: K, value: V) -> bool {
        if let Some(&place) = self.places.get(&key) {
            self.entries[place].1 = value;
            return true;
        }
        let fits = self.entries.len() < self.capacity;
        if fits {
            self.places.insert(key, self.entries.len());
            self.entries.push((key, value));
        }
        fits
    }
}

/// The hash function FNV-1a, with 64 bits. Maps on boards are hashed by FNV-1a too.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fnv;

/// State of [`Fnv`].
#[derive(Debug)]
pub(super) struct FnvState(u64);

impl BuildHasher for Fnv {
    type Hasher = FnvState;

    #[inline(always)]
    fn build_hasher(&self) -> FnvState {
        FnvState(0xcbf2_9ce4_8422_2325)
    }
}

impl Hasher for FnvState {
    #[inline(always)]
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    #[inline(always)]
    fn finish(&self) -> u64 {
        self.0
    }
}

/// Squared distances and contents of the photons that are candidates of a photon search.
#[derive(Debug)]
pub struct HeapCandidates {
    distances: Vec<u32>,
    contents: Vec<u64>,
}

impl CandidateStorage for HeapCandidates {
    const EMPTY: Self = Self { distances: Vec::new(), contents: Vec::new() };

    fn reserve(&mut self, entries: usize) {
        self.distances.resize(entries, 0);
        self.contents.resize(entries, 0);
    }

    #[inline(always)]
    fn view(&mut self) -> Candidates<'_> {
        Candidates::new(&mut self.distances, &mut self.contents)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn containers_never_exceed_their_reserved_entries() {
        let mut buffer = HeapBuffer::EMPTY;
        assert_eq!((buffer.push(1), buffer.capacity()), (Err(1), 0));
        buffer.reserve(2);
        assert_eq!([buffer.push(1), buffer.push(2), buffer.push(3)], [Ok(()), Ok(()), Err(3)]);
        assert!(!buffer.resize(3, 0) && buffer.values() == [1, 2]);
        assert!(buffer.resize(1, 0) && buffer.pop() == Some(1) && buffer.pop().is_none());

        let mut map = HeapMap::EMPTY;
        assert!(!map.insert("a", 1));
        map.reserve(2);
        assert!(map.insert("b", 1) && map.insert("a", 2) && map.insert("b", 3) && !map.insert("c", 4));
        assert_eq!([map.entry(0), map.entry(1), map.entry(2)], [Some((&"b", &3)), Some((&"a", &2)), None]);
        assert_eq!([map.get(&"a"), map.get(&"c")], [Some(&2), None]);
        map.clear();
        assert!(map.entries() == 0 && map.get(&"a").is_none() && map.insert("c", 4));
    }
}
