//! Photons near a query, with all that their reflection needs: distances and what the photons carry, each on its own.

use core::cell::Cell;

use photoncard_shared::layout::{PHOTON_CONTENT_BYTES, Photon, Rgbe};

/// A photon near a query.
///
/// Candidates are in the order of their distance, then of what they carry. So it does not matter in which layout or place
/// of the map a photon lies: two that are equal add the same to any sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The squared distance's bits.
    pub(super) distance: u32,
    /// The photon's content, without an axis, as one number.
    pub(super) content: u64,
}

/// An odd factor, so that of photons at one distance neither the bright nor the dim ones come first.
const SCRAMBLE: u64 = 0x9e37_79b9_7f4a_7c15;

/// The bits of a photon's content that are not its axis.
const WITHOUT_AXIS: u64 = !(3 << 48);

impl Candidate {
    /// A photon that carries `content` at a squared distance, m^2, that is not negative.
    #[inline(always)]
    pub fn new(distance_squared: f32, content: [u8; PHOTON_CONTENT_BYTES]) -> Self {
        // The bits of non-negative floats are in the order of their values.
        Self { distance: distance_squared.to_bits(), content: u64::from_le_bytes(content) & WITHOUT_AXIS }
    }

    /// The order of candidates.
    #[inline(always)]
    pub fn order(&self) -> (u32, u64) {
        (self.distance, self.content.wrapping_mul(SCRAMBLE))
    }

    /// Bits of [`Self::key`].
    pub(super) const KEY_BITS: u32 = 96;

    /// The same as one number.
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

    /// The photon's power, in photon power units.
    #[inline(always)]
    pub fn power(&self) -> Rgbe {
        Rgbe((self.content as u32).to_le_bytes())
    }

    /// Code of the direction the photon came from.
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

/// Room for `N` candidates.
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
    /// Room of which nothing is used.
    pub const fn new() -> Self {
        Self { distances: [0; N], contents: [0; N] }
    }

    /// Room that is filled with candidates, and what of it is; without those that there is no room for.
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

    /// The room, whatever its size.
    #[inline(always)]
    pub fn view(&mut self) -> Candidates<'_> {
        Candidates { distances: &mut self.distances, contents: &mut self.contents }
    }
}

/// Candidates in someone else's room: as many distances as contents.
pub struct Candidates<'a> {
    pub(super) distances: &'a mut [u32],
    pub(super) contents: &'a mut [u64],
}

impl<'a> Candidates<'a> {
    /// The same for as long as this is not used.
    #[inline(always)]
    pub fn reborrow(&mut self) -> Candidates<'_> {
        Candidates { distances: self.distances, contents: self.contents }
    }

    /// How many there is room for.
    #[inline(always)]
    pub fn capacity(&self) -> usize {
        self.distances.len().min(self.contents.len())
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = Candidate> {
        let all = self.distances.iter().zip(&*self.contents);
        all.map(|(&distance, &content)| Candidate { distance, content })
    }

    /// The first so many.
    #[inline(always)]
    pub(super) fn first(&mut self, count: usize) -> Option<Candidates<'_>> {
        Some(Candidates {
            distances: self.distances.get_mut(..count)?,
            contents: self.contents.get_mut(..count)?,
        })
    }

    /// Sets candidate `index`, if there is room for it.
    #[inline(always)]
    pub(super) fn set(&mut self, index: usize, candidate: Candidate) {
        if let (Some(distance), Some(content)) = (self.distances.get_mut(index), self.contents.get_mut(index))
        {
            (*distance, *content) = (candidate.distance, candidate.content);
        }
    }

    /// The same as cells.
    #[inline(always)]
    pub(super) fn cells(self) -> CandidateCells<'a> {
        CandidateCells {
            distances: Cell::from_mut(self.distances).as_slice_of_cells(),
            contents: Cell::from_mut(self.contents).as_slice_of_cells(),
        }
    }
}

/// Candidates that can be moved while others look at them.
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
