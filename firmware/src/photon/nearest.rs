//! The k nearest of a stream of candidates.
//!
//! Instead of a heap, which reorders itself for every candidate, candidates collect in a buffer of more than k; when it is
//! full, the k nearest are selected in linear time and the search radius shrinks to the k-th. The result is a set,
//! independent of the order of the stream: equal distances are told apart by what the photons carry.

use photoncard_shared::budget::selected_candidates;

use super::candidates::{Candidate, Candidates};
use super::collector::Collector;
use super::select::select;
use crate::simd::{Isa, LANES};

/// The nearest photons found so far, in a buffer that someone else owns.
pub struct NearestPhotons<'a> {
    candidates: Candidates<'a>,
    length: usize,
    neighbors: usize,
    /// Selection waits until so many candidates are there.
    full: usize,
    limit: f32,
    max_distance_squared: f32,
    /// Candidates that selections went through, and that they dropped.
    selected: u32,
    dropped: u32,
}

impl<'a> NearestPhotons<'a> {
    /// An empty set for up to `neighbors` photons within `max_distance`, metres. A buffer of
    /// [`photoncard_shared::budget::gather_candidates`] serves best; `neighbors` are cut to the buffer's capacity without
    /// [`LANES`] and one more.
    pub fn new(candidates: Candidates<'a>, neighbors: u32, max_distance: f32) -> Self {
        let room = candidates.capacity().saturating_sub(LANES);
        let neighbors = (neighbors as usize).clamp(1, room.saturating_sub(1).max(1));
        // No cut: it is what was given in 32 bits, or less.
        let full = selected_candidates(neighbors as u32).min(room);
        let limit = max_distance * max_distance;
        Self {
            candidates,
            length: 0,
            neighbors,
            full,
            limit,
            max_distance_squared: limit,
            selected: 0,
            dropped: 0,
        }
    }

    /// The squared distance beyond which a photon cannot be among the nearest, m^2.
    #[inline(always)]
    pub fn limit(&self) -> f32 {
        self.limit
    }

    /// Takes a candidate that is not beyond the limit.
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
        if let Some(last) = select(isa, self.candidates.reborrow(), self.length, self.neighbors) {
            self.limit = last.distance_squared();
        }
        self.length = self.neighbors;
    }

    /// Ends the search: leaves the nearest photons, in no order.
    #[inline(always)]
    pub(super) fn finish(&mut self, isa: impl Isa) {
        self.select(isa);
    }

    /// The squared distances' bits of all candidates, and what they carry.
    #[inline(always)]
    pub(super) fn columns(&self) -> (&[u32], &[u64]) {
        let Candidates { distances, contents } = &self.candidates;
        (distances.get(..self.length).unwrap_or_default(), contents.get(..self.length).unwrap_or_default())
    }

    /// The candidates; after a search the nearest photons.
    #[inline(always)]
    pub fn candidates(&self) -> impl Iterator<Item = Candidate> {
        let (distances, contents) = self.columns();
        distances.iter().zip(contents).map(|(&distance, &content)| Candidate { distance, content })
    }

    /// How many there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.length
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Candidates that were taken so far.
    pub fn taken(&self) -> u32 {
        self.dropped + self.length as u32
    }

    /// Candidates that selections went through so far.
    pub fn selected(&self) -> u32 {
        self.selected
    }

    /// Whether there are as many as were asked for.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.length >= self.neighbors
    }

    /// The square of the greatest distance asked for, m^2.
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
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, distances: &[u32; LANES], contents: &[u64; LANES]) {
        // No overflow: the bits of an infinite limit are not the greatest.
        let mask = isa.below(distances, self.limit.to_bits() + 1) & !(u32::MAX << count);
        let Candidates { distances: all_distances, contents: all_contents } = &mut self.candidates;
        // There is room: a selection leaves more free than are tested at once.
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
