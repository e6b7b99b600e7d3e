//! The k nearest of a stream of candidates.
//!
//! Instead of a heap, which reorders itself for every candidate, candidates collect in a buffer of twice k; when it is
//! full, the k nearest are selected in linear time and the search radius shrinks to the k-th. The result is a set,
//! independent of the order of the stream: equal distances are told apart by the photon's index.

use heapless::VecView;
use photoncard_shared::layout::{Photon, Rgbe};

/// A photon near a query, with all that its reflection needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The squared distance's bits above the photon's index: the order of candidates.
    key: u64,
    /// The record's bytes from the power on.
    content: [u8; 8],
}

impl Candidate {
    /// The photon of this index and record at a squared distance, m^2, that is not negative.
    #[inline(always)]
    pub fn new(distance_squared: f32, index: u32, record: &[u8; 20]) -> Self {
        // The bits of non-negative floats are in the order of their values.
        let key = (distance_squared.to_bits() as u64) << 32 | index as u64;
        let [.., a, b, c, d, e, f, g, h] = *record;
        Self { key, content: [a, b, c, d, e, f, g, h] }
    }

    /// The order of candidates: by distance, then by index.
    #[inline(always)]
    pub fn key(&self) -> u64 {
        self.key
    }

    /// Squared distance from the query, m^2.
    #[inline(always)]
    pub fn distance_squared(&self) -> f32 {
        f32::from_bits((self.key >> 32) as u32)
    }

    /// Index of the photon.
    #[inline(always)]
    pub fn index(&self) -> u32 {
        self.key as u32
    }

    /// The photon's power, in photon power units.
    #[inline(always)]
    pub fn power(&self) -> Rgbe {
        let [r, g, b, e, ..] = self.content;
        Rgbe([r, g, b, e])
    }

    /// Code of the direction the photon came from.
    #[inline(always)]
    pub fn direction(&self) -> [u8; 2] {
        [self.content[4], self.content[5]]
    }

    #[inline(always)]
    fn flags(&self) -> u16 {
        u16::from_le_bytes([self.content[6], self.content[7]])
    }

    /// Code of the surface normal at the photon.
    #[inline(always)]
    pub fn normal(&self) -> u8 {
        Photon::normal_of_flags(self.flags())
    }

    /// Code of the photon's disc fraction.
    #[inline(always)]
    pub fn disc(&self) -> u8 {
        Photon::disc_of_flags(self.flags())
    }

    /// Whether the photon came straight from an emitter.
    #[inline(always)]
    pub fn is_direct(&self) -> bool {
        Photon::direct_of_flags(self.flags())
    }
}

/// The nearest photons found so far, in a buffer that someone else owns.
pub struct NearestPhotons<'a> {
    candidates: &'a mut VecView<Candidate>,
    neighbors: usize,
    /// Selection waits until so many candidates are there.
    full: usize,
    limit: f32,
    max_distance_squared: f32,
}

impl<'a> NearestPhotons<'a> {
    /// An empty set for up to `neighbors` photons within `max_distance`, metres. A buffer of twice as many candidates
    /// serves best; `neighbors` above the buffer's capacity less one are cut to that.
    pub fn new(candidates: &'a mut VecView<Candidate>, neighbors: u32, max_distance: f32) -> Self {
        candidates.clear();
        let capacity = candidates.capacity();
        let neighbors = (neighbors as usize).clamp(1, capacity.saturating_sub(1).max(1));
        let full = (2 * neighbors).min(capacity);
        let limit = max_distance * max_distance;
        Self { candidates, neighbors, full, limit, max_distance_squared: limit }
    }

    /// The squared distance beyond which a photon cannot be among the nearest, m^2.
    #[inline(always)]
    pub fn limit(&self) -> f32 {
        self.limit
    }

    /// Takes a candidate that is not beyond the limit.
    #[inline(always)]
    pub fn insert(&mut self, candidate: Candidate) {
        // There is room: a full buffer was cut to `neighbors`, fewer than its capacity.
        let _ = self.candidates.push(candidate);
        if self.candidates.len() >= self.full {
            self.select();
        }
    }

    #[cold]
    #[inline(never)]
    fn select(&mut self) {
        let candidates = self.candidates.as_mut_slice();
        if candidates.len() <= self.neighbors {
            return;
        }
        let (_, last, _) = candidates.select_nth_unstable_by_key(self.neighbors - 1, Candidate::key);
        self.limit = last.distance_squared();
        self.candidates.truncate(self.neighbors);
    }

    /// Ends the search: leaves the nearest photons, in no order.
    pub fn finish(&mut self) {
        self.select();
    }

    /// The candidates; after [`Self::finish`] the nearest photons.
    #[inline(always)]
    pub fn candidates(&self) -> &[Candidate] {
        self.candidates.as_slice()
    }

    /// Whether there are as many as were asked for.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.candidates.len() >= self.neighbors
    }

    /// The square of the greatest distance asked for, m^2.
    #[inline(always)]
    pub fn max_distance_squared(&self) -> f32 {
        self.max_distance_squared
    }
}
