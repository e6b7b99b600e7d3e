//! Density estimate of the radiance that caustic photons reflect. Each photon is spread over a disc with its
//! own radius (variable bandwidth: Abramson 1982, *On bandwidth variation in kernel estimates*).
//!
//! `L = sum f(incoming) power K(d)`, with the Epanechnikov kernel `K(d) = 2 (1 - d^2 / h^2) / (pi h^2)`. The
//! sum is over the photons of the surface whose distance `d` is less than their radius `h`. The integral of
//! the kernel over a plane is 1: each photon contributes its power. The host chooses each radius from the
//! density of photons with similar directions. The boxes of the tree contain the discs of their photons, so
//! that a search visits only the boxes around its position.

use core::f32::consts::PI;

use glam::Vec3;
use photoncard_shared::budget::MAX_LIGHT_GROUPS;
use photoncard_shared::layout::{PhotonNode, decode_direction, kernel_share};
use photoncard_shared::message::Fault;

use super::collector::{Collector, Lanes};
use super::region::All;
use super::{Candidate, MIN_NORMAL_COSINE, PhotonMap, SameSurface, leaves};
use crate::fixed_point::ColourSum;
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::MemoryPort;
use crate::scene::{DecodedLobe, PartialReflection, SceneImage};
use crate::simd::{self, Isa, Kernel, LANES};
use crate::vector::max;

/// Result of a caustic density estimate at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Caustics {
    /// Reflected radiance, photon power units/(sr m^2), times the weight in the `PartialReflection`.
    pub radiance: GroupedLight,
    /// Number of photons of the point's surface whose discs contain the point.
    pub photons: u32,
    /// Number of photon normals decoded.
    pub normals_decoded: u32,
}

/// Choice of the photons that are gathered for a lobe. For the Lambertian part, all are gathered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LitBy {
    /// All photons.
    All,
    /// Photons of point, spot and distant lights, which have no area.
    Punctual,
}

/// Radiance that caustic photons reflect at the position of a [`CausticSearch`].
///
/// # Errors
/// If the card image is invalid.
#[inline(always)]
pub fn reflected_caustics(search: CausticSearch<'_, impl MemoryPort>) -> Result<Caustics, Fault> {
    simd::run(search)
}

/// Search of [`reflected_caustics`], compiled for every instruction set.
pub struct CausticSearch<'s, M> {
    /// The scene, with its caustic map.
    pub scene: &'s SceneImage,
    /// Card memory.
    pub memory: &'s mut M,
    /// Query position, metres.
    pub position: Vec3,
    /// Maximum kernel radius of a photon, metres: the radius at which [`kernel_share`] is 1.
    pub max_radius: f32,
    /// Reflection at the position.
    pub reflection: &'s PartialReflection,
    /// Lobe of the reflection.
    pub lobe: DecodedLobe,
    /// Photons that are gathered for the lobe.
    pub lit_by: LitBy,
    /// `[n, g]`: unit shading normal and unit normal of the triangle. A photon from the direction `i` has the
    /// weight `n.i / g.i`, because the density of photons includes the factor `g.i` instead of `n.i`.
    pub normals: [Vec3; 2],
    /// Light groups whose light is summed separately.
    pub groups: LightGroups,
}

/// Maximum of the weight `n.i / g.i` (`CausticSearch::normals`).
const MAX_SHADING: f32 = 4.0;
/// Maximum distance from the position to a box that a search visits, in cells of the photon grid. It allows
/// for rounding at the borders of the scene.
const MARGIN_CELLS: f32 = 2.0;
/// Maximum slope, relative to the tangent plane, of the line from the position to a photon on the same flat
/// surface. It is not zero because coded normals are rounded.
const FLAT_SLOPE: f32 = 0.15;
/// Divisor of a photon's factor `(1 - d^2 / h^2) / s` in the sums. Here `s` is the area of the photon's disc
/// divided by the maximum area. Fifty photons with the smallest disc stay below the limit of a [`ColourSum`];
/// a photon with the largest disc has a resolution of twenty bits.
const FACTOR_UNIT: f32 = 32_768.0;

impl<M: MemoryPort> Kernel for CausticSearch<'_, M> {
    type Output = Result<Caustics, Fault>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let Self { scene, memory, position, max_radius, reflection, lobe, lit_by, normals, groups } = self;
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
            groups,
            power: [ColourSum::ZERO; MAX_LIGHT_GROUPS],
            of_lobe: [ColourSum::ZERO; MAX_LIGHT_GROUPS],
            photons: 0,
        };
        leaves::gather(isa, scene, PhotonMap::Caustics.sections(), memory, (position, &All), &mut sums)?;
        let area = PI * max_squared;
        let mut of_groups = sums.power.iter().zip(&sums.of_lobe);
        let reflected = GroupedLight::of_groups(groups, |_| match of_groups.next() {
            Some((power, of_lobe)) => reflection.reflected(power, of_lobe),
            None => Vec3::ZERO,
        });
        Ok(Caustics {
            radiance: reflected * (2.0 * FACTOR_UNIT / area),
            photons: sums.photons,
            normals_decoded: sums.surface.decoded(),
        })
    }
}

/// Sums over the photons whose discs contain the position; independent of the photons' order.
struct Sums<'a> {
    /// Squared maximum distance of a box that the search visits, m^2 (`MARGIN_CELLS`).
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
    groups: LightGroups,
    /// Sum of power times kernel factor, divided by [`FACTOR_UNIT`], by light group.
    power: [ColourSum; MAX_LIGHT_GROUPS],
    /// Sum of power times kernel factor times [`PartialReflection::lobe_factor`], divided by [`FACTOR_UNIT`].
    of_lobe: [ColourSum; MAX_LIGHT_GROUPS],
    photons: u32,
}

impl Sums<'_> {
    /// Adds a photon of the surface if its disc contains the position. `way` points from photon to position.
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
        let group = self.groups.index(photon.light_group());
        let (Some(sum), Some(of_lobe)) = (self.power.get_mut(group), self.of_lobe.get_mut(group)) else {
            return;
        };
        sum.add_light(power);
        let is_lit = self.lit_by == LitBy::All || !photon.is_direct();
        if is_lit && !self.reflection.is_lambertian() {
            of_lobe.add_light(power * PartialReflection::lobe_factor(&self.lobe, photon.direction()));
        }
    }

    /// Returns true if a photon may lie on the surface. `cosine` is the cosine between the normals of photon
    /// and surface. On a sphere, the line between two points whose normals enclose the angle `t` is at
    /// `t / 2` to the tangent planes. Photons farther off the tangent plane are on another sheet, such as the
    /// far side of a wall.
    #[inline(always)]
    fn is_on_surface(&self, distance_squared: f32, way: Vec3, cosine: f32) -> bool {
        let [_, geometric] = self.normals;
        let height = geometric.dot(way);
        let slope_squared = 2.0 * (FLAT_SLOPE * FLAT_SLOPE + (1.0 - cosine) / (1.0 + cosine));
        let across_squared = max(distance_squared - height * height, 0.0);
        height * height <= slope_squared * across_squared + self.limit
    }

    /// Weight `n.i / g.i` of a photon, at most [`MAX_SHADING`]; 0 for light from below the horizon of `n`.
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
