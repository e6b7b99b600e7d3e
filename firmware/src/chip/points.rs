//! Gather points whose rays are cast together, bin by bin.

use super::stored_point::StoredPoint;
use crate::kind::{Buffer, Capacity};

/// Stored gather points, each with its owner: the index of a pixel in its block, or of an irradiance record.
pub(super) struct Points<C: Capacity> {
    points: C::Buffer<StoredPoint>,
    owners: C::Buffer<u16>,
}

impl<C: Capacity> Points<C> {
    pub(super) const fn new() -> Self {
        Self { points: Buffer::EMPTY, owners: Buffer::EMPTY }
    }

    pub(super) fn clear(&mut self) {
        self.points.view_mut().clear();
        self.owners.view_mut().clear();
    }

    pub(super) fn len(&self) -> u32 {
        self.owners.view().len() as u32
    }

    /// Appends a point. There is room for one of each pixel of a stripe, and of each record of a block.
    pub(super) fn push(&mut self, owner: u16, point: StoredPoint) {
        let _ = self.points.view_mut().push(point);
        let _ = self.owners.view_mut().push(owner);
    }

    /// The point of an index, with its owner.
    #[inline(always)]
    pub(super) fn get(&self, index: u32) -> Option<(u16, &StoredPoint)> {
        let index = index as usize;
        Some((*self.owners.view().get(index)?, self.points.view().get(index)?))
    }
}
