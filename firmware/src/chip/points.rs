//! Gather points whose rays are cast together, by direction bin.

use core::ops::Range;

use photoncard_shared::message::{Fault, FrameParameters, Invariant};

use super::position::Position;
use super::stored_point::{StoredPoint, rays_per_step};
use crate::kind::{Buffer, Capacity};
use crate::sampler::Pattern;

/// Gather points with their owners. The owner is the index of a pixel in its block, or of an irradiance
/// record in the cache.
pub(super) struct Points<C: Capacity> {
    points: C::Buffer<StoredPoint>,
    owners: C::Buffer<u16>,
    /// Direction bin of each point's next ray, or of its last ray when all are cast. The bins have an array
    /// of their own, so that a search skips the many points without a ray in the current bin.
    bins: C::Buffer<u8>,
}

impl<C: Capacity> Points<C> {
    pub(super) const fn new() -> Self {
        Self { points: Buffer::EMPTY, owners: Buffer::EMPTY, bins: Buffer::EMPTY }
    }

    /// Sets the capacity to `points` points, if the type leaves it open.
    pub(super) fn reserve(&mut self, points: usize) {
        self.points.reserve(points);
        self.owners.reserve(points);
        self.bins.reserve(points);
    }

    /// Maximum number of points.
    pub(super) fn capacity(&self) -> u32 {
        self.owners.capacity() as u32
    }

    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.owners.clear();
        self.bins.clear();
    }

    pub(super) fn len(&self) -> u32 {
        self.owners.values().len() as u32
    }

    /// Appends a point; `bin` is the direction bin of its first ray. There is room for one point per pixel of
    /// a stripe, and per record of a block.
    pub(super) fn push(&mut self, owner: u16, point: StoredPoint, bin: u32) -> Result<(), Fault> {
        let full = Invariant::Points.fault();
        self.points.push(point).map_err(|_| full)?;
        self.owners.push(owner).map_err(|_| full)?;
        self.bins.push(bin as u8).map_err(|_| full)
    }

    /// Owner and point at `index`.
    #[inline(always)]
    pub(super) fn get(&self, index: u32) -> Result<(u16, &StoredPoint), Fault> {
        let at = index as usize;
        let point = self.owners.values().get(at).copied().zip(self.points.values().get(at));
        point.ok_or(Invariant::Points.fault())
    }

    /// Index and owner of the first point, from `position.index` on, whose next ray is in the current
    /// direction bin; `None` if there is none.
    #[inline(always)]
    pub(super) fn next(&self, position: &Position) -> Option<(u32, u16)> {
        let first = position.index as usize;
        let others = self.bins.values().get(first..)?.iter();
        let index = first + others.into_iter().position(|&bin| u32::from(bin) == position.bin)?;
        Some((index as u32, *self.owners.values().get(index)?))
    }

    /// Takes the next rays of point `index` in the current direction bin of `frame`, and advances `position`
    /// past them.
    #[inline(always)]
    pub(super) fn take_rays(
        &mut self,
        position: &mut Position,
        index: u32,
        pattern: Pattern,
        frame: &FrameParameters,
    ) -> Result<Range<u32>, Fault> {
        let at = index as usize;
        let point = self.points.values().get(at).zip(self.bins.values_mut().get_mut(at));
        let (point, bin) = point.ok_or(Invariant::Points.fault())?;
        let cast = [position.rays_cast(), rays_per_step(frame)];
        let (rays, next) = point.next_rays(pattern, cast, [position.bin, frame.bins]);
        *bin = next.map_or(*bin, |next| next as u8);
        position.pass_rays(index, rays.len() as u32, next != Some(position.bin));
        Ok(rays)
    }
}
