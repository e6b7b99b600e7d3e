//! Lifts lamps (emissive triangles) off surfaces in the same plane, such as a panel that is modelled in the
//! plane of the ceiling.
//!
//! Rounding decides which of two coplanar surfaces a ray meets. A lamp is therefore lifted off the other
//! surface by more than the rounding error. It is then seen whole, shadow rays reach it, and its photons
//! start in front of the other surface.

use glam::{DVec2, DVec3, Vec3};
use photoncard_picture::allocation::{self, OutOfMemory};
use rayon::prelude::*;

use super::{Scene, Triangle};

/// Distance within which two surfaces count as coplanar, in units of `f32::EPSILON` times their greatest
/// absolute coordinate.
const SHARED: f64 = 16.0;
/// Distance by which a lamp is lifted, in units of `f32::EPSILON` times the sum of the lamp's greatest
/// absolute coordinate and the viewing distance of `SEEN_FROM`.
const LIFT: f64 = 64.0;
/// Greatest viewing distance at which a lifted lamp is seen whole, in units of the lamp's longest edge.
const SEEN_FROM: f64 = 32.0;

impl Scene {
    /// Lifts emissive triangles, along their own normal, off coplanar, overlapping triangles that do not
    /// emit. Double-sided emissive triangles are lifted to the front of a one-sided surface.
    ///
    /// # Errors
    /// If the system refuses the memory.
    pub(crate) fn lift_lamps(&mut self) -> Result<(), OutOfMemory> {
        // The factor is 4, because a list's capacity may be twice its length, and a split copies half of the
        // list.
        allocation::check(4 * (self.emitters().count() * size_of::<Lamp>()) as u64)?;
        let lamps: Vec<Lamp> = self.emitters().map(|(index, triangle)| Lamp::new(index, triangle)).collect();
        if lamps.is_empty() {
            return Ok(());
        }
        let tree = Tree::new(lamps);
        let lifts = |surface: &Triangle| {
            let lift = |lamp| (lamp, self.lift(lamp, surface));
            tree.overlapping(surface).map(lift).collect::<Vec<_>>()
        };
        let of_triangles = self.triangles.par_iter().filter(|triangle| !self.emits(triangle));
        let of_triangles = of_triangles.flat_map_iter(lifts);
        let instances: Vec<_> = self.instance_bounds().collect();
        let near = instances.par_iter().filter(|(_, corners)| tree.touches(&Box3::around(*corners)));
        let of_instances = near
            .flat_map_iter(|(instance, _)| self.placed(instance))
            .flat_map_iter(|surface| lifts(&surface));
        let mut found: Vec<(usize, DVec3)> = of_triangles.chain(of_instances).collect();
        found.sort_by_key(|(lamp, _)| *lamp);
        found.dedup_by_key(|(lamp, _)| *lamp);
        for (lamp, lift) in found {
            let vertices = &mut self.triangles[lamp].vertices;
            *vertices = vertices.map(|vertex| (vertex.as_dvec3() + lift).as_vec3());
        }
        Ok(())
    }

    fn emitters(&self) -> impl Iterator<Item = (usize, &Triangle)> {
        self.triangles.iter().enumerate().filter(|(_, triangle)| self.emits(triangle))
    }

    /// Displacement that lifts `lamp` off `surface`, metres.
    fn lift(&self, lamp: usize, surface: &Triangle) -> DVec3 {
        let lamp = &self.triangles[lamp];
        let is_double_sided = |triangle: &Triangle| {
            self.materials.get(triangle.material as usize).is_some_and(|material| material.double_sided)
        };
        let [own, other] = [lamp, surface].map(normal);
        let turns = is_double_sided(lamp) && !is_double_sided(surface) && own.dot(other) < 0.0;
        let [a, b, c] = lamp.vertices.map(DVec3::from);
        let edge = (b - a).length().max((c - b).length()).max((a - c).length());
        let distance = LIFT * f64::from(f32::EPSILON) * (magnitude(lamp) + SEEN_FROM * edge);
        if turns { -own * distance } else { own * distance }
    }
}

fn normal(triangle: &Triangle) -> DVec3 {
    let [a, b, c] = triangle.vertices.map(DVec3::from);
    (b - a).cross(c - a).normalize_or_zero()
}

/// Greatest absolute coordinate, metres.
fn magnitude(triangle: &Triangle) -> f64 {
    triangle.vertices.iter().map(|vertex| f64::from(vertex.abs().max_element())).fold(0.0, f64::max)
}

#[derive(Clone, Copy)]
struct Box3 {
    low: DVec3,
    high: DVec3,
}

impl Box3 {
    /// Bounding box of a triangle, enlarged by the tolerance of [`SHARED`] so that it overlaps the boxes of
    /// coplanar surfaces.
    fn of(triangle: &Triangle) -> Self {
        let [a, b, c] = triangle.vertices.map(DVec3::from);
        let room = SHARED * f64::from(f32::EPSILON) * magnitude(triangle);
        Self { low: a.min(b).min(c) - room, high: a.max(b).max(c) + room }
    }

