//! Gather points: origin, purpose and directions of final gather rays.

use photoncard_shared::layout::encode_normal;
use photoncard_shared::message::{Fault, Sampling};

use super::Context;
use super::search::search;
use crate::importance::{DirectionTable, IncidentFlux};
use crate::memory::{MemoryPort, Stage};
use crate::photon::{Candidates, NearestPhotons, PhotonMap};
use crate::sampler::Pattern;
use crate::scene::{Reflector, Surface};

/// The origin of gather rays.
#[derive(Clone, Copy, Debug)]
pub struct GatherPoint {
    /// The surface, with its whole reflection whatever the purpose.
    pub surface: Surface,
    /// Random numbers of the rays.
    pub pattern: Pattern,
    /// Number of rays; with 0, direct light is left to shadow rays.
    pub rays: u32,
    /// Shares of the rays by direction.
    pub directions: DirectionTable,
    /// The purpose of the rays.
    pub purpose: Purpose,
    /// Weight of the rays' light in the sum that takes it.
    pub weight: f32,
}

/// The purpose of a point's gather rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// All light that a sample reflects.
    Sample,
    /// Light that the lobe of a sample reflects; irradiance records light its Lambertian part.
    Lobe,
    /// The irradiance of a record, which many samples share.
    Record,
}

/// Minimum number of gather rays for which photons are searched for a direction table. The search costs as
/// much as a gather ray; fewer rays spread over the cells too thinly to gain by it: `docs/techniques.md`.
const MIN_RAYS_OF_SEARCH: u32 = 8;

impl GatherPoint {
    /// A point for all light that a sample reflects.
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

    /// A point for the irradiance of a record, whose surface is white.
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

    /// A point for the lobe of a surface, with [`Reflector::lobe_share`] of the rays.
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

    /// The reflection that the rays serve, seen from the eye.
    #[inline(always)]
    pub fn reflector(&self) -> Reflector {
        let Surface { normal, outgoing, reflection, .. } = self.surface;
        let is_of_lobe = self.purpose == Purpose::Lobe;
        let reflection = if is_of_lobe { reflection.without_lambertian() } else { reflection };
        Reflector { normal, outgoing, reflection }
    }

    /// Chooses the directions: by the reflection for few rays, else by the frame's sampling, which may search
    /// the nearest photons.
    ///
    /// # Errors
    /// If the image is not sound.
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
            IncidentFlux::new(&nearest, normal, code, reflector.albedo()).table(sampling, &reflector)
        };
        Ok(())
    }
}
