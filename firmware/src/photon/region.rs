//! Visible region: the part of a gather's sphere that is visible from the gather's point. It replaces the
//! sphere where walls hide photons from the point.
//!
//! A density estimate over a sphere would count photons in the next room, or behind a thin wall that stands
//! on the surface. Sixteen rays along the surface, a little above it, measure the free distance in as many
//! directions, and divide the disc into sectors. A sector ends before the straight line between the ends of
//! its two border rays, so that it contains no photon behind a plane wall. The density estimate divides by
//! the area of the sectors.
//!
//! Photons far off the tangent plane belong to other surfaces, such as the boards of a shelf. The region
//! therefore excludes a double cone about the normal. It also ends below any object that covers the point:
//! behind furniture, photons on the far side of the wall have the same normal as the furniture's back.

use core::f32::consts::PI;

use glam::Vec3;
use photoncard_shared::message::Fault;

use super::MIN_NORMAL_COSINE;
use super::same_surface::unit_normal;
use crate::memory::{MemoryPort, Stage};
use crate::scene::{BUNDLE_RAYS, Hit, Ray, SceneImage, closest_hit, closest_hits, magnitude, offset_origin};
use crate::simd::{HALF_LANES, Isa, LANES};
use crate::vector::{max, max_component, min, tangents, unit};

/// Number of sectors.
pub const SECTORS: usize = BUNDLE_RAYS;

/// Height of the rays along the surface, divided by the gather radius, if nothing covers the point closely.
/// Objects below this height hide nothing.
const HEIGHT: f32 = 0.03;
/// Factor of the height `LIFT * radius + cell` at which rays along the normal start. `radius` is the gather
/// radius, and `cell` is the side of a cell of the photon grid.
const LIFT: f32 = 1e-3;
/// Maximum slope, against the tangent plane, of the direction to a photon of the region.
const MAX_SLOPE: f32 = 0.4;
/// Radius of a sector, divided by the length of the shorter of its two border rays: the cosine of half the
/// sector's angle, less half a percent for rounding.
const WITHIN: f32 = 0.976;
/// Radius of a sector of `VisibleRegion::outer`, divided by the length of the longer of its two border
/// rays.
const BEYOND: f32 = 1.02;
/// Height of the region, divided by the distance of an object that covers the point.
const BELOW: f32 = 0.9;
const TAN_PI_8: f32 = 0.414_213_57;
/// Cosines of the multiples of `pi / 8` up to `pi / 2`.
const COSINES: [f32; 5] = [1.0, 0.923_879_5, 0.707_106_77, 0.382_683_43, 0.0];

/// Region around a point: sixteen sectors of the tangent plane, with a maximum distance from the plane.
#[derive(Clone, Copy, Debug)]
pub struct Sectors {
    /// Squared radius of each sector, m^2.
    limits: [f32; SECTORS],
    /// Squared maximum distance from the tangent plane, m^2, at the region's centre.
    lift_squared: f32,
}

/// Region that is visible from a point, and its coordinate frame.
#[derive(Clone, Copy, Debug)]
pub struct VisibleRegion {
    /// Two unit tangents and the unit normal.
    pub axes: [Vec3; 3],
    /// Region that lies within the visible part of the surface.
    pub sectors: Sectors,
    /// Larger region that contains the visible part of the surface.
    pub outer: Sectors,
    /// Height above the surface, metres, just below the object that covers the point. Photons higher up are
    /// on that object's far side.
    ceiling: f32,
}

impl Sectors {
    /// Converts the sectors to units of `unit` metres.
    #[must_use]
    pub fn scaled(&self, unit: f32) -> Self {
        let per_unit = 1.0 / (unit * unit);
        Self { limits: self.limits.map(|limit| limit * per_unit), lift_squared: self.lift_squared * per_unit }
    }

    /// Area, in the tangent plane, of the part of the sectors within a radius. Area and `radius_squared` are
    /// in m^2, or in squares of the unit given to [`Self::scaled`].
    pub fn area(&self, radius_squared: f32) -> f32 {
        let squares: f32 = self.limits.iter().map(|limit| min(*limit, radius_squared)).sum();
        squares * (PI / SECTORS as f32)
    }

    /// Upper bound of the squared distance of the region's points from its centre, m^2.
    pub(super) fn reach_squared(&self) -> f32 {
        let greatest = self.limits.iter().copied().fold(0.0, max);
        greatest * (1.0 + MAX_SLOPE * MAX_SLOPE) + self.lift_squared
    }

