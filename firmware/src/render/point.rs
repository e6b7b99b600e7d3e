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

/// Origin of final gather rays.
#[derive(Clone, Copy, Debug)]
pub struct GatherPoint {
    /// Surface at the point. It has its whole reflection, whatever the purpose of the rays.
    pub surface: Surface,
    /// Random numbers of the rays.
    pub pattern: Pattern,
    /// Number of rays. Without rays, all direct light comes from shadow rays.
    pub rays: u32,
    /// Shares of the rays by direction.
    pub directions: DirectionTable,
    /// The purpose of the rays.
    pub purpose: Purpose,
    /// Weight of the rays' light in the sum that it is added to.
    pub weight: f32,
}

/// Purpose of a point's gather rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The rays gather all light that a sample reflects.
    Sample,
    /// The rays gather the light that a sample's lobe reflects. Irradiance records light its Lambertian part.
    Lobe,
    /// The rays gather the irradiance of a record, which many samples share.
    Record,
}

/// Minimum number of gather rays for which photons are searched for a direction table. The search costs as
/// much as a gather ray, and fewer rays are spread too thinly over the cells to profit
/// (`docs/techniques.md`).
const MIN_RAYS_OF_SEARCH: u32 = 8;

impl GatherPoint {
    /// Point with rays for all light that a sample reflects.
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

    /// Point with rays for the irradiance of a record. Its surface is white.
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

    /// Point with rays for a surface's lobe. It has [`Reflector::lobe_share`] of the rays.
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

    /// Part of the reflection that the rays serve, seen from the eye.
    #[inline(always)]
    pub fn reflector(&self) -> Reflector {
        let reflector = self.surface.reflector();
        let is_of_lobe = self.purpose == Purpose::Lobe;
        let reflection = reflector.reflection;
        let reflection = if is_of_lobe { reflection.without_lambertian() } else { reflection };
        Reflector { reflection, ..reflector }
    }

    /// Chooses the shares of the directions. Points with few rays use the reflection, others the frame's
    /// sampling method, which may search for the nearest photons.
    ///
    /// # Errors
    /// If the image is invalid.
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
