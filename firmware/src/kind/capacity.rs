//! Families of container types (vector, map, array, candidate buffer) with a common capacity. On a board the
//! capacity is part of the types; in an emulator it is a runtime value.

use core::hash::Hash;

use heapless::Vec;
use heapless::index_map::FnvIndexMap;

use crate::photon::{CandidateBuffer, CandidateStorage};

/// A family of container types with a common capacity, the maximum number of entries.
///
/// The containers are associated types, so that a chip has one type parameter instead of one per container.
pub trait Capacity: 'static {
    /// A vector.
    type Buffer<T>: Buffer<T>;
    /// A hash map, whose capacity must be a power of two.
    type Map<K: Copy + Eq + Hash, V>: Map<K, V>;
    /// An array of fixed length, whose values exist from the start.
    type Array<T: Vacant>: Array<T>;
    /// A buffer of candidates of a photon search.
    type Candidates: CandidateStorage;
}

/// A family of containers whose capacity is part of their type.
pub trait FixedCapacity: Capacity {
    /// Maximum number of entries.
    const ENTRIES: usize;
}

/// Family of containers with the constant capacity `N`.
pub struct Entries<const N: usize>;

impl<const N: usize> Capacity for Entries<N> {
    type Buffer<T> = Vec<T, N>;
    type Map<K: Copy + Eq + Hash, V> = FnvIndexMap<K, V, N>;
    type Array<T: Vacant> = [T; N];
    type Candidates = CandidateBuffer<N>;
}

impl<const N: usize> FixedCapacity for Entries<N> {
    const ENTRIES: usize = N;
}

/// A vector of limited capacity.
pub trait Buffer<T> {
    /// Vector without values.
    const EMPTY: Self;

    /// Sets the capacity; has no effect if the type determines it.
    fn reserve(&mut self, _entries: usize) {}

    /// Maximum number of values.
    fn capacity(&self) -> usize;

    /// Values, read-only.
    fn values(&self) -> &[T];

    /// Values, mutable.
    fn values_mut(&mut self) -> &mut [T];

    /// Removes all values.
    fn clear(&mut self);

    /// Appends a value.
    ///
    /// # Errors
    /// The value itself if the vector is full.
    fn push(&mut self, value: T) -> Result<(), T>;

    /// Removes the last value and returns it; `None` if the vector is empty.
    fn pop(&mut self) -> Option<T>;

    /// Sets the number of values. Values that are added are clones of `value`. Returns false, and changes
    /// nothing, if the number exceeds the capacity.
    #[must_use]
    fn resize(&mut self, count: usize, value: T) -> bool
    where
        T: Clone;
}

impl<T, const N: usize> Buffer<T> for Vec<T, N> {
    const EMPTY: Self = Self::new();

    #[inline(always)]
    fn capacity(&self) -> usize {
        N
    }

    #[inline(always)]
    fn values(&self) -> &[T] {
        self
    }

    #[inline(always)]
    fn values_mut(&mut self) -> &mut [T] {
        self
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.as_mut_view().clear();
    }

    #[inline(always)]
    fn push(&mut self, value: T) -> Result<(), T> {
        self.as_mut_view().push(value)
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<T> {
        self.as_mut_view().pop()
    }

    #[inline(always)]
    fn resize(&mut self, count: usize, value: T) -> bool
    where
        T: Clone,
    {
        self.as_mut_view().resize(count, value).is_ok()
    }
}

/// A type with a constant initial value, by which large arrays are initialised in place.
pub trait Vacant {
    /// Value of an entry that is not in use.
    const VACANT: Self;
}

/// An array of values, all [`Vacant::VACANT`] at first.
pub trait Array<T> {
    /// Initial array. All values are [`Vacant::VACANT`]; their number may be 0 before [`Self::reserve`].
    const VACANT: Self;

    /// Sets the length; has no effect if the type determines it.
    fn reserve(&mut self, _entries: usize) {}

    /// Values, read-only.
    fn values(&self) -> &[T];

    /// Values, mutable.
    fn values_mut(&mut self) -> &mut [T];
}

impl<T: Vacant, const N: usize> Array<T> for [T; N] {
    const VACANT: Self = [T::VACANT; N];

    #[inline(always)]
    fn values(&self) -> &[T] {
        self
    }

    #[inline(always)]
    fn values_mut(&mut self) -> &mut [T] {
        self
    }
}

/// A hash map of fixed capacity that keeps the insertion order.
pub trait Map<K, V> {
    /// The map without entries.
    const EMPTY: Self;

    /// Sets the capacity; has no effect if the type determines it.
    fn reserve(&mut self, _entries: usize) {}

    /// Maximum number of entries.
    fn capacity(&self) -> usize;

    /// Number of entries.
    fn entries(&self) -> usize;

    /// Removes all entries.
    fn clear(&mut self);

    /// Value at `key`.
    fn get(&self, key: &K) -> Option<&V>;

    /// Key and value of entry number `index` in insertion order; `None` past the last entry.
    fn entry(&self, index: usize) -> Option<(&K, &V)>;

    /// Key and mutable value of entry number `index` in insertion order; `None` past the last entry.
    fn entry_mut(&mut self, index: usize) -> Option<(&K, &mut V)>;

    /// Appends an entry, or replaces the value at its key. Returns false if the map is full.
    #[must_use]
    fn insert(&mut self, key: K, value: V) -> bool;
}

impl<K: Eq + Hash, V, const N: usize> Map<K, V> for FnvIndexMap<K, V, N> {
    const EMPTY: Self = Self::new();

    #[inline(always)]
    fn capacity(&self) -> usize {
        N
    }

    #[inline(always)]
    fn entries(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.clear();
    }

    #[inline(always)]
    fn get(&self, key: &K) -> Option<&V> {
        self.get(key)
    }

    #[inline(always)]
    fn entry(&self, index: usize) -> Option<(&K, &V)> {
        self.get_index(index)
    }

    #[inline(always)]
    fn entry_mut(&mut self, index: usize) -> Option<(&K, &mut V)> {
        self.get_index_mut(index)
    }

    #[inline(always)]
    fn insert(&mut self, key: K, value: V) -> bool {
        self.insert(key, value).is_ok()
    }
}
