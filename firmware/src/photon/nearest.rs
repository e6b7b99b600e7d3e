//! Collector of the k nearest photons from a stream of candidates.
//!
//! A buffer collects more than k candidates. When it is full, the k nearest are selected in linear time, and
//! the search radius shrinks to the k-th distance. This is cheaper than a heap, which every candidate would
//! update. The resulting set does not depend on the order of the stream, because photon contents break ties
//! between equal distances.

use photoncard_shared::budget::selected_candidates;

use super::candidates::{Candidate, Candidates};
use super::collector::{Collector, Lanes};
use super::select::{Chosen, select};
use crate::simd::{Isa, LANES};
use crate::vector::sqrt;

/// Factor by which the squared radius grows when a search is repeated.
const WIDER: f32 = 3.0;

/// The nearest photons found so far, in a borrowed buffer.
pub struct NearestPhotons<'a> {
    candidates: Candidates<'a>,
    length: usize,
    neighbors: usize,
    /// Number of candidates at which all but the k nearest are dropped.
    full: usize,
    limit: f32,
    /// Squared search radius without narrowing, m^2.
    widest: f32,
    is_narrowed: bool,
    max_distance_squared: f32,
    /// Number of candidates read by selections.
    selected: u32,
    /// Number of comparisons of distances by selections.
    compared: u32,
    /// Number of candidates dropped by selections.
    dropped: u32,
}

impl<'a> NearestPhotons<'a> {
    /// Creates an empty set for the k = `neighbors` nearest photons within `max_distance`, metres. The
    /// capacity of `candidates` should be [`photoncard_shared::budget::gather_candidates`]. k is at most the
    /// capacity minus `LANES + 1`.
    pub fn new(candidates: Candidates<'a>, neighbors: u32, max_distance: f32) -> Self {
        let room = candidates.capacity().saturating_sub(LANES);
        let neighbors = (neighbors as usize).clamp(1, room.saturating_sub(1).max(1));
        // The conversion is exact: `neighbors` came from 32 bits and has not grown.
        let full = selected_candidates(neighbors as u32).min(room);
        let limit = max_distance * max_distance;
        Self {
            candidates,
            length: 0,
            neighbors,
            full,
            limit,
            widest: limit,
            is_narrowed: false,
            max_distance_squared: limit,
            selected: 0,
            compared: 0,
            dropped: 0,
        }
    }

    /// Limits the squared search radius to `limit`, m^2, beyond which the search accepts no photons. Must be
    /// called before candidates are added. [`Self::max_distance_squared`] does not change.
    pub(super) fn limit_to(&mut self, limit: f32) {
        self.widest = if limit < self.widest { limit } else { self.widest };
        self.limit = if self.widest < self.limit { self.widest } else { self.limit };
    }

    /// Narrows the squared search radius to `limit`, m^2, an estimate of a radius that contains k photons.
    /// Only the first call has an effect, and only before candidates are added.
    #[inline(always)]
    pub(super) fn narrow_to(&mut self, limit: f32) {
        // False for NaN.
        if limit > 0.0 && !self.is_narrowed && self.length == 0 {
            self.is_narrowed = true;
            self.limit = if limit < self.limit { limit } else { self.limit };
        }
    }

    /// If a narrowed search has found fewer than k photons, drops all candidates, enlarges the search radius
    /// and returns true. The search must then be repeated.
    #[inline(always)]
    pub(super) fn widen(&mut self) -> bool {
        let is_short = self.is_narrowed && !self.is_full() && self.limit < self.widest;
        if is_short {
            self.dropped += self.length as u32;
            self.length = 0;
            let limit = WIDER * self.limit;
            self.limit = if limit < self.widest { limit } else { self.widest };
        }
        is_short
    }

    /// Squared search radius, m^2. Photons beyond it cannot be among the nearest.
    #[inline(always)]
    pub fn limit(&self) -> f32 {
        self.limit
    }

    /// Adds a candidate. Its distance must be within [`Self::limit`].
    #[inline(always)]
    pub(super) fn insert(&mut self, isa: impl Isa, candidate: Candidate) {
        self.candidates.set(self.length, candidate);
        self.length += 1;
        if self.length >= self.full {
            self.select(isa);
        }
    }

    #[inline(always)]
    fn select(&mut self, isa: impl Isa) {
        if self.length <= self.neighbors {
            return;
        }
        self.selected += self.length as u32;
        self.dropped += (self.length - self.neighbors) as u32;
        let chosen = select(isa, self.candidates.reborrow(), self.length, self.neighbors);
        if let Some(Chosen { last, compared }) = chosen {
            self.limit = last.distance_squared();
            self.compared += compared;
        }
        self.length = self.neighbors;
    }

    /// Ends the search: drops all candidates but the k nearest, which are unordered.
    #[inline(always)]
    pub(super) fn finish(&mut self, isa: impl Isa) {
        self.select(isa);
    }

    /// Squared distances of all candidates, as bits, and their contents.
    #[inline(always)]
    pub(super) fn columns(&self) -> (&[u32], &[u64]) {
        let Candidates { distances, contents } = &self.candidates;
        (distances.get(..self.length).unwrap_or_default(), contents.get(..self.length).unwrap_or_default())
    }

    /// All candidates; after the end of the search, the nearest photons.
    #[inline(always)]
    pub fn candidates(&self) -> impl Iterator<Item = Candidate> {
        let (distances, contents) = self.columns();
        distances.iter().zip(contents).map(|(&distance, &content)| Candidate { distance, content })
    }

    /// Number of candidates; after the end of the search, of the nearest photons.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.length
    }

    /// Returns true if there are no candidates.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Number of candidates added so far, dropped ones included.
    pub fn taken(&self) -> u32 {
        self.dropped + self.length as u32
    }

    /// Number of candidates read by selections so far, and number of comparisons of distances.
    pub fn selections(&self) -> [u32; 2] {
        [self.selected, self.compared]
    }

    /// Returns true if there are at least k candidates.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.length >= self.neighbors
    }

    /// Distance of the k-th nearest photon, metres, after the end of the search; the maximum distance if
    /// there are fewer than k photons.
    pub fn radius(&self) -> f32 {
        let (distances, _) = self.columns();
        let farthest = distances.iter().copied().max().filter(|_| self.is_full());
        sqrt(farthest.map_or(self.max_distance_squared, f32::from_bits))
    }

    /// Square of the maximum distance given to [`Self::new`], m^2.
    #[inline(always)]
    pub fn max_distance_squared(&self) -> f32 {
        self.max_distance_squared
    }
}

impl Collector for NearestPhotons<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn narrow(&mut self, photon_share: f32) {
        self.narrow_to(photon_share * self.neighbors as f32);
    }

    #[inline(always)]
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, lanes: &Lanes) {
        let Lanes { distances, contents, .. } = *lanes;
        // No overflow: the bits of infinity are below `u32::MAX`.
        let mask = isa.below(distances, self.limit.to_bits() + 1) & !(u32::MAX << count);
        let Candidates { distances: all_distances, contents: all_contents } = &mut self.candidates;
        // There is room: a selection starts while LANES elements are free.
        let free = all_distances.get_mut(self.length..).and_then(<[u32]>::first_chunk_mut);
        let Some(free) = free else { return };
        isa.pack(mask, distances, free);
        let free = all_contents.get_mut(self.length..).and_then(<[u64]>::first_chunk_mut);
        let Some(free) = free else { return };
        isa.pack_long(mask, contents, free);
        self.length += mask.count_ones() as usize;
        if self.length >= self.full {
            self.select(isa);
        }
    }
}
