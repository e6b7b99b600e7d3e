//! Sums of light of the pixels with gather rays, for all tiles in flight.
//!
//! Only pixels with gather rays receive light before they are completed: from gather rays, shadow rays and
//! caustics. The sums are in a ring buffer. The sums of a block's pixels are consecutive and form a *run*. A
//! run grows while the block's eye rays are cast, and ends when the block's pixels are complete.

use core::num::NonZeroU32;

use photoncard_shared::budget::MAX_IN_FLIGHT;
use photoncard_shared::message::{Fault, FrameParameters, Invariant};

use super::light::{Component, PixelLight, add_light};
use crate::fixed_point::ColourSum;
use crate::kind::{Buffer, Capacity};
use crate::light_groups::GroupedLight;

/// Ring buffer of sums, in the card image's radiance units, with
/// [`PixelForm::sums_of_light`](photoncard_shared::message::PixelForm::sums_of_light) sums for each pixel.
pub(super) struct PixelSums<C: Capacity> {
    sums: C::Buffer<ColourSum>,
    runs: [Run; MAX_IN_FLIGHT as usize],
    /// Position in the ring at which the next pixel is appended, in pixels.
    end: u32,
}

/// Consecutive pixels in the ring that belong to one tile in flight.
#[derive(Clone, Copy)]
struct Run {
    first: u32,
    count: u32,
}

impl Run {
    const EMPTY: Self = Self { first: 0, count: 0 };

    /// Returns true if the run contains position `place` of a ring with `places` positions.
    fn holds(&self, place: u32, places: NonZeroU32) -> bool {
        (place + places.get() - self.first) % places < self.count
    }
}

impl<C: Capacity> PixelSums<C> {
    pub(super) const fn new() -> Self {
        Self { sums: Buffer::EMPTY, runs: [Run::EMPTY; MAX_IN_FLIGHT as usize], end: 0 }
    }

    /// Sets the capacity to `sums` sums, if the type leaves it open.
    pub(super) fn reserve(&mut self, sums: usize) {
        self.sums.reserve(sums);
    }

    /// Capacity of the ring in pixels, at least 1.
    fn places(&self, frame: &FrameParameters) -> NonZeroU32 {
        NonZeroU32::new(self.sums.capacity() as u32 / frame.form().sums_of_light()).unwrap_or(NonZeroU32::MIN)
    }

    /// Begins an empty run, after all other runs, for the tile in flight with index `flight`.
    pub(super) fn begin(&mut self, flight: usize) {
        // Always fits: the buffer's own capacity.
        let _ = self.sums.resize(self.sums.capacity(), ColourSum::ZERO);
        // In a frame with layers the ring has room for fewer pixels, so that `end` may be past the last.
        if self.runs.iter().all(|run| run.count == 0) {
            self.end = 0;
        }
        if let Some(run) = self.runs.get_mut(flight) {
            *run = Run { first: self.end, count: 0 };
        }
    }

    /// Frees the run of the tile in flight with index `flight`, after its sums were read.
    pub(super) fn end(&mut self, flight: usize) {
        if let Some(run) = self.runs.get_mut(flight) {
            *run = Run::EMPTY;
        }
    }

    /// Returns true if there is room for another pixel.
    pub(super) fn has_room(&self, frame: &FrameParameters) -> bool {
        let places = self.places(frame);
        !self.runs.iter().any(|run| run.holds(self.end, places))
    }

    /// Appends a pixel without light to the run of the tile in flight with index `flight`. This run must be
    /// the last one begun, and [`Self::has_room`] must be true. Returns the pixel's number in the run.
    pub(super) fn push(&mut self, frame: &FrameParameters, flight: usize) -> Result<u16, Fault> {
        let (count, places) = (frame.form().sums_of_light() as usize, self.places(frame));
        let first = self.end as usize * count;
        let sums = self.sums.values_mut().get_mut(first..first + count);
        let (sums, run) = sums.zip(self.runs.get_mut(flight)).ok_or(Invariant::Sums.fault())?;
        sums.fill(ColourSum::ZERO);
        self.end = (self.end + 1) % places;
        run.count += 1;
        // A tile has at most 2^15 pixels.
        Ok((run.count - 1) as u16)
    }