    /// Sets the lanes of `outside` to 1 for points outside the region, else to 0. Points are given by their
    /// coordinates along the region's axes, relative to its centre.
    #[inline(always)]
    pub fn test(&self, isa: impl Isa, [u, v, w]: [&[f32; LANES]; 3], outside: &mut [u32; LANES]) {
        let mut indices = [0; LANES];
        for (index, (&u, &v)) in indices.iter_mut().zip(u.iter().zip(v)) {
            *index = sector(u, v);
        }
        let (halves, _) = indices.as_chunks::<HALF_LANES>();
        let mut limits = [0.0; LANES];
        for (limits, half) in limits.as_chunks_mut().0.iter_mut().zip(halves) {
            *limits = isa.permute(&self.limits, half);
        }
        let points = u.iter().zip(v).zip(w);
        for ((outside, limit), ((u, v), w)) in outside.iter_mut().zip(limits).zip(points) {
            let across = u * u + v * v;
            let most = MAX_SLOPE * MAX_SLOPE * across + self.lift_squared;
            *outside = if (across <= limit) & (w * w <= most) { 0 } else { 1 };
        }
    }

    /// Returns true if a point, given as in `Self::test`, is in the region.
    #[inline(always)]
    fn holds(&self, [u, v, w]: [f32; 3]) -> bool {
        let across = u * u + v * v;
        let limit = self.limits.get(sector(u, v) as usize % SECTORS).copied().unwrap_or(0.0);
        across <= limit && w * w <= MAX_SLOPE * MAX_SLOPE * across + self.lift_squared
    }
}

/// Number of the sector that contains the direction `(u, v)`. Bits 0 and 1 number the four sectors of a
/// quadrant, from the `u` axis to the `v` axis. Bits 2 and 3 are set for negative `u` and `v`.
#[inline(always)]
fn sector(u: f32, v: f32) -> u32 {
    let (a, b) = (max(u, -u), max(v, -v));
    let steps = u32::from(b > TAN_PI_8 * a) + u32::from(b > a) + u32::from(TAN_PI_8 * b > a);
    steps | u32::from(u < 0.0) << 2 | u32::from(v < 0.0) << 3
}

/// Numbers of the two rays at the borders of a sector. Ray `i` has the azimuth `i pi / 8`.
fn borders(sector: usize) -> [usize; 2] {
    let steps = sector % 4;
    let ray = |steps: usize| match sector / 4 {
        0 => steps,
        1 => SECTORS / 2 - steps,
        2 => (SECTORS - steps) % SECTORS,
        _ => SECTORS / 2 + steps,
    };
    [ray(steps), ray(steps + 1)]
}

/// `[cosine, sine]` of the azimuth `ray pi / 8`.
fn azimuth(ray: usize) -> [f32; 2] {
    let (quarter, steps) = (ray / 4, ray % 4);
    let [c, s] = [steps, 4 - steps].map(|steps| COSINES.get(steps).copied().unwrap_or(0.0));
    match quarter {
        0 => [c, s],
        1 => [-s, c],
        2 => [-c, -s],
        _ => [s, -c],
    }
}

impl VisibleRegion {
    /// Finds the region visible from a point of a surface within `reach` metres, by tracing rays. Gathers
    /// have a radius of about `radius`, metres. `normal` is the code of the surface normal.
    ///
    /// # Errors
    /// If the card image is invalid.
    #[inline(never)]
    pub fn new(
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        (position, normal): (Vec3, u8),
        radius: f32,
        reach: f32,
    ) -> Result<Self, Fault> {
        let coded = unit_normal(normal);
        let lift = lift(scene, radius);
        let most = magnitude(&[position]);
        let above = offset_origin(position, coded, most) + coded * lift;
        let (clear, normal) = Self::clear_height(scene, memory, (above, coded), [MAX_SLOPE * reach, radius])?;
        let free = min(clear, 2.0 * HEIGHT * radius);
        let origin = offset_origin(position, normal, most) + normal * (lift + 0.5 * free);
        let (tangent, bitangent) = tangents(normal);
        let rays: [Ray; SECTORS] = core::array::from_fn(|ray| {
            let [cosine, sine] = azimuth(ray);
            let direction = tangent * cosine + bitangent * sine;
            Ray::of_light(origin, direction, reach)
        });
        let mut hits = [None; BUNDLE_RAYS];
        closest_hits(scene, memory, &rays, &mut hits)?;
        let lengths =
            hits.each_ref().map(|hit| hit.as_ref().map_or(f32::INFINITY, |hit| hit.intersection.distance));
        let limits = |choose: fn(f32, f32) -> f32, share: f32| {
            core::array::from_fn(|sector| {
                let [first, second] =
                    borders(sector).map(|ray| lengths.get(ray).copied().unwrap_or(f32::INFINITY));
                let limit = choose(first, second) * share;
                limit * limit
            })
        };
        let lift_squared = 4.0 * lift * lift;
        let ceiling = lift + BELOW * clear;
        Ok(Self {
            axes: [tangent, bitangent, normal],
            sectors: Sectors { limits: limits(min, WITHIN), lift_squared },
            outer: Sectors { limits: limits(max, BEYOND), lift_squared },
            ceiling,
        })
    }

