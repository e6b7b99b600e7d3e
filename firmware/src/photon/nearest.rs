//! The k nearest of a stream of candidates.
//!
//! Instead of a heap, which reorders itself for every candidate, candidates collect in a buffer of twice k; when it is
//! full, the k nearest are selected in linear time and the search radius shrinks to the k-th. The result is a set,
//! independent of the order of the stream: equal distances are told apart by what the photons carry.

use heapless::VecView;
use photoncard_shared::layout::{PHOTON_CONTENT_BYTES, Photon, Rgbe};

use super::select::select;

/// A photon near a query, with all that its reflection needs.
///
/// Candidates are in the order of their distance, then of what they carry. So it does not matter in which layout or place
/// of the map a photon lies: two that are equal add the same to any sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The squared distance's bits.
    pub(super) distance: u32,
    /// The power's bytes, scrambled: of photons at one distance neither the bright nor the dim ones may come first.
    pub(super) power: u32,
    /// The direction's code, and the flags without the axis.
    pub(super) rest: u32,
}

/// An odd factor, and the one that undoes it.
const SCRAMBLE: u32 = 0x9e37_79b1;
const UNSCRAMBLE: u32 = 0x0e8b_2f51;
const _: () = assert!(SCRAMBLE.wrapping_mul(UNSCRAMBLE) == 1);

impl Candidate {
    /// A photon that carries `content` at a squared distance, m^2, that is not negative.
    #[inline(always)]
    pub fn new(distance_squared: f32, content: [u8; PHOTON_CONTENT_BYTES]) -> Self {
        let [r, g, b, exponent, direction @ .., low, high] = content;
        let flags = Photon::flags_without_axis(u16::from_le_bytes([low, high]));
        Self {
            // The bits of non-negative floats are in the order of their values.
            distance: distance_squared.to_bits(),
            power: u32::from_le_bytes([r, g, b, exponent]).wrapping_mul(SCRAMBLE),
            rest: u32::from(flags) << 16 | u32::from(u16::from_le_bytes(direction)),
        }
    }

    /// The order of candidates.
    #[inline(always)]
    pub fn order(&self) -> (u64, u32) {
        ((self.distance as u64) << 32 | self.power as u64, self.rest)
    }

    /// Bits of [`Self::key`].
    pub(super) const KEY_BITS: u32 = 96;

    /// The same as one number.
    #[inline(always)]
    pub(super) fn key(&self) -> u128 {
        let (distance, power) = (u128::from(self.distance), u128::from(self.power));
        distance << 64 | power << 32 | u128::from(self.rest)
    }

    /// Squared distance from the query, m^2.
    #[inline(always)]
    pub fn distance_squared(&self) -> f32 {
        f32::from_bits(self.distance)
    }

    /// The photon's power, in photon power units.
    #[inline(always)]
    pub fn power(&self) -> Rgbe {
        Rgbe(self.power.wrapping_mul(UNSCRAMBLE).to_le_bytes())
    }

    /// Code of the direction the photon came from.
    #[inline(always)]
    pub fn direction(&self) -> [u8; 2] {
        let [a, b, ..] = self.rest.to_le_bytes();
        [a, b]
    }

    #[inline(always)]
    fn flags(&self) -> u16 {
        (self.rest >> 16) as u16
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
    /// Candidates that selections went through, and that they dropped.
    selected: u32,
    dropped: u32,
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
        Self { candidates, neighbors, full, limit, max_distance_squared: limit, selected: 0, dropped: 0 }
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
        self.selected += candidates.len() as u32;
        self.dropped += (candidates.len() - self.neighbors) as u32;
        if let Some(last) = select(candidates, self.neighbors) {
            self.limit = last.distance_squared();
        }
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

    /// Candidates that were taken so far.
    pub fn taken(&self) -> u32 {
        self.dropped + self.candidates.len() as u32
    }

    /// Candidates that selections went through so far.
    pub fn selected(&self) -> u32 {
        self.selected
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
