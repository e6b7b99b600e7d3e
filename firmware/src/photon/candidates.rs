//! Candidates of a search for the nearest photons. Their squared distances and contents are in separate
//! arrays, for vector instructions.

use core::cell::Cell;

use photoncard_shared::layout::{PHOTON_CONTENT_BYTES, Photon, Rgbe};

/// A photon found by a search: its squared distance from the query position, and its content.
///
/// Candidates are ordered by distance, then by content ([`Self::order`]). The order does not depend on the
/// photons' order in memory. Candidates that compare equal are interchangeable in any sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// Squared distance from the query, m^2, as the bits of an `f32`.
    pub(super) distance: u32,
    /// Power, direction and flags of the photon as a little-endian number.
    pub(super) content: u64,
}

/// Odd factor that scrambles contents, so that ties between equal distances favour neither bright nor dim
/// photons.
const SCRAMBLE: u64 = 0x9e37_79b9_7f4a_7c15;

impl Candidate {
    /// Creates a candidate from a photon's content, without the splitting axis of a kd-tree, and its squared
    /// distance, m^2, which must not be negative.
    #[inline(always)]
    pub fn new(distance_squared: f32, content: [u8; PHOTON_CONTENT_BYTES]) -> Self {
        // Non-negative floats compare like their bits.
        Self { distance: distance_squared.to_bits(), content: u64::from_le_bytes(content) }
    }

    /// Sort key: bits of the squared distance, then the scrambled content.
    #[inline(always)]
    pub fn order(&self) -> (u32, u64) {
        (self.distance, self.content.wrapping_mul(SCRAMBLE))
    }

    /// Number of bits of [`Self::key`].
    pub(super) const KEY_BITS: u32 = 96;

    /// [`Self::order`] as a single number.
    #[inline(always)]
    pub(super) fn key(&self) -> u128 {
        let (distance, rest) = self.order();
        u128::from(distance) << 64 | u128::from(rest)
    }

    /// Squared distance from the query, m^2.
    #[inline(always)]
    pub fn distance_squared(&self) -> f32 {
        f32::from_bits(self.distance)
    }

    /// Power of the photon, photon power units.
    #[inline(always)]
    pub fn power(&self) -> Rgbe {
        Rgbe((self.content as u32).to_le_bytes())
    }

    /// Code of the photon's incoming direction.
    #[inline(always)]
    pub fn direction(&self) -> [u8; 2] {
        ((self.content >> 32) as u16).to_le_bytes()
    }

    #[inline(always)]
    fn flags(&self) -> u16 {
        (self.content >> 48) as u16
    }

    /// Code of the surface normal at the photon.
    #[inline(always)]
    pub fn normal(&self) -> u8 {
        Photon::normal_of_flags(self.flags())
    }

    /// Code of the photon's disc fraction; in the caustic map, of its kernel radius.
    #[inline(always)]
    pub fn disc(&self) -> u8 {
        Photon::disc_of_flags(self.flags())
    }

    /// Light group of the photon's light.
    #[inline(always)]
    pub fn light_group(&self) -> u8 {
        Photon::light_group_of_flags(self.flags())
    }

    /// Returns true if the photon came from a light without a bounce; in the caustic map, if it came from a
    /// light with an area.
    #[inline(always)]
    pub fn is_direct(&self) -> bool {
        Photon::direct_of_flags(self.flags())
    }
}

/// Storage for candidates. Its capacity is fixed by the type, or set at run time by `Self::reserve`.
pub trait CandidateStorage {
    /// Zeroed storage.
    const EMPTY: Self;

    /// Sets the capacity, in candidates. Has no effect if the type fixes the capacity.
    fn reserve(&mut self, _entries: usize) {}

    /// View of the whole storage.
    fn view(&mut self) -> Candidates<'_>;
}

impl<const N: usize> CandidateStorage for CandidateBuffer<N> {
    const EMPTY: Self = Self::new();

    #[inline(always)]
    fn view(&mut self) -> Candidates<'_> {
        self.view()
    }
}

/// Buffer of `N` candidates.
pub struct CandidateBuffer<const N: usize> {
    distances: [u32; N],
    contents: [u64; N],
}