    /// Returns the free height above the point `above`, metres (infinite if nothing is hit within `up`), and
    /// the unit normal of the surface below. This is the normal of the triangle hit within `down` if it
    /// agrees with the decoded normal `coded`, else `coded`.
    fn clear_height(
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        (above, coded): (Vec3, Vec3),
        [up, down]: [f32; 2],
    ) -> Result<(f32, Vec3), Fault> {
        let ray = |direction: Vec3, max_distance: f32| Ray::of_light(above, direction, max_distance);
        let mut hits = [None; BUNDLE_RAYS];
        closest_hits(scene, memory, &[ray(coded, up), ray(-coded, down)], &mut hits)?;
        let [ceiling, ground, ..] = &hits;
        let free = ceiling.as_ref().map_or(f32::INFINITY, |hit| hit.intersection.distance);
        let found = ground.as_ref().map(|hit| normal_of(hit, coded));
        let is_surface = |normal: &Vec3| normal.dot(coded) >= MIN_NORMAL_COSINE;
        Ok((free, found.filter(is_surface).unwrap_or(coded)))
    }
}

/// Distance from the surface, metres, at which rays along the normal start (`LIFT`).
fn lift(scene: &SceneImage, radius: f32) -> f32 {
    LIFT * radius + scene.header.photon_grid.cell
}

/// Returns true if an object covers a point so closely that a gather of radius `radius`, metres, may include
/// the object's photons. `normal` is the code of the surface normal.
///
/// # Errors
/// If the card image is invalid.
#[inline(never)]
pub(super) fn is_covered(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    (position, normal): (Vec3, u8),
    radius: f32,
) -> Result<bool, Fault> {
    let direction = unit_normal(normal);
    let origin = offset_origin(position, direction, magnitude(&[position])) + direction * lift(scene, radius);
    memory.enter(Stage::GatherRay);
    let up = closest_hit(scene, memory, &Ray::of_light(origin, direction, MAX_SLOPE * radius))?;
    memory.enter(Stage::Gather);
    Ok(up.is_some())
}

/// Unit normal of the hit triangle, on the side of `towards`; zero for a triangle without area.
fn normal_of(hit: &Hit, towards: Vec3) -> Vec3 {
    let [a, b, c] = hit.triangle.vertices.map(Vec3::from);
    let (b, c) = (b - a, c - a);
    // Edges are divided by the triangle's size, whose square may overflow.
    let size = max(max_component(b.abs()), max_component(c.abs()));
    let normal = if size > 0.0 { unit((b * (1.0 / size)).cross(c * (1.0 / size))) } else { Vec3::ZERO };
    if normal.dot(towards) < 0.0 { -normal } else { normal }
}

/// Test by which a search accepts or rejects photons by their positions.
pub(super) trait Filter {
    /// Sets the distances of rejected photons to `u32::MAX`. `ways` are the vectors from the photons to the
    /// query, metres, by axis.
    fn filter(&self, isa: impl Isa, ways: [&[f32; LANES]; 3], distances: &mut [u32; LANES]);

    /// Returns true if a photon is accepted. `way` is the vector from the photon to the query, metres.
    fn takes(&self, way: [f32; 3]) -> bool;
}

/// Filter that accepts all photons.
pub(super) struct All;

impl Filter for All {
    #[inline(always)]
    fn filter(&self, _: impl Isa, _: [&[f32; LANES]; 3], _: &mut [u32; LANES]) {}

    #[inline(always)]
    fn takes(&self, _: [f32; 3]) -> bool {
        true
    }
}

impl Filter for VisibleRegion {
    #[inline(always)]
    fn filter(&self, isa: impl Isa, [x, y, z]: [&[f32; LANES]; 3], distances: &mut [u32; LANES]) {
        let mut along = [[0.0; LANES]; 3];
        for (along, axis) in along.iter_mut().zip(self.axes) {
            let [a, b, c] = axis.to_array();
            for (along, ((x, y), z)) in along.iter_mut().zip(x.iter().zip(*y).zip(*z)) {
                *along = -(x * a + y * b + z * c);
            }
        }
        let [u, v, w] = &along;
        let mut outside = [0; LANES];
        self.sectors.test(isa, [u, v, w], &mut outside);
        for ((distance, outside), w) in distances.iter_mut().zip(outside).zip(w) {
            *distance = if (outside == 0) & (*w < self.ceiling) { *distance } else { u32::MAX };
        }
    }

    #[inline(always)]
    fn takes(&self, [x, y, z]: [f32; 3]) -> bool {
        let along = self.axes.map(|axis| {
            let [a, b, c] = axis.to_array();
            -(x * a + y * b + z * c)
        });
        self.sectors.holds(along) && along[2] < self.ceiling
    }
}
