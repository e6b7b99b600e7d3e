//! Precomputed irradiance (Christensen 1999, *Faster photon map global illumination*). The host precomputes
//! the irradiance at points on all surfaces. At a Lambertian surface, the irradiance of the nearest point
//! replaces a density estimate.
//!
//! The points are in a tree of their own, whose leaves have the format of photon leaves. The search is for
//! one point: the distance of the nearest point found so far is the search radius.

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::IrradiancePoint;
use photoncard_shared::message::Fault;

use super::collector::{Collector, Lanes};
use super::region::All;
use super::{Candidate, SameSurface, leaves};
use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::simd::{self, Isa, Kernel};

/// Sections of the nodes and of the leaves of irradiance points.
const SECTIONS: [SectionKind; 2] = [SectionKind::IrradianceNodes, SectionKind::IrradianceLeaves];

/// Result of a search for an irradiance point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundIrradiance {
    /// Irradiance at the nearest point, photon power units/m^2; 0 if there is none.
    pub irradiance: Vec3,
    /// Number of points whose distance was computed.
    pub tested: u32,
}

/// Finds the irradiance point nearest to `position`, within `max_distance` metres, and returns its
/// irradiance. Only points whose normal agrees with `normal`, the code of the surface normal, are considered
/// ([`SameSurface`]). Contents of points break ties between equal distances.
///
/// # Errors
/// If the card image is invalid.
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

/// Search of [`nearest_irradiance`], compiled for every instruction set.
pub struct PointSearch<'s, M> {
    /// The scene, with its irradiance points.
    pub scene: &'s SceneImage,
    /// Card memory.
    pub memory: &'s mut M,
    /// Query position, metres.
    pub position: Vec3,
    /// Code of the surface normal at the query position.
    pub normal: u8,
    /// Maximum distance, metres.
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
        // A scene without photons has no points, and the tree no root.
        if scene.header.section(SectionKind::IrradianceLeaves).records > 0 {
            tested = leaves::gather(isa, scene, SECTIONS, memory, (position, &All), &mut nearest)?;
        }
        Ok(FoundIrradiance { irradiance: nearest.irradiance(), tested })
    }
}

/// The nearest point found so far.
struct NearestPoint {
    surface: SameSurface,
    /// Squared search radius, m^2: the squared distance of `nearest`, if a point was found.
    limit: f32,
    nearest: Option<Candidate>,
}

impl NearestPoint {
    #[inline(always)]
    fn irradiance(&self) -> Vec3 {
        // A candidate has lost two bits of the point's normal, which is no longer needed.
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
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, lanes: &Lanes) {
        let Lanes { distances, contents, .. } = *lanes;
        // No overflow: the bits of infinity are below `u32::MAX`.
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
