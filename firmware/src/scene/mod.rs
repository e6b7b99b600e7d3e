//! The scene in card memory, read line by line.

mod bundle;
mod bvh;
pub mod camera;
mod corners;
mod coverage;
mod cut_out;
mod flat_glass;
pub mod light;
mod materials;
mod normal_map;
mod reflection;
mod seen;
mod shading_normal;
mod slabs;
mod specular;
mod surface;
mod texture;
mod triangle;
mod triangles;

pub use bundle::{BUNDLE_RAYS, Bundle, closest_hits, transmittances};
pub use bvh::{ClosestHit, Passed, ShadowRay, closest_hit, for_each_hit, transmittance};
pub use cut_out::is_there;
pub use reflection::{
    DecodedLobe, PartialReflection, ReflectedDirection, Reflection, Reflector, keeps_photons,
};
pub use seen::Seen;
pub use specular::Specular;
pub use surface::{Detail, SURFACE_CHOICES, Surface, read_surface, read_surface_with};
pub use texture::{decode_texel, read_texture, sample_texture};
pub use triangle::{Hit, Intersection, RayFrame};
pub use triangles::read_identity;

use core::ops::Range;

use glam::Vec3;
use photoncard_shared::address::{LINE_BYTES, LineAddress, Structure};
use photoncard_shared::image::{Header, SectionKind};
use photoncard_shared::message::{Fault, FaultCode};

use crate::memory::MemoryPort;
use crate::simd::Isa;

/// A ray: the points `origin + t direction` with `t` in (0, `max_distance`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin, metres.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Maximum distance from the origin, metres.
    pub max_distance: f32,
    /// Purpose of the ray.
    pub kind: RayKind,
}

/// Purpose of a ray. Some surfaces exist for rays of some kinds only
/// ([`HIDDEN`](photoncard_shared::layout::HIDDEN), [`LAMP`](photoncard_shared::layout::LAMP)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayKind {
    /// The ray of a pixel.
    Eye,
    /// Radiance that arrives at a surface.
    Radiance,
    /// Light between two points: shadow rays, photons, and tests of what lies between.
    Light,
}

impl Ray {
    /// Ray of a kind with infinite maximum distance.
    #[inline(always)]
    pub fn new(kind: RayKind, origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, max_distance: f32::INFINITY, kind }
    }

    /// Ray of light up to a distance, metres.
    #[inline(always)]
    pub fn of_light(origin: Vec3, direction: Vec3, max_distance: f32) -> Self {
        Self { origin, direction, max_distance, kind: RayKind::Light }
    }
}

/// Scene data in card memory (card image): sections of records, located by the header.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneImage {
    /// Validated header.
    pub header: Header,
}

impl SceneImage {
    /// Reads record `index` of a section. A record has `N` bytes; a line holds `PER_LINE` records.
    ///
    /// # Errors
    /// [`FaultCode::Record`] if there is no record `index`; [`FaultCode::LineRange`] if its line is outside
    /// the memory.
    #[inline(always)]
    pub fn record<'m, const N: usize, const PER_LINE: u32>(
        &self,
        memory: &'m mut impl MemoryPort,
        kind: SectionKind,
        index: u32,
    ) -> Result<&'m [u8; N], Fault> {
        let fault = Fault { code: FaultCode::Record, detail: index };
        let (line, slot) = self.header.section(kind).locate::<PER_LINE>(index).ok_or(fault)?;
        let first = slot as u32 * N as u32;
        read_slot(memory, kind.structure(), line, slot, first..first + N as u32).ok_or(fault)?
    }

    /// Reads line `index` of a section whose records are one line each. `used` is the range of the line's
    /// bytes that the caller needs; the statistics of memory traffic count these bytes as requested.
    ///
    /// # Errors
    /// As [`Self::record`].
    #[inline(always)]
    pub fn line<'m>(
        &self,
        memory: &'m mut impl MemoryPort,
        kind: SectionKind,
        index: u32,
        used: Range<u32>,
    ) -> Result<&'m [u8; LINE_BYTES], Fault> {
        let fault = Fault { code: FaultCode::Record, detail: index };
        let (line, slot) = self.header.section(kind).locate::<1>(index).ok_or(fault)?;
        read_slot(memory, kind.structure(), line, slot, used).ok_or(fault)?
    }

    /// Prefetches line `index` of a section whose records are one line each.
    #[inline(always)]
    pub(crate) fn prefetch(&self, isa: impl Isa, memory: &impl MemoryPort, kind: SectionKind, index: u32) {
        let line = self.header.section(kind).locate::<1>(index);
        if let Some(line) = line.and_then(|(line, _)| memory.near(line)) {
            isa.prefetch(line);
        }
    }
}

#[inline(always)]
fn read_slot<const N: usize>(
    memory: &mut impl MemoryPort,
    structure: Structure,
    line: LineAddress,
    slot: usize,
    used: Range<u32>,
) -> Option<Result<&[u8; N], Fault>> {
    match memory.read(structure, line, used) {
        Ok(line) => line.record::<N>(slot).map(Ok),
        Err(fault) => Some(Err(fault)),
    }
}

/// Moves a point just off its surface, towards `normal`, so that a ray from there does not hit it again.
///
/// A computed point deviates from the triangle's plane by a few units in the last place of `magnitude`, the
/// greatest absolute coordinate of the corners and of the ray's origin. The offset is 32 such units.
#[inline(always)]
pub fn offset_origin(position: Vec3, normal: Vec3, magnitude: f32) -> Vec3 {
    position + normal * (magnitude * (32.0 * f32::EPSILON) + f32::MIN_POSITIVE)
}

/// Greatest absolute coordinate among all the points; 0 without points.
#[inline(always)]
pub fn magnitude(points: &[Vec3]) -> f32 {
    points
        .iter()
        .fold(0.0, |greatest, point| crate::vector::max(crate::vector::max_component(point.abs()), greatest))
}
