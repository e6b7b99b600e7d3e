//! Precomputed irradiance (Christensen 1999, *Faster photon map global illumination*): the host has estimated the irradiance at
//! points of all surfaces, as a gather there would, and a Lambertian surface takes that of the nearest one.
//!
//! Points lie in leaves of a tree of their own, of the kind that photons lie in. Only one is looked for, so the limit of the
//! search is its distance as soon as there is one.

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::IrradiancePoint;
use photoncard_shared::message::Fault;

use super::collector::Collector;
use super::{Candidate, SameSurface, leaves};
use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::simd::{self, Isa, Kernel, LANES};

/// The sections of irradiance points: inner nodes, and leaves.
const SECTIONS: [SectionKind; 2] = [SectionKind::IrradianceNodes, SectionKind::IrradianceLeaves];

/// What a search for an irradiance point found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundIrradiance {
    /// Irradiance at the nearest point of the surface, photon power units a square metre; zero without one.
    pub irradiance: Vec3,
    /// Points whose distance was computed.
    pub tested: u32,
}

/// Searches the irradiance point nearest to `position` of the surface that has a normal of this code there, no farther than
/// `max_distance`, metres. Of several at one distance what they carry decides.
///
/// # Errors
/// If the image is not sound.
#[inline(always)]
pub fn nearest_irradiance(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    position: Vec3,
    normal: u8,
    max_distance: f32,
) -> Result<FoundIrradiance, Fault> {
    simd::run(PointSearch { scene, memory, position, normal, max_distance })
}

/// What [`nearest_irradiance`] does, for any processor.
pub struct PointSearch<'s, M> {
    /// The scene, with its irradiance points.
    pub scene: &'s SceneImage,
    /// Card memory.
    pub memory: &'s mut M,
    /// Where to search, metres.
    pub position: Vec3,
    /// Code of the surface normal there.
    pub normal: u8,
    /// How far to search, metres.
    pub max_distance: f32,
}

impl<M: MemoryPort> Kernel for PointSearch<'_, M> {
    type Output = Result<FoundIrradiance, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, position, normal, max_distance } = self;
        let limit = max_distance * max_distance;
        let mut nearest = NearestPoint { surface: SameSurface::new(normal), limit, nearest: None };
        let mut tested = 0;
        // Without photons there are no points, and no root.
        if scene.header.section(SectionKind::IrradianceLeaves).records > 0 {
            tested = leaves::gather(isa, scene, SECTIONS, memory, position, &mut nearest)?;
        }
        Ok(FoundIrradiance { irradiance: nearest.irradiance(), tested })
    }
}

/// The nearest point of a surface so far.
struct NearestPoint {
    surface: SameSurface,
    /// Its squared distance; without one that of the search, m^2.
    limit: f32,
    nearest: Option<Candidate>,
}

impl NearestPoint {
    #[inline(always)]
    fn irradiance(&self) -> Vec3 {
        // A candidate has lost two bits of the normal, which has been looked at.
        let read = |point: Candidate| IrradiancePoint::read(point.content.to_le_bytes()).irradiance.into();
        self.nearest.map_or(Vec3::ZERO, read)
    }
}

impl Collector for NearestPoint {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, distances: &[u32; LANES], contents: &[u64; LANES]) {
        // No overflow: the bits of an infinite limit are not the greatest.
        let mut mask = isa.below(distances, self.limit.to_bits() + 1) & !(u32::MAX << count);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let (Some(&distance), Some(&content)) = (distances.get(lane), contents.get(lane)) else { break };
            let point = Candidate::new(f32::from_bits(distance), content.to_le_bytes());
            if self.nearest.is_none_or(|nearest| point.order() < nearest.order())
                && self.surface.holds(IrradiancePoint::normal_of(content))
            {
                self.limit = point.distance_squared();
                self.nearest = Some(point);
            }
        }
    }
}
