//! Targets at which photons are aimed: spheres around some of a scene's surfaces.
//!
//! A sphere is chosen in proportion to its density times the solid angle that it subtends, and then a
//! direction uniformly within this angle. Where spheres overlap, a direction can be chosen through any of
//! them. Its density is `sum d_i / sum (d_k w_k)`: the densities of the spheres in this direction, divided by
//! the sum over all spheres of density times solid angle.

use std::f32::consts::PI;

use glam::Vec3;
use photoncard_scene::{Material, Scene};

/// A bounding sphere of some triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sphere {
    centre: Vec3,
    /// Radius, metres.
    radius: f32,
    /// Density of photons through the sphere, relative to other spheres.
    density: f32,
}

/// Bounding spheres of some of a scene's surfaces.
#[derive(Clone, Debug, Default)]
pub(crate) struct Targets {
    spheres: Vec<Sphere>,
    /// Probability of aiming a photon at a sphere. Other photons are emitted in all directions.
    pub(crate) share: f32,
}

/// A sampled direction or point, and the inverse of its density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Aim {
    /// Unit vector of the direction, or position of the point, metres.
    pub(crate) towards: Vec3,
    /// Inverse of the density: sr for directions, m^2 for points.
    pub(crate) measure: f32,
}

/// Fraction of the photons that [`Targets::lit`] aims. The other photons are for surfaces outside the
/// targets.
const AIMED_SHARE: f32 = 0.9;
/// Fraction of the photons that `Targets::boxes` aims.
const BOX_SHARE: f32 = 0.5;
/// Minimum emission of a lamp, relative to the greatest emission in the scene.
const LAMP_SHARE: f32 = 0.01;
/// Maximum number of spheres.
const MAX_SPHERES: usize = 32;
/// Margin `m` of a sphere for rounding: its radius is multiplied by `1 + m` and raised by `m^2` times the
/// maximum coordinate.
const MARGIN: f32 = 1e-3;

impl Targets {
    /// Targets around all surfaces of a scene that reflect or transmit specularly. Every caustic photon hits
    /// one of them.
    pub(super) fn specular(scene: &Scene) -> Self {
        Self::around(scene, &scene.specular_materials(), std::iter::empty(), 1.0)
    }

    /// Targets around all surfaces of a scene except lamps, whose reflection of other light is hardly
    /// visible. Lamps are uniform emitters with more than [`LAMP_SHARE`] of the greatest emission.
    pub(super) fn lit(scene: &Scene) -> Self {
        let emission = |material: &Material| material.emission.max_element();
        let greatest = scene.materials.iter().map(emission).fold(0.0, f32::max);
        let is_lit = |material: &Material| {
            emission(material) <= LAMP_SHARE * greatest || material.emissive_texture.is_some()
        };
        let is_lit: Vec<_> = scene.materials.iter().map(is_lit).collect();
        // Instances do not emit. A triangle has the corners of an instance's box.
        let boxes = scene.instance_bounds().map(|(_, [low, high])| [low, high, low.with_y(high.y)]);
        Self::around(scene, &is_lit, boxes, AIMED_SHARE)
    }

    /// Targets around the triangles of the chosen materials and the triangles `others`.
    fn around(
        scene: &Scene,
        is_chosen: &[bool],
        others: impl Iterator<Item = [Vec3; 3]>,
        share: f32,
    ) -> Self {
        let triangles = scene.triangles.iter().filter(|triangle| is_chosen[triangle.material as usize]);
        Self::holding(
            triangles
                .map(|triangle| triangle.vertices)
                .chain(others)
                .map(|corners| (corners, None))
                .collect(),
            share,
        )
    }

    /// Targets around boxes. Each box has a lower and an upper corner and a weight: the variance that a
    /// photon of power 1 in the box adds to the picture. Half of the photons are aimed at the boxes.
    pub(crate) fn boxes(boxes: impl IntoIterator<Item = ([Vec3; 2], f64)>) -> Self {
        let boxes = boxes.into_iter().map(|([lower, upper], weight)| ([lower, upper, lower], Some(weight)));
        Self::holding(boxes.collect(), BOX_SHARE)
    }

    /// Targets that contain all of the triangles: at most `MAX_SPHERES` spheres, found by repeated
    /// splitting.
    fn holding(all: Vec<Weighted>, share: f32) -> Self {
        let mut parts: Vec<Part> = Part::new(all).into_iter().collect();
        while parts.len() < MAX_SPHERES {
            let costs = parts.iter().enumerate().filter(|(_, part)| part.may_be_split);
            let Some((index, _)) = costs.max_by(|(_, a), (_, b)| a.cost().total_cmp(&b.cost())) else {
                break;
            };
            match parts[index].split() {
                Some([first, second]) => {
                    parts[index] = first;
                    parts.push(second);
                }
                None => parts[index].may_be_split = false,
            }
        }
        Self { spheres: parts.into_iter().map(|part| part.sphere).collect(), share }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.spheres.is_empty()
    }