    /// Box from a lower to an upper corner, enlarged by the tolerance of [`SHARED`].
    fn around([low, high]: [Vec3; 2]) -> Self {
        let [low, high] = [low, high].map(DVec3::from);
        let room = SHARED * f64::from(f32::EPSILON) * low.abs().max(high.abs()).max_element();
        Self { low: low - room, high: high + room }
    }

    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}

/// Emissive triangle that may be lifted.
struct Lamp {
    /// Index in [`Scene::triangles`](super::SceneContents::triangles).
    index: usize,
    triangle: Triangle,
    bounds: Box3,
}

impl Lamp {
    fn new(index: usize, triangle: &Triangle) -> Self {
        Self { index, triangle: *triangle, bounds: Box3::of(triangle) }
    }

    /// Returns whether `surface` lies in the lamp's plane and overlaps the lamp by more than a common edge.
    fn is_covered_by(&self, surface: &Triangle) -> bool {
        let up = normal(&self.triangle);
        let [lamp, surface_corners] =
            [&self.triangle, surface].map(|triangle| triangle.vertices.map(DVec3::from));
        let rounding = f64::from(f32::EPSILON) * magnitude(&self.triangle).max(magnitude(surface));
        let is_in_plane = |corner: DVec3| (corner - lamp[0]).dot(up).abs() <= SHARED * rounding;
        // The corners of a small triangle may be near the lamp's plane although the triangle is not parallel
        // to it.
        let is_parallel = up.dot(normal(surface)).abs() > 0.999;
        let across = up.any_orthonormal_vector();
        let along = up.cross(across);
        let flat = |corner: DVec3| DVec2::new((corner - lamp[0]).dot(across), (corner - lamp[0]).dot(along));
        is_parallel
            && surface_corners.into_iter().all(is_in_plane)
            && overlap(&lamp.map(flat), &surface_corners.map(flat), SHARED * rounding)
    }
}

/// Returns whether two triangles overlap by more than `distance` along the normal of every edge (the
/// separating axis theorem).
fn overlap(one: &[DVec2; 3], other: &[DVec2; 3], distance: f64) -> bool {
    let is_apart = |along: DVec2| {
        let range = |corners: &[DVec2; 3]| {
            let heights = corners.map(|corner| corner.dot(along));
            [
                heights.into_iter().fold(f64::INFINITY, f64::min),
                heights.into_iter().fold(-f64::INFINITY, f64::max),
            ]
        };
        let [[low, high], [other_low, other_high]] = [one, other].map(range);
        high.min(other_high) - low.max(other_low) <= distance
    };
    let edges = |corners: &[DVec2; 3]| {
        let [a, b, c] = *corners;
        [b - a, c - b, a - c].map(|edge| edge.perp().normalize_or_zero())
    };
    !edges(one).into_iter().chain(edges(other)).any(is_apart)
}

/// Bounding volume hierarchy of lamps.
struct Tree {
    bounds: Box3,
    content: Content,
}

enum Content {
    Lamps(Vec<Lamp>),
    Halves(Box<[Tree; 2]>),
}

/// Maximum number of lamps of a leaf.
const LEAF: usize = 4;

impl Tree {
    /// Builds a hierarchy of `lamps` (at least one). Nodes are split at the median along their longest side.
    fn new(mut lamps: Vec<Lamp>) -> Self {
        let bounds = lamps.iter().map(|lamp| lamp.bounds).reduce(Box3::union);
        let bounds = bounds.unwrap_or(Box3 { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY });
        if lamps.len() <= LEAF {
            return Self { bounds, content: Content::Lamps(lamps) };
        }
        let axis = (bounds.high - bounds.low).max_position();
        let place = |lamp: &Lamp| lamp.bounds.low[axis] + lamp.bounds.high[axis];
        lamps.sort_by(|a, b| place(a).total_cmp(&place(b)));
        let upper = lamps.split_off(lamps.len() / 2);
        Self { bounds, content: Content::Halves(Box::new([Self::new(lamps), Self::new(upper)])) }
    }

    /// Returns whether the bounding box of any lamp overlaps `bounds`.
    fn touches(&self, bounds: &Box3) -> bool {
        self.bounds.overlaps(bounds)
            && match &self.content {
                Content::Halves(halves) => halves.iter().any(|half| half.touches(bounds)),
                Content::Lamps(lamps) => lamps.iter().any(|lamp| lamp.bounds.overlaps(bounds)),
            }
    }

    /// Indices of the lamps that lie in the plane of `surface` and overlap it.
    fn overlapping(&self, surface: &Triangle) -> impl Iterator<Item = usize> {
        let mut found = Vec::new();
        self.find(surface, &Box3::of(surface), &mut found);
        found.into_iter()
    }

