//! Part of a gather point that a chip stores while it casts the point's rays, one direction bin after
//! another.

use core::ops::Range;

use photoncard_shared::budget::MAX_GATHER_RAYS;
use photoncard_shared::message::{Fault, FrameParameters, Invariant};

use crate::importance::DirectionTable;
use crate::memory::MemoryPort;
use crate::render::{Context, GatherPoint, PixelSample, Purpose, eye};
use crate::sampler::{Dimension, Pattern};
use crate::scene::{Seen, Surface};

/// Maximum number of gather rays of one point that are cast in one piece of work.
const RAYS_PER_STEP: u32 = 64;
/// [`RAYS_PER_STEP`] in a frame with near ends, each of which brings further rays.
const RAYS_PER_STEP_WITH_NEAR_ENDS: u32 = 16;

/// Maximum number of gather rays of one point that are cast in one piece of work of `frame`.
#[inline(always)]
pub(super) fn rays_per_step(frame: &FrameParameters) -> u32 {
    if frame.near_distance > 0.0 { RAYS_PER_STEP_WITH_NEAR_ENDS } else { RAYS_PER_STEP }
}

/// Part of a gather point that is stored while the point's rays are cast, one direction bin after another; 64
/// bytes. The remainder is computed again in each bin.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoredPoint {
    /// Triangle of a pixel's gather point, and the position on it. [`Seen::ELSEWHERE`] if the eye path must
    /// be traced again to find the surface: the path passes perfectly specular surfaces, chooses a material
    /// layer at random, or ends on an instance. Unused for an irradiance record.
    pub(super) seen: Seen,
    pub(super) directions: DirectionTable,
    /// Number of rays to cast, and their purpose.
    pub(super) rays: StoredRays,
}

const _: () = assert!(size_of::<StoredPoint>() == 64);

/// Number of rays of a gather point in 15 bits, and the flag [`Self::OF_LOBE`], which is set if the rays
/// sample only the lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct StoredRays(u16);

const _: () = assert!(MAX_GATHER_RAYS < StoredRays::OF_LOBE as u32);

impl StoredRays {
    const OF_LOBE: u16 = 1 << 15;

    pub(super) fn new(point: &GatherPoint) -> Self {
        let of_lobe = if point.purpose == Purpose::Lobe { Self::OF_LOBE } else { 0 };
        Self(point.rays as u16 | of_lobe)
    }

    #[inline(always)]
    fn number(self) -> u32 {
        u32::from(self.0 & !Self::OF_LOBE)
    }

    #[inline(always)]
    fn purpose(self) -> Purpose {
        if self.0 & Self::OF_LOBE != 0 { Purpose::Lobe } else { Purpose::Sample }
    }
}

impl StoredPoint {
    /// Stores the gather point of an irradiance record without its surface, which is in the record.
    pub(super) fn of_record(point: &GatherPoint) -> Self {
        Self { seen: Seen::NOWHERE, directions: point.directions, rays: StoredRays::new(point) }
    }

    /// Direction bin of the first ray, from 0 to `bins - 1`.
    pub(super) fn first_bin(&self, pattern: Pattern, bins: u32) -> u32 {
        self.directions.bin(pattern, 0, self.rays.number(), bins)
    }

    /// Returns the next rays of direction bin `bin`, at least one and at most `most`, and the bin of the ray
    /// after them, if any. `done` rays of the bin were already cast.
    #[inline(always)]
    pub(super) fn next_rays(
        &self,
        pattern: Pattern,
        [done, most]: [u32; 2],
        [bin, bins]: [u32; 2],
    ) -> (Range<u32>, Option<u32>) {
        let number = self.rays.number();
        let first = self.directions.first_ray(pattern, number, bin, bins) + done;
        let mut end = first + 1;
        while end < number {
            let next = self.directions.bin(pattern, end, number, bins);
            if next != bin || end - first == most {
                return (first..end, Some(next));
            }
            end += 1;
        }
        (first..number, None)
    }

    /// Restores the gather point of a pixel's path. Its weight is 1, and its surface a placeholder.
    #[inline(always)]
    pub(super) fn point(&self, pattern: Pattern) -> GatherPoint {
        GatherPoint {
            surface: Surface::NOWHERE,
            pattern,
            rays: self.rays.number(),
            directions: self.directions,
            purpose: self.rays.purpose(),
            weight: 1.0,
        }
    }

    /// Reads the surface at a pixel's gather point into `surface`. `at` is the eye path that ends at the
    /// point.
    ///
    /// # Errors
    /// If the card image is invalid, or the eye path ends at no surface.
    #[inline(always)]
    pub(super) fn read_surface<M: MemoryPort>(
        &self,
        context: &mut Context<M>,
        at: PixelSample,
        surface: &mut Surface,
    ) -> Result<(), Fault> {
        if self.seen.is_elsewhere() {
            // The eye path is traced again.
            *surface = eye::view(context, at)?.surface().ok_or(Invariant::Surface.fault())?.surface;
        } else {
            let sample = eye::camera_sample(context, at);
            eye::surface(context, &sample, &self.seen, surface)?;
        }
        Ok(())
    }
}

/// Random numbers for the gather rays of a path.
#[inline(always)]
pub(super) fn pattern(frame: &FrameParameters, at: PixelSample) -> Pattern {
    Pattern::new(frame.seed, at.x, at.y, at.sample, Dimension::Gather)
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn all_rays_are_cast_bin_by_bin_and_none_twice() {
        let sizes = [
            (1, 99, 64),
            (5, 1, 64),
            (64, 1, 16),
            (64, 1, 64),
            (65, 2, 64),
            (300, 99, 16),
            (16_384, 256, 64),
        ];
        for (rays, bins, most) in sizes {
            let pattern = Pattern::new(7, rays, bins, 0, Dimension::Gather);
            let directions = DirectionTable::COSINE;
            let stored = StoredPoint { seen: Seen::NOWHERE, directions, rays: StoredRays(rays as u16) };
            let mut cast = Vec::new();
            let (mut bin, mut done) = (Some(stored.first_bin(pattern, bins)), 0);
            while let Some(present) = bin {
                let (rays, next) = stored.next_rays(pattern, [done, most], [present, bins]);
                assert!((1..=most as usize).contains(&rays.len()));
                done = if next == bin { done + rays.len() as u32 } else { 0 };
                assert!(next.is_none_or(|next| present <= next && next < bins));
                cast.extend(rays);
                bin = next;
            }
            assert!(cast.into_iter().eq(0..rays));
        }
    }
}