    /// Sum of the solid angles that the spheres subtend at a point, times their densities, sr. Overlaps count
    /// repeatedly.
    pub(super) fn solid_angle(&self, from: Vec3) -> f32 {
        self.spheres.iter().map(|sphere| sphere.weighted_angle(from)).sum()
    }

    /// Decides by a number in [0, 1) whether to aim at a sphere. Also returns the remainder of the number,
    /// rescaled to [0, 1).
    pub(crate) fn is_aimed(&self, number: f32) -> (bool, f32) {
        if number < self.share {
            (true, number / self.share)
        } else {
            (false, ((number - self.share) / (1.0 - self.share)).min(1.0 - f32::EPSILON / 2.0))
        }
    }

    /// Density of a photon's direction or position if it is aimed with the probability [`Self::share`].
    /// `aimed` and `free` are the densities of aimed and of other photons.
    pub(crate) fn mixed(&self, aimed: f32, free: f32) -> f32 {
        self.share * aimed + (1.0 - self.share) * free
    }

    /// Density with which [`Self::direction`] samples a direction from a point, 1/sr.
    pub(crate) fn direction_density(&self, from: Vec3, towards: Vec3) -> f32 {
        let all = self.solid_angle(from);
        let covering = self.spheres.iter().filter(|sphere| sphere.cone(from).holds(towards));
        if all > 0.0 { covering.map(|sphere| sphere.density).sum::<f32>() / all } else { 0.0 }
    }

    /// Density with which [`Self::place`] samples the line with this direction through the point `place`,
    /// 1/m^2.
    pub(crate) fn place_density(&self, direction: Vec3, place: Vec3) -> f32 {
        let all = self.area();
        let covering = self.spheres.iter().filter(|sphere| sphere.is_met(place, direction));
        if all > 0.0 { covering.map(|sphere| sphere.density).sum::<f32>() / all } else { 0.0 }
    }

    /// Sum of the projected areas `pi r^2` of the spheres, times their densities, m^2. Overlaps count
    /// repeatedly.
    pub(super) fn area(&self) -> f32 {
        self.spheres.iter().map(Sphere::weighted_area).sum()
    }

    /// Samples a direction from `from` through a sphere. `[c, d]` is a point of the unit square. Returns
    /// `None` if there are no spheres.
    pub(crate) fn direction(&self, from: Vec3, [c, d]: [f32; 2]) -> Option<Aim> {
        let all = self.solid_angle(from);
        let (index, c) = choose(c, all, self.spheres.iter().map(|sphere| sphere.weighted_angle(from)))?;
        let towards = self.spheres[index].cone(from).direction([c, d]);
        let others = self.spheres.iter().enumerate().filter(|(other, _)| *other != index);
        let covering = others.filter(|(_, sphere)| sphere.cone(from).holds(towards));
        let density = covering.fold(self.spheres[index].density, |sum, (_, sphere)| sum + sphere.density);
        Some(Aim { towards, measure: all / density })
    }

    /// Samples a line with a given direction through a sphere. `[c, d]` is a point of the unit square.
    /// Returns the point at which the line meets the plane through the origin perpendicular to it; `None` if
    /// there are no spheres.
    pub(crate) fn place(&self, direction: Vec3, [c, d]: [f32; 2]) -> Option<Aim> {
        let all = self.area();
        let (index, c) = choose(c, all, self.spheres.iter().map(Sphere::weighted_area))?;
        let Sphere { centre, radius, density } = self.spheres[index];
        let (tangent, bitangent) = direction.any_orthonormal_pair();
        let (sin, cos) = libm::sincosf(2.0 * PI * d);
        let place = centre + (tangent * cos + bitangent * sin) * (radius * c.sqrt());
        let others = self.spheres.iter().enumerate().filter(|(other, _)| *other != index);
        let covering = others.filter(|(_, sphere)| sphere.is_met(place, direction));
        let density = covering.fold(density, |sum, (_, sphere)| sum + sphere.density);
        let towards = place.reject_from_normalized(direction);
        Some(Aim { towards, measure: all / density })
    }
}

