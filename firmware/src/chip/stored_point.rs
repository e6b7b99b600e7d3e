//! A gather point as it waits from one direction bin to the next.

use core::ops::Range;

use photoncard_shared::budget::MAX_GATHER_RAYS;
use photoncard_shared::message::{Fault, FrameParameters};

use crate::importance::DirectionTable;
use crate::memory::MemoryPort;
use crate::render::{Context, GatherPoint, PixelSample, Purpose, eye};
use crate::sampler::{Dimension, Pattern};
use crate::scene::{Seen, Surface};

/// State of a gather point from one direction bin to the next, 48 bytes: the rest is read again.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoredPoint {
    /// Of pixels: the triangle and the place on it; elsewhere if it is seen by way of perfectly specular surfaces.
    pub(super) seen: Seen,
    pub(super) directions: DirectionTable,
    /// The number of rays to cast, and their purpose.
    pub(super) rays: StoredRays,
}

const _: () = assert!(size_of::<StoredPoint>() == 48);

/// The number of a point's rays, and whether they are for the lobe alone.
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
    /// The point of an irradiance record: the record has its surface.
    pub(super) fn of_record(point: &GatherPoint) -> Self {
        Self { seen: Seen::NOWHERE, directions: point.directions, rays: StoredRays::new(point) }
    }

    /// The rays of a direction bin: known before the surface is read again.
    #[inline(always)]
    pub(super) fn rays_of_bin(&self, pattern: Pattern, bin: u32, bins: u32) -> Range<u32> {
        self.directions.rays(pattern, self.rays.number(), bin, bins)
    }

    /// The gather point of a sample of a pixel, but for its surface.
    #[inline(always)]
    pub(super) fn point(&self, frame: &FrameParameters, at: PixelSample) -> GatherPoint {
        GatherPoint {
            surface: Surface::NOWHERE,
            pattern: pattern(frame, at),
            rays: self.rays.number(),
            directions: self.directions,
            purpose: self.rays.purpose(),
        }
    }

    /// Reads the surface of a sample of a pixel into `surface`. `false` if there is none.
    #[inline(always)]
    pub(super) fn read_surface<M: MemoryPort>(
        &self,
        context: &mut Context<M>,
        at: PixelSample,
        surface: &mut Surface,
    ) -> Result<bool, Fault> {
        if self.seen.is_elsewhere() {
            // The way there is followed again.
            let Some(view) = eye::view(context, at)?.surface() else { return Ok(false) };
            *surface = view.surface;
        } else {
            let film = eye::film_position(context, at);
            eye::surface(context, film, &self.seen, surface)?;
        }
        Ok(true)
    }
}

/// The random numbers of a sample's gather rays.
#[inline(always)]
pub(super) fn pattern(frame: &FrameParameters, at: PixelSample) -> Pattern {
    Pattern::new(frame.seed, at.x, at.y, at.sample, Dimension::Gather)
}