    fn find(&self, surface: &Triangle, bounds: &Box3, found: &mut Vec<usize>) {
        if !self.bounds.overlaps(bounds) {
            return;
        }
        match &self.content {
            Content::Halves(halves) => halves.iter().for_each(|half| half.find(surface, bounds, found)),
            Content::Lamps(lamps) => {
                let near = lamps.iter().filter(|lamp| lamp.bounds.overlaps(bounds));
                found.extend(near.filter(|lamp| lamp.is_covered_by(surface)).map(|lamp| lamp.index));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, Reflection, SceneContents};

    /// One-sided triangle at `height` that faces down, shifted by `x`.
    fn panel(height: f32, x: f32, material: u32) -> Triangle {
        Triangle::new(
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[a, b]| Vec3::new(a + x, height, b)),
            material,
        )
    }

    fn scene(double_sided: [bool; 2], triangles: Vec<Triangle>) -> Scene {
        let diffuse = Reflection::Phong { diffuse: Vec3::splat(0.5), specular: Vec3::ZERO, exponent: 0.0 };
        let wall = Material { double_sided: double_sided[0], ..Material::new("wall", diffuse) };
        let lamp = Material { emission: Vec3::ONE, double_sided: double_sided[1], ..wall.clone() };
        Scene::from(SceneContents { materials: vec![wall, lamp], triangles, ..SceneContents::default() })
    }

    fn lifted(double_sided: [bool; 2], triangles: Vec<Triangle>) -> Scene {
        let mut scene = scene(double_sided, triangles);
        scene.lift_lamps().unwrap();
        scene
    }

    fn turned(triangle: Triangle) -> Triangle {
        let [a, b, c] = triangle.vertices;
        Triangle { vertices: [a, c, b], ..triangle }
    }

    #[test]
    fn a_lamp_in_the_plane_of_a_ceiling_is_lifted_off_it_by_little() {
        for height in [3.0_f32, 3.0 - 1e-6, 3.0 + 1e-6, -3.0] {
            let triangles = vec![panel(height, 0.1, 1), panel(height.round(), 0.0, 0)];
            let found = lifted([false; 2], triangles.clone());
            assert_eq!(found.triangles[1], triangles[1]);
            for vertex in found.triangles[0].vertices {
                let lift = height.round() - vertex.y;
                assert!((1e-4..1e-3).contains(&lift), "{lift}");
            }
        }
    }

    #[test]
    fn a_lamp_in_the_plane_of_an_instance_is_lifted_off_it() {
        let plain = scene([false; 2], vec![panel(3.0, 0.1, 1)]);
        for (height, is_lifted) in [(2.0, true), (2.1, false)] {
            let mut scene = plain.clone().with(|scene| {
                scene.groups = vec![vec![panel(1.0, 0.0, 0)]];
                let place = glam::DMat4::from_translation(DVec3::Y * height);
                scene.instances = crate::Instance::new(0, &place).into_iter().collect();
            });
            scene.lift_lamps().unwrap();
            assert_eq!(scene.triangles != plain.triangles, is_lifted, "{height}");
        }
    }

    #[test]
    fn lamps_that_are_not_covered_stay() {
        let ceiling = panel(3.0, 0.0, 0);
        let beside =
            Triangle::new([Vec3::new(0.0, 3.0, 0.0), Vec3::new(0.0, 3.0, 1.0), Vec3::new(-1.0, 3.0, 0.0)], 1);
        for lamp in [panel(2.999, 0.0, 1), panel(3.0, 1.5, 1), panel(3.0, 1.0, 1), beside] {
            let triangles = vec![lamp, ceiling];
            assert_eq!(lifted([false; 2], triangles.clone()).triangles, triangles);
        }
        let dark = vec![panel(3.0, 0.1, 0), ceiling];
        assert_eq!(lifted([false; 2], dark.clone()).triangles, dark);
    }

    #[test]
    fn a_lamp_is_lifted_to_its_own_front_or_with_two_to_that_of_the_surface() {
        let [lamp, ceiling] = [panel(3.0, 0.1, 1), panel(3.0, 0.0, 0)];
        let rises = |double_sided, lamp: Triangle| {
            lifted(double_sided, vec![lamp, ceiling]).triangles[0].vertices[0].y > 3.0
        };
        assert!(!rises([false, false], lamp) && rises([false, false], turned(lamp)));
        assert!(!rises([false, true], lamp) && !rises([false, true], turned(lamp)));
        assert!(!rises([true, true], lamp) && rises([true, true], turned(lamp)));
    }

    #[test]
    fn each_of_many_lamps_is_found() {
        let many = (0..100).map(|index| panel(3.0, 3.0 * index as f32, 1));
        let covered = (0..100).step_by(7).map(|index| panel(3.0, 3.0 * index as f32 + 0.2, 0));
        let found = lifted([false; 2], many.chain(covered).collect());
        let moved = (0..100).filter(|&index| found.triangles[index].vertices[0].y < 3.0);
        assert!(moved.eq((0..100).step_by(7)));
    }
}