/// Chooses one of `shares`, whose sum is `all`, by a number in [0, 1). Returns its index and the remainder of
/// the number, rescaled to [0, 1).
fn choose(number: f32, all: f32, shares: impl Iterator<Item = f32>) -> Option<(usize, f32)> {
    let mut left = number * all;
    let mut last = None;
    for (index, share) in shares.enumerate() {
        let rest = if share > 0.0 { (left / share).clamp(0.0, 1.0 - f32::EPSILON) } else { 0.5 };
        last = Some((index, rest));
        if left < share {
            break;
        }
        left -= share;
    }
    last
}

/// All directions within an angle of an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SolidCone {
    pub(crate) axis: Vec3,
    /// Value `1 - cos` of the angle, 0 to 2.
    pub(crate) height: f32,
}

impl SolidCone {
    /// Cone of all directions.
    pub(crate) const ALL: Self = Self { axis: Vec3::Z, height: 2.0 };

    /// Solid angle, `2 pi (1 - cos)`, sr.
    pub(crate) fn solid_angle(&self) -> f32 {
        2.0 * PI * self.height
    }

    /// Maps a point of the unit square to a direction, uniformly by solid angle.
    pub(crate) fn direction(&self, [c, d]: [f32; 2]) -> Vec3 {
        let fall = self.height * c;
        let sine = (fall * (2.0 - fall)).max(0.0).sqrt();
        let (sin, cos) = libm::sincosf(2.0 * PI * d);
        let (tangent, bitangent) = self.axis.any_orthonormal_pair();
        (self.axis * (1.0 - fall) + (tangent * cos + bitangent * sin) * sine).normalize()
    }

    pub(crate) fn holds(&self, direction: Vec3) -> bool {
        // `1 - cos` of the angle between the unit vectors, without cancellation.
        0.5 * (direction - self.axis).length_squared() < self.height
    }
}

impl Sphere {
    /// Cone of directions from a point to the sphere. From a point inside, all directions.
    fn cone(&self, from: Vec3) -> SolidCone {
        let way = self.centre - from;
        let sine_squared = self.radius * self.radius / way.length_squared();
        if sine_squared < 1.0 {
            let cosine = (1.0 - sine_squared).sqrt();
            SolidCone { axis: way.normalize(), height: sine_squared / (1.0 + cosine) }
        } else {
            // Within the sphere; at its centre the quotient is infinite or NaN.
            SolidCone::ALL
        }
    }

    /// Returns whether the line with direction `direction` through `place` hits the sphere.
    fn is_met(&self, place: Vec3, direction: Vec3) -> bool {
        (place - self.centre).reject_from_normalized(direction).length_squared() < self.radius * self.radius
    }

    /// Solid angle that the sphere subtends at a point, times its density, sr.
    fn weighted_angle(&self, from: Vec3) -> f32 {
        self.density * self.cone(from).solid_angle()
    }

    /// Projected area, times the density, m^2.
    fn weighted_area(&self) -> f32 {
        self.density * (PI * self.radius * self.radius)
    }
}

/// A triangle and its weight; `None` if photons are to be equally dense on all triangles.
type Weighted = ([Vec3; 3], Option<f64>);

/// Some triangles and their bounding sphere.
struct Part {
    triangles: Vec<Weighted>,
    sphere: Sphere,
    may_be_split: bool,
}

impl Part {
    fn new(triangles: Vec<Weighted>) -> Option<Self> {
        let corners = || triangles.iter().flat_map(|(triangle, _)| triangle).copied();
        let [lower, upper] = [corners().reduce(Vec3::min)?, corners().reduce(Vec3::max)?];
        let centre = lower.midpoint(upper);
        let radius = corners().map(|corner| corner.distance(centre)).fold(0.0, f32::max);
        let greatest = lower.abs().max(upper.abs()).max_element();
        let radius = radius * (1.0 + MARGIN) + greatest * MARGIN * MARGIN;
        let may_be_split = triangles.len() > 1;
        let weight: Option<f64> = triangles.iter().map(|(_, weight)| *weight).sum();
        // The variance `sum w / density` at a given number of photons is least for these densities.
        let density = weight.map_or(1.0, |weight| (weight.sqrt() / f64::from(radius)) as f32);
        Some(Self { triangles, sphere: Sphere { centre, radius, density }, may_be_split })
    }

    /// Number of photons aimed at the sphere, up to a factor that all spheres have in common.
    fn cost(&self) -> f32 {
        self.sphere.density * self.sphere.radius * self.sphere.radius
    }

