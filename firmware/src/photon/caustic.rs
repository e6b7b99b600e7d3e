//! Radiance reflected from caustic photons. Each photon is spread over a disc with its own radius: a kernel
//! estimate with sample-point bandwidths (Abramson 1982, *On bandwidth variation in kernel estimates*).
//!
//! `L = sum f(incoming) power K(d / h)`, over the photons of the surface within their radii `h`, with the
//! Epanechnikov kernel `K = 2 (1 - d^2 / h^2) / (pi h^2)`. The integral of the kernel over a plane is 1, so
//! that a photon contributes its power whatever the density of others. The host chooses each radius from the
//! density of the light that the photon belongs to. Boxes of the tree contain the discs of their photons, so
//! that a search visits the boxes that contain its position.

use core::f32::consts::PI;

use glam::Vec3;
use photoncard_shared::layout::{PhotonNode, decode_direction, kernel_share};
use photoncard_shared::message::Fault;

use super::collector::{Collector, Lanes};
use super::region::All;
use super::{Candidate, MIN_NORMAL_COSINE, PhotonMap, SameSurface, leaves};
use crate::fixed_point::ColourSum;
use crate::memory::MemoryPort;
use crate::scene::{DecodedLobe, PartialReflection, SceneImage};
use crate::simd::{self, Isa, Kernel, LANES};
use crate::vector::max;

/// Light that caustic photons bring to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Caustics {
    /// Reflected radiance, in the unit to which the partial reflection converts photon power units/m^2.
    pub radiance: Vec3,
    /// Number of photons of the point's surface whose discs contain the point.
    pub photons: u32,
    /// Number of photon normals decoded.
    pub normals_decoded: u32,
}

/// Photons that light a lobe. All photons light the Lambertian part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LitBy {
    /// All photons.
    All,
    /// Photons of point, spot and distant lights, which have no area.
    Punctual,
}

/// Radiance of caustic photons reflected at a position ([`CausticSearch`]).
///
/// # Errors
/// If the card image is invalid.
#[inline(always)]
pub fn reflected_caustics(search: CausticSearch<'_, impl MemoryPort>) -> Result<Caustics, Fault> {
    simd::run(search)
}

/// Kernel of [`reflected_caustics`].
pub struct CausticSearch<'s, M> {
    /// The scene, with its caustic map.
    pub scene: &'s SceneImage,
    /// Card memory.
    pub memory: &'s mut M,
    /// Query position, metres.
    pub position: Vec3,
    /// Maximum kernel radius of a photon, metres: that of the last code of [`kernel_share`].
    pub max_radius: f32,
    /// Reflection at the position.
    pub reflection: &'s PartialReflection,
    /// Lobe of the reflection.
    pub lobe: DecodedLobe,
    /// Photons that light the lobe.
    pub lit_by: LitBy,
    /// Unit shading normal `n` and unit normal `g` of the triangle. A photon from the direction `i` is
    /// weighted by `n.i / g.i`, because the density of photons is the irradiance of the triangle.
    pub normals: [Vec3; 2],
}

/// Maximum of `n.i / g.i`, for light at grazing incidence on the triangle.
const MAX_SHADING: f32 = 4.0;
/// Maximum distance of a box that a search visits, cells of the photon grid. It allows for rounding at the
/// borders of the scene.
const MARGIN_CELLS: f32 = 2.0;
/// Slope of the direction to a photon, against the tangent plane, that is allowed for the rounding of coded
/// normals.
const FLAT_SLOPE: f32 = 0.15;
/// Unit of a photon's factor `(1 - d^2 / h^2) / s` in the sums, where `s` is the disc's area over the maximum
/// area. Fifty photons with the smallest disc stay below the limit of a [`ColourSum`], and one with the
/// largest disc has a resolution of twenty bits.
const FACTOR_UNIT: f32 = 32_768.0;

impl<M: MemoryPort> Kernel for CausticSearch<'_, M> {
    type Output = Result<Caustics, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, position, max_radius, reflection, lobe, lit_by, normals } = self;
        let margin = MARGIN_CELLS * scene.header.photon_grid.cell;
        let max_squared = max(max_radius * max_radius, f32::MIN_POSITIVE);
        let mut sums = Sums {
            limit: margin * margin,
            max_squared,
            reflection,
            lobe,
            lit_by,
            normals,
            surface: SameSurface::new(reflection.normal()),
            classes: SameSurface::classes(reflection.normal()),
            power: ColourSum::ZERO,
            of_lobe: ColourSum::ZERO,
            photons: 0,
        };
        leaves::gather(isa, scene, PhotonMap::Caustics.sections(), memory, (position, &All), &mut sums)?;
        let area = PI * max_squared;
        let reflected = reflection.reflected(&sums.power, &sums.of_lobe);
        Ok(Caustics {
            radiance: reflected * (2.0 * FACTOR_UNIT / area),
            photons: sums.photons,
            normals_decoded: sums.surface.decoded(),
        })
    }
}

