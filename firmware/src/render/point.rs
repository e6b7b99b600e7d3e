//! Gather points: origin, purpose and directions of final gather rays.

use photoncard_shared::layout::encode_normal;
use photoncard_shared::message::{Fault, FrameParameters, Sampling};

use super::Context;
use super::search::search;
use crate::importance::{DirectionTable, IncidentFlux};
use crate::memory::{MemoryPort, Stage};
use crate::photon::{Candidates, NearestPhotons, PhotonMap};
use crate::sampler::Pattern;
use crate::scene::{Reflector, Surface};

/// Surface point from which final gather rays are cast, and the parameters of these rays.
#[derive(Clone, Copy, Debug)]
pub struct GatherPoint {
    /// Surface at the point, with its whole reflection, whatever the purpose of the rays.
    pub surface: Surface,
    /// Random pattern from which the rays are sampled.
    pub pattern: Pattern,
    /// Number of rays. Without rays, all direct light comes from shadow rays.
    pub rays: u32,
    /// Direction table from which the rays are sampled.
    pub directions: DirectionTable,
    /// Light that the rays gather.
    pub purpose: Purpose,
    /// Weight with which the light of the rays is added to its sum.
    pub weight: f32,
}

/// Purpose of a point's gather rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The rays gather all light that a sample reflects.
    Sample,
    /// The rays gather the light that a sample's lobe reflects. The light of the Lambertian part is
    /// interpolated between irradiance records.
    Lobe,
    /// The rays gather the irradiance of an irradiance record, from which many samples are interpolated.
    Record,
    /// One ray continues a gather ray that ends near its own point.
    Near,
}

/// Minimum number of gather rays for a direction table that depends on photons. With fewer rays such a table
/// does not pay: its photon search costs as much as a gather ray, and the rays are spread too thinly over the
/// cells (`docs/techniques.md`).
const MIN_RAYS_OF_SEARCH: u32 = 8;

impl GatherPoint {
    /// Creates the gather point of a sample with `rays` rays for all reflected light. A black surface gets no
    /// rays.
    pub fn sample(surface: Surface, pattern: Pattern, rays: u32) -> Self {
        let rays = if surface.reflection.is_black() { 0 } else { rays };
        Self {
            surface,
            pattern,
            rays,
            directions: DirectionTable::COSINE,
            purpose: Purpose::Sample,
            weight: 1.0,
        }
    }

    /// Creates the gather point of an irradiance record. `surface` must be white.
    pub fn record(surface: Surface, pattern: Pattern, rays: u32) -> Self {
        Self {
            surface,
            pattern,
            rays,
            directions: DirectionTable::COSINE,
            purpose: Purpose::Record,
            weight: 1.0,
        }
    }

    /// Creates the gather point of a sample with rays for the lobe alone. Their number is `rays` times
    /// [`Reflector::lobe_share`], rounded up.
    pub fn lobe(surface: Surface, pattern: Pattern, rays: u32) -> Self {
        let rays = libm::ceilf(rays as f32 * surface.reflector().lobe_share()) as u32;
        Self {
            surface,
            pattern,
            rays,
            directions: DirectionTable::COSINE,
            purpose: Purpose::Lobe,
            weight: 1.0,
        }
    }

    /// Creates the gather point at the near end of a gather ray.
    pub fn near(surface: Surface, pattern: Pattern) -> Self {
        Self {
            surface,
            pattern,
            rays: 1,
            directions: DirectionTable::of_reflection(&surface.reflector()),
            purpose: Purpose::Near,
            weight: 1.0,
        }
    }

    /// Number of the point's shadow rays in `frame`.
    #[inline(always)]
    pub fn shadow_rays(&self, frame: &FrameParameters) -> u32 {
        if self.purpose == Purpose::Near { 1 } else { frame.shadow_rays }
    }

    /// Reflection whose light the rays gather: the surface's whole reflection or, for [`Purpose::Lobe`], its
    /// lobe alone.
    #[inline(always)]
    pub fn reflector(&self) -> Reflector {
        let reflector = self.surface.reflector();
        let is_of_lobe = self.purpose == Purpose::Lobe;
        let reflection = reflector.reflection;
        let reflection = if is_of_lobe { reflection.without_lambertian() } else { reflection };
        Reflector { reflection, ..reflector }
    }

    /// Chooses the direction table. With few rays it depends on the reflection alone, otherwise on the
    /// frame's sampling method, which may need a search for the nearest photons.
    ///
    /// # Errors
    /// If the card image is invalid.
    pub fn choose_directions<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        candidates: Candidates,
    ) -> Result<(), Fault> {
        if self.rays == 0 {
            return Ok(());
        }
        let reflector = self.reflector();
        let sampling = context.frame.sampling;
        self.directions = if sampling == Sampling::Reflection || self.rays < MIN_RAYS_OF_SEARCH {
            DirectionTable::of_reflection(&reflector)
        } else {
            context.counters.tables += 1;
            context.memory.enter(Stage::Table);
            let Surface { position, normal, geometric_normal, .. } = self.surface;
            let frame = context.frame;
            let mut nearest = NearestPhotons::new(candidates, frame.neighbors, frame.max_distance);
            let tested = search(context, PhotonMap::Indirect, position, &mut nearest)?;
            context.counters.count_gather(
                tested,
                nearest.taken(),
                nearest.selections(),
                nearest.len() as u32,
            );
            let code = encode_normal(geometric_normal.to_array());
            IncidentFlux::new(&nearest, sampling, normal, code, reflector.albedo())
                .table(sampling, &reflector)
        };
        Ok(())
    }
}