    fn place(&self, frame: &FrameParameters, flight: usize, number: u16) -> Result<usize, Fault> {
        let run = self.runs.get(flight).filter(|run| u32::from(number) < run.count);
        let run = run.ok_or(Invariant::Sums.fault())?;
        Ok(((run.first + u32::from(number)) % self.places(frame)) as usize)
    }

    /// Adds light, in the card image's radiance units, to a component of pixel `number` in the run of a tile.
    #[inline]
    pub(super) fn add(
        &mut self,
        frame: &FrameParameters,
        (flight, number): (usize, u16),
        component: Component,
        brought: &GroupedLight,
    ) -> Result<(), Fault> {
        add_light(frame, self.of_pixel(frame, (flight, number))?, component, brought);
        Ok(())
    }

    /// Number of pixels in the run of the tile in flight with index `flight`.
    pub(super) fn len(&self, flight: usize) -> u32 {
        self.runs.get(flight).map_or(0, |run| run.count)
    }

    /// Sums of pixel `number` in the run of a tile, mutable.
    #[inline]
    pub(super) fn of_pixel(
        &mut self,
        frame: &FrameParameters,
        (flight, number): (usize, u16),
    ) -> Result<&mut [ColourSum], Fault> {
        let count = frame.form().sums_of_light() as usize;
        let first = self.place(frame, flight, number)? * count;
        self.sums.values_mut().get_mut(first..first + count).ok_or(Invariant::Sums.fault())
    }

    /// Light of pixel `number` in the run of a tile.
    pub(super) fn light(
        &self,
        frame: &FrameParameters,
        (flight, number): (usize, u16),
    ) -> Result<PixelLight, Fault> {
        let count = frame.form().sums_of_light() as usize;
        let first = self.place(frame, flight, number)? * count;
        let sums = self.sums.values().get(first..first + count).ok_or(Invariant::Sums.fault())?;
        Ok(PixelLight::of(sums))
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use glam::Vec3;

    use super::*;
    use crate::chip::test_frame::frame;
    use crate::kind::Entries;
    use crate::light_groups::LightGroups;

    /// Light that differs in each group.
    fn grouped(frame: &FrameParameters, light: f32) -> GroupedLight {
        GroupedLight::of_groups(LightGroups::of(frame), |group| Vec3::splat(light + group as f32))
    }

    /// Tiles begin and end in many orders. Each pixel must keep its own light, and all positions of the ring
    /// must be used again.
    #[test]
    fn every_pixel_of_every_tile_in_flight_has_a_sum_of_its_own() {
        for (layers, light_groups) in [(false, 0), (true, 0), (false, 3), (true, 4)] {
            let frame = &FrameParameters { layers, light_groups, ..frame() };
            let mut sums = PixelSums::<Entries<24>>::new();
            let places = sums.places(frame).get() as u16;
            let mut held: [Vec<f32>; 3] = Default::default();
            for step in 0..3000_u32 {
                let flight = (crate::sampler::hash(step) % 3) as usize;
                check(&sums, frame, &held);
                sums.end(flight);
                held[flight].clear();
                sums.begin(flight);
                let wanted = crate::sampler::hash(!step) % 12;
                for number in 0..wanted {
                    if !sums.has_room(frame) {
                        let used: usize = held.iter().map(Vec::len).sum();
                        assert!(used > 0, "an empty ring has room");
                        break;
                    }
                    assert_eq!(sums.push(frame, flight), Ok(number as u16));
                    let light = (3 * step + number) as f32;
                    let added =
                        sums.add(frame, (flight, number as u16), Component::Indirect, &grouped(frame, light));
                    assert_eq!(added, Ok(()));
                    held[flight].push(light);
                }
            }
            // A single tile has room for all pixels of the ring.
            (0..3).for_each(|flight| sums.end(flight));
            sums.begin(1);
            for number in 0..places {
                assert!(sums.has_room(frame));
                assert_eq!(sums.push(frame, 1), Ok(number));
            }
            assert!(!sums.has_room(frame));
        }
    }

    fn check(sums: &PixelSums<Entries<24>>, frame: &FrameParameters, held: &[Vec<f32>; 3]) {
        for (flight, lights) in held.iter().enumerate() {
            for (number, &light) in (0..).zip(lights) {
                let mut expected = PixelLight::NONE;
                expected.add(frame, Component::Indirect, &grouped(frame, light));
                assert_eq!(sums.light(frame, (flight, number)), Ok(expected));
            }
        }
    }
}