    /// Halves the triangles along their longest axis, if the two spheres together take fewer photons than
    /// this one.
    fn split(&self) -> Option<[Self; 2]> {
        let middle = |([a, b, c], _): &Weighted| (*a + *b + *c) / 3.0;
        let lower = self.triangles.iter().map(middle).reduce(Vec3::min)?;
        let upper = self.triangles.iter().map(middle).reduce(Vec3::max)?;
        let axis = (upper - lower).max_position();
        let border = lower.midpoint(upper)[axis];
        let (first, second) = self.triangles.iter().partition(|triangle| middle(triangle)[axis] < border);
        let parts = [Self::new(first)?, Self::new(second)?];
        (parts[0].cost() + parts[1].cost() < self.cost()).then_some(parts)
    }
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;

    use super::*;

    fn random(index: u32, dimension: u32) -> f32 {
        (hash(hash(index).wrapping_add(dimension)) >> 8) as f32 / 16_777_216.0
    }

    /// Three spheres, two of which overlap.
    fn targets() -> Targets {
        let sphere = |x: f32, y: f32, radius: f32, density: f32| {
            let centre = Vec3::new(x, y, 5.0);
            Sphere { centre, radius, density }
        };
        let spheres =
            vec![sphere(0.0, 0.0, 1.0, 1.0), sphere(0.8, 0.0, 0.7, 2.5), sphere(-3.0, 2.0, 0.5, 0.3)];
        Targets { spheres, share: 1.0 }
    }

    /// Integral over the unit square of the measure that the spheres cover.
    fn covered(is_covered: impl Fn(f32, f32) -> f32) -> f32 {
        let steps = 1500;
        let at = |i: u32| (i as f32 + 0.5) / steps as f32;
        let cells = (0..steps).flat_map(|i| (0..steps).map(move |j| (at(i), at(j))));
        cells.map(|(u, v)| f64::from(is_covered(u, v))).sum::<f64>() as f32 / (steps * steps) as f32
    }

    #[test]
    fn the_mean_of_the_measures_is_the_solid_angle_that_the_spheres_cover() {
        let targets = targets();
        let count = 100_000;
        let aims = (0..count).filter_map(|i| targets.direction(Vec3::ZERO, [random(i, 0), random(i, 1)]));
        let mut sum = 0.0;
        for Aim { towards, measure } in aims {
            assert!(targets.spheres.iter().any(|sphere| {
                let nearest = towards * sphere.centre.dot(towards);
                nearest.distance(sphere.centre) <= sphere.radius * 1.0001
            }));
            sum += f64::from(measure);
        }
        // The integral is over the plane z = 1, where the solid angle per area is the cube of the cosine.
        let expected = covered(|u, v| {
            let direction = Vec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 1.0);
            let is_hit =
                targets.spheres.iter().any(|sphere| sphere.cone(Vec3::ZERO).holds(direction.normalize()));
            if is_hit { 4.0 / direction.length().powi(3) } else { 0.0 }
        });
        let found = sum as f32 / count as f32;
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }

    #[test]
    fn the_mean_of_the_measures_is_the_projected_area_of_the_spheres() {
        let targets = targets();
        let count = 100_000;
        let aims = (0..count).filter_map(|i| targets.place(Vec3::Z, [random(i, 0), random(i, 1)]));
        let found = aims.map(|aim| f64::from(aim.measure)).sum::<f64>() as f32 / count as f32;
        let expected = covered(|u, v| {
            let place = Vec3::new(8.0 * u - 5.0, 8.0 * v - 4.0, 5.0);
            let is_hit = targets.spheres.iter().any(|sphere| place.distance(sphere.centre) < sphere.radius);
            if is_hit { 64.0 } else { 0.0 }
        });
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }

    #[test]
    fn a_row_of_mirrors_is_covered_by_several_spheres() {
        let mirror = photoncard_scene::Material::new(
            "mirror",
            photoncard_scene::Reflection::MetallicRoughness {
                base_colour: Vec3::ONE,
                metallic: 1.0,
                roughness: 0.0,
                dielectric: Vec3::ZERO,
                grazing: 0.0,
                transmission: None,
            },
        );
        let triangle = |x: f32| {
            photoncard_scene::Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y].map(|v| v * 0.1 + Vec3::X * x), 0)
        };
        let triangles: Vec<_> = (0..100).map(|i| triangle(i as f32)).collect();
        let scene =
            Scene::default().with(|scene| (scene.triangles, scene.materials) = (triangles, vec![mirror]));
        let targets = Targets::specular(&scene);
        assert_eq!(targets.spheres.len(), MAX_SPHERES);
        assert!(targets.spheres.iter().all(|sphere| sphere.radius < 4.0));
        for corner in scene.triangles.iter().flat_map(|triangle| triangle.vertices) {
            assert!(targets.spheres.iter().any(|sphere| sphere.centre.distance(corner) <= sphere.radius));
        }
        assert!(Targets::specular(&Scene::default()).is_empty());
    }
}