impl<const N: usize> Default for CandidateBuffer<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> CandidateBuffer<N> {
    /// Creates a zeroed buffer.
    pub const fn new() -> Self {
        Self { distances: [0; N], contents: [0; N] }
    }

    /// Copies as many candidates as fit into the buffer. Returns a view of the copies.
    pub fn fill(&mut self, candidates: &[Candidate]) -> Candidates<'_> {
        let length = candidates.len().min(N);
        let mut view = self.view();
        (0..length).zip(candidates).for_each(|(index, candidate)| view.set(index, *candidate));
        let Candidates { distances, contents } = view;
        Candidates {
            distances: distances.get_mut(..length).unwrap_or_default(),
            contents: contents.get_mut(..length).unwrap_or_default(),
        }
    }

    /// View of the whole buffer.
    #[inline(always)]
    pub fn view(&mut self) -> Candidates<'_> {
        Candidates { distances: &mut self.distances, contents: &mut self.contents }
    }
}

/// Mutable view of candidates: two slices of equal length, one of squared distances and one of contents.
pub struct Candidates<'a> {
    pub(super) distances: &'a mut [u32],
    pub(super) contents: &'a mut [u64],
}

impl<'a> Candidates<'a> {
    /// View of two slices of equal length: squared distances as `f32` bits, m^2, and contents of photons.
    #[inline(always)]
    pub fn new(distances: &'a mut [u32], contents: &'a mut [u64]) -> Self {
        Self { distances, contents }
    }

    /// Reborrows the view for a shorter lifetime.
    #[inline(always)]
    pub fn reborrow(&mut self) -> Candidates<'_> {
        Candidates { distances: self.distances, contents: self.contents }
    }

    /// Number of candidates in the view.
    #[inline(always)]
    pub fn capacity(&self) -> usize {
        self.distances.len().min(self.contents.len())
    }

    /// All candidates of the view.
    pub fn iter(&self) -> impl Iterator<Item = Candidate> {
        let all = self.distances.iter().zip(&*self.contents);
        all.map(|(&distance, &content)| Candidate { distance, content })
    }

    /// View of the first `count` candidates; `None` if there are fewer.
    #[inline(always)]
    pub(super) fn first(&mut self, count: usize) -> Option<Candidates<'_>> {
        Some(Candidates {
            distances: self.distances.get_mut(..count)?,
            contents: self.contents.get_mut(..count)?,
        })
    }

    /// Sets candidate `index`. Has no effect if `index` is out of range.
    #[inline(always)]
    pub(super) fn set(&mut self, index: usize, candidate: Candidate) {
        if let (Some(distance), Some(content)) = (self.distances.get_mut(index), self.contents.get_mut(index))
        {
            (*distance, *content) = (candidate.distance, candidate.content);
        }
    }

    /// Converts the view to one with interior mutability.
    #[inline(always)]
    pub(super) fn cells(self) -> CandidateCells<'a> {
        CandidateCells {
            distances: Cell::from_mut(self.distances).as_slice_of_cells(),
            contents: Cell::from_mut(self.contents).as_slice_of_cells(),
        }
    }
}

/// View of candidates with interior mutability. Unlike `Candidates`, it can be copied.
#[derive(Clone, Copy)]
pub(super) struct CandidateCells<'a> {
    distances: &'a [Cell<u32>],
    contents: &'a [Cell<u64>],
}

impl CandidateCells<'_> {
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.distances.len()
    }

    #[inline(always)]
    pub(super) fn get(&self, index: usize) -> Option<Candidate> {
        let (distance, content) = (self.distances.get(index)?.get(), self.contents.get(index)?.get());
        Some(Candidate { distance, content })
    }

    #[inline(always)]
    pub(super) fn set(&self, index: usize, candidate: Candidate) {
        if let (Some(distance), Some(content)) = (self.distances.get(index), self.contents.get(index)) {
            distance.set(candidate.distance);
            content.set(candidate.content);
        }
    }

    #[inline(always)]
    pub(super) fn split_at(&self, middle: usize) -> Option<(Self, Self)> {
        let (front, back) = self.distances.split_at_checked(middle)?;
        let (front_contents, back_contents) = self.contents.split_at_checked(middle)?;
        Some((
            Self { distances: front, contents: front_contents },
            Self { distances: back, contents: back_contents },
        ))
    }
}
