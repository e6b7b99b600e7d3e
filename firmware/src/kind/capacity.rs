//! Capacities as types. Each is a family of containers with a fixed number of entries.

use core::hash::Hash;

use heapless::index_map::FnvIndexMap;
use heapless::{Vec, VecView};

use crate::photon::{CandidateBuffer, CandidateStorage};

/// A number of entries, and the containers of that capacity.
///
/// It replaces a const generic parameter where the number follows from a [`ChipKind`](super::ChipKind). The
/// containers are associated types, so that a chip has one type parameter instead of one per container.
pub trait Capacity: 'static {
    /// Maximum number of entries.
    const ENTRIES: usize;
    /// A vector of up to [`Self::ENTRIES`] values.
    type Buffer<T>: Buffer<T>;
    /// A hash map of up to [`Self::ENTRIES`] values. The number must be a power of two.
    type Map<K: Eq + Hash, V>: Map<K, V>;
    /// An array of [`Self::ENTRIES`] values that always exist.
    type Array<T: Vacant>: Array<T>;
    /// A buffer of [`Self::ENTRIES`] candidates of a photon search.
    type Candidates: CandidateStorage;
}

/// Capacity of `N` entries.
pub struct Entries<const N: usize>;

impl<const N: usize> Capacity for Entries<N> {
    const ENTRIES: usize = N;
    type Buffer<T> = Vec<T, N>;
    type Map<K: Eq + Hash, V> = FnvIndexMap<K, V, N>;
    type Array<T: Vacant> = [T; N];
    type Candidates = CandidateBuffer<N>;
}

/// A vector of fixed capacity.
pub trait Buffer<T> {
    /// Vector without values.
    const EMPTY: Self;

    /// Values, read-only.
    fn view(&self) -> &VecView<T>;

    /// Values, mutable.
    fn view_mut(&mut self) -> &mut VecView<T>;
}

impl<T, const N: usize> Buffer<T> for Vec<T, N> {
    const EMPTY: Self = Self::new();

    #[inline(always)]
    fn view(&self) -> &VecView<T> {
        self.as_view()
    }

    #[inline(always)]
    fn view_mut(&mut self) -> &mut VecView<T> {
        self.as_mut_view()
    }
}

/// A large value that is initialised in place and never moved.
pub trait Vacant {
    /// Value that is not in use.
    const VACANT: Self;
}

/// An array of fixed length.
pub trait Array<T> {
    /// Array of values that are not in use.
    const VACANT: Self;

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

    /// Number of entries.
    fn entries(&self) -> usize;

    /// Removes all entries.
    fn clear(&mut self);

    /// Value at `key`.
    fn get(&self, key: &K) -> Option<&V>;

    /// Key and value at an index, in insertion order.
    fn entry(&self, index: usize) -> Option<(&K, &V)>;

    /// Key and mutable value at an index, in insertion order.
    fn entry_mut(&mut self, index: usize) -> Option<(&K, &mut V)>;

    /// Appends an entry, or replaces the value at its key. Returns false if the map is full.
    #[must_use]
    fn insert(&mut self, key: K, value: V) -> bool;
}

impl<K: Eq + Hash, V, const N: usize> Map<K, V> for FnvIndexMap<K, V, N> {
    const EMPTY: Self = Self::new();

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
