//! Gather points: where final gather rays start, what they are for and how they are spread.

use photoncard_shared::layout::encode_normal;
use photoncard_shared::message::{Fault, Sampling};

use super::Context;
use super::search::search;
use crate::importance::{DirectionTable, IncidentFlux};
use crate::memory::{MemoryPort, Stage};
use crate::photon::{Candidates, NearestPhotons, PhotonMap};
use crate::sampler::Pattern;
use crate::scene::{Reflector, Surface};

/// The start of some gather rays.
#[derive(Clone, Copy, Debug)]
pub struct GatherPoint {
    /// The surface; its reflection is all of it.
    pub surface: Surface,
    /// Where the rays' random numbers come from.
    pub pattern: Pattern,
    /// Number of rays; with none, direct light is left to shadow rays.
    pub rays: u32,
    /// Which way they go.
    pub directions: DirectionTable,
    /// What they are for.
    pub purpose: Purpose,
}

/// What the gather rays of a point are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// All light that a sample reflects.
    Sample,
    /// What the Phong lobe of a sample reflects, as irradiance records light the Lambertian part.
    Lobe,
    /// The irradiance of a record, which many samples share.
    Record,
}

impl GatherPoint {
    /// A point for all that a sample reflects.
    pub fn sample(surface: Surface, pattern: Pattern, rays: u32) -> Self {
        let rays = if surface.reflection.is_black() { 0 } else { rays };
        Self { surface, pattern, rays, directions: DirectionTable::COSINE, purpose: Purpose::Sample }
    }

    /// A point for the irradiance of a record, whose surface is white.
    pub fn record(surface: Surface, pattern: Pattern, rays: u32) -> Self {
        Self { surface, pattern, rays, directions: DirectionTable::COSINE, purpose: Purpose::Record }
    }

    /// A point for the lobe of a surface, with the lobe's share of the rays.
    pub fn lobe(surface: Surface, pattern: Pattern, rays: u32) -> Self {
        let rays = libm::ceilf(rays as f32 * surface.reflector().lobe_share()) as u32;
        Self { surface, pattern, rays, directions: DirectionTable::COSINE, purpose: Purpose::Lobe }
    }

    /// The reflection that the rays bring light for, seen from where they go.
    #[inline(always)]
    pub fn reflector(&self) -> Reflector {
        let Surface { normal, outgoing, reflection, .. } = self.surface;
        let is_of_lobe = self.purpose == Purpose::Lobe;
        let reflection = if is_of_lobe { reflection.without_lambertian() } else { reflection };
        Reflector { normal, outgoing, reflection }
    }

    /// Chooses the directions, from the photons nearest to the point if the sampling asks for them.
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
        self.directions = if sampling == Sampling::Reflection {
            DirectionTable::of_reflection(&reflector)
        } else {
            context.counters.tables += 1;
            context.memory.enter(Stage::Table);
            let Surface { position, normal, geometric_normal, .. } = self.surface;
            let frame = context.frame;
            let mut nearest = NearestPhotons::new(candidates, frame.neighbors, frame.max_distance);
            let tested = search(context, PhotonMap::Indirect, position, &mut nearest)?;
            context.counters.count_gather(tested, nearest.taken(), nearest.selected(), nearest.len() as u32);
            let code = encode_normal(geometric_normal.to_array());
            IncidentFlux::new(&nearest, normal, code, reflector.albedo()).table(sampling, &reflector)
        };
        Ok(())
    }
}
