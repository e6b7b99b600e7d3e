//! Gather points whose rays are cast together, bin by bin.

use core::ops::Range;

use super::position::Position;
use super::stored_point::StoredPoint;
use crate::kind::{Buffer, Capacity};
use crate::sampler::Pattern;

/// Stored gather points, each with its owner: the index of a pixel in its block, or of an irradiance record.
pub(super) struct Points<C: Capacity> {
    points: C::Buffer<StoredPoint>,
    owners: C::Buffer<u16>,
    /// The direction bin of each point's next ray; after the last ray, the last one's. Alone, as most points have no ray in a bin.
    bins: C::Buffer<u8>,
}

impl<C: Capacity> Points<C> {
    pub(super) const fn new() -> Self {
        Self { points: Buffer::EMPTY, owners: Buffer::EMPTY, bins: Buffer::EMPTY }
    }

    pub(super) fn clear(&mut self) {
        self.points.view_mut().clear();
        self.owners.view_mut().clear();
        self.bins.view_mut().clear();
    }

    pub(super) fn len(&self) -> u32 {
        self.owners.view().len() as u32
    }

    /// Appends a point with the bin of its first ray. There is room for one of each pixel of a stripe, and of each record of a block.
    pub(super) fn push(&mut self, owner: u16, point: StoredPoint, bin: u32) {
        let _ = self.points.view_mut().push(point);
        let _ = self.owners.view_mut().push(owner);
        let _ = self.bins.view_mut().push(bin as u8);
    }

    /// The point of an index, with its owner.
    #[inline(always)]
    pub(super) fn get(&self, index: u32) -> Option<(u16, &StoredPoint)> {
        let index = index as usize;
        Some((*self.owners.view().get(index)?, self.points.view().get(index)?))
    }

    /// Index and owner of the next point with rays in the present bin; `None` if there is none.
    #[inline(always)]
    pub(super) fn next(&self, position: &Position) -> Option<(u32, u16)> {
        let first = position.index as usize;
        let others = self.bins.view().get(first..)?.iter();
        let index = first + others.into_iter().position(|&bin| u32::from(bin) == position.bin)?;
        Some((index as u32, *self.owners.view().get(index)?))
    }

    /// The next rays of the point of an index in the present bin, of `bins`. The position goes on behind them.
    #[inline(always)]
    pub(super) fn take_rays(
        &mut self,
        position: &mut Position,
        index: u32,
        pattern: Pattern,
        bins: u32,
    ) -> Range<u32> {
        let at = index as usize;
        let (Some(point), Some(bin)) = (self.points.view().get(at), self.bins.view_mut().get_mut(at)) else {
            // Never reached: the index is a point's.
            position.pass_rays(index, 0, true);
            return 0..0;
        };
        let (rays, next) = point.next_rays(pattern, position.rays_cast(), [position.bin, bins]);
        *bin = next.map_or(*bin, |next| next as u8);
        position.pass_rays(index, rays.len() as u32, next != Some(position.bin));
        rays
    }
}