/// Sums over the photons whose discs contain the position. The order of photons does not matter.
struct Sums<'a> {
    /// Squared maximum distance of a box that the search visits, m^2.
    limit: f32,
    /// Squared maximum kernel radius, m^2.
    max_squared: f32,
    reflection: &'a PartialReflection,
    lobe: DecodedLobe,
    lit_by: LitBy,
    normals: [Vec3; 2],
    surface: SameSurface,
    /// Bit mask of the classes of normals that photons of the surface can have ([`SameSurface::classes`]).
    classes: u16,
    /// Sum of power times kernel factor, in units of [`FACTOR_UNIT`].
    power: ColourSum,
    /// Sum of power times kernel factor times [`PartialReflection::lobe_factor`].
    of_lobe: ColourSum,
    photons: u32,
}

impl Sums<'_> {
    /// Adds a photon; `way` is the vector from the photon to the position, metres.
    #[inline(always)]
    fn add(&mut self, photon: &Candidate, way: Vec3) {
        let share = kernel_share(photon.disc());
        let from_edge = 1.0 - photon.distance_squared() / (self.max_squared * share);
        // False for NaN as well.
        let is_within = from_edge > 0.0;
        if !is_within {
            return;
        }
        let cosine = self.surface.cosine(photon.normal());
        if cosine < MIN_NORMAL_COSINE || !self.is_on_surface(photon.distance_squared(), way, cosine) {
            return;
        }
        self.photons += 1;
        let factor = from_edge / (share * FACTOR_UNIT) * self.shading(photon);
        let power = Vec3::from_array(photon.power().decode()) * factor;
        self.power.add_light(power);
        let is_lit = self.lit_by == LitBy::All || !photon.is_direct();
        if is_lit && !self.reflection.is_lambertian() {
            self.of_lobe.add_light(power * PartialReflection::lobe_factor(&self.lobe, photon.direction()));
        }
    }

    /// Returns whether a photon may be on the surface; `cosine` is the cosine between the normals of photon
    /// and surface. Two points of a sphere whose normals are at an angle `t` lie in a direction at `t / 2` to
    /// the tangent plane. Photons farther off the plane are on another sheet, such as the far side of a wall.
    #[inline(always)]
    fn is_on_surface(&self, distance_squared: f32, way: Vec3, cosine: f32) -> bool {
        let [_, geometric] = self.normals;
        let height = geometric.dot(way);
        let slope_squared = 2.0 * (FLAT_SLOPE * FLAT_SLOPE + (1.0 - cosine) / (1.0 + cosine));
        let across_squared = max(distance_squared - height * height, 0.0);
        height * height <= slope_squared * across_squared + self.limit
    }

    /// Factor `n.i / g.i`, at most [`MAX_SHADING`]; 0 for light from below the horizon of `n`.
    #[inline(always)]
    fn shading(&self, photon: &Candidate) -> f32 {
        let [shading, geometric] = self.normals;
        if shading == geometric {
            return 1.0;
        }
        let incident = Vec3::from_array(decode_direction(photon.direction()));
        let [shading, geometric] = [shading, geometric].map(|normal| max(normal.dot(incident), 0.0));
        if shading < MAX_SHADING * geometric { shading / geometric } else { MAX_SHADING }
    }
}

impl Collector for Sums<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn skipped(&self, node: PhotonNode) -> u16 {
        node.children_without(self.classes)
    }

    #[inline(always)]
    fn insert_lanes(&mut self, isa: impl Isa, count: u32, lanes: &Lanes) {
        let Lanes { distances, contents, ways: [x, y, z] } = *lanes;
        let mut beyond = [0; LANES];
        for ((beyond, &distance), &content) in beyond.iter_mut().zip(distances).zip(contents) {
            let photon = Candidate { distance, content };
            *beyond = u32::from(photon.distance_squared() >= self.max_squared * kernel_share(photon.disc()));
        }
        let mut mask = isa.below(&beyond, 1) & !(u32::MAX << count);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let (Some(&distance), Some(&content)) = (distances.get(lane), contents.get(lane)) else { break };
            let (Some(&x), Some(&y), Some(&z)) = (x.get(lane), y.get(lane), z.get(lane)) else { break };
            let photon = Candidate::new(f32::from_bits(distance), content.to_le_bytes());
            self.add(&photon, Vec3::new(x, y, z));
        }
    }
}
