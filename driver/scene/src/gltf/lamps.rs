//! Lamps with an area that are no meshes of the file: area lights that nodes state in their `extras`, and the
//! spheres of point lights with a radius. A lamp has no substance: it casts no shadow.

use glam::{DMat4, DVec3, Vec3};
use photoncard_picture::allocation;
use serde::Deserialize;

use super::document::Document;
use super::limits::MAX_COORDINATE;
use crate::error::SceneError;
use crate::limits::EMISSION;
use crate::material::Visibility;
use crate::{Material, Scene, Triangle};

/// Area light in the `extras` of a node. Its front looks along the node's -z axis, as a spot light does.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AreaLight {
    #[serde(default)]
    shape: Shape,
    /// Extents along the node's x and y axes before its scale, metres.
    size: [f32; 2],
    /// Emitted radiance, W/(sr m^2).
    radiance: [f32; 3],
    /// True if eye rays meet the light.
    #[serde(default)]
    camera: bool,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Shape {
    #[default]
    Rectangle,
    Ellipse,
}

/// Number of sides of the polygon that stands for an ellipse.
const SIDES: u32 = 32;

impl AreaLight {
    /// Corners of the light in the plane of its node, in order about the z axis.
    fn corners(&self) -> Vec<DVec3> {
        let [x, y] = self.size.map(|extent| 0.5 * f64::from(extent));
        match self.shape {
            Shape::Rectangle => {
                [[-x, -y], [x, -y], [x, y], [-x, y]].map(|[x, y]| DVec3::new(x, y, 0.0)).into()
            }
            Shape::Ellipse => {
                let step = std::f64::consts::TAU / f64::from(SIDES);
                // The polygon has the area of the ellipse.
                let scale = (step / libm::sin(step)).sqrt();
                let corner = |side| {
                    let (sin, cos) = libm::sincos(step * f64::from(side));
                    DVec3::new(scale * x * cos, scale * y * sin, 0.0)
                };
                (0..SIDES).map(corner).collect()
            }
        }
    }

    /// Adds the light of a node to `scene`, as its last object.
    ///
    /// # Errors
    /// If a value is out of range, or the light is too far away.
    pub(super) fn place(
        &self,
        document: &Document,
        node: usize,
        (name, world): (&str, &DMat4),
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        let item = format!("nodes[{node}].extras.photoncard.area_light");
        let is_extent = |extent: &f32| *extent > 0.0 && *extent <= MAX_COORDINATE;
        if !self.size.iter().all(is_extent) {
            let reason = format!("the size is {:?}", self.size);
            return Err(document.invalid(item, reason, "state extents above 0, metres"));
        }
        let corners = self.corners();
        let [first, rest @ ..] = &*corners else { return Ok(()) };
        // Clockwise about the z axis: the front looks along -z.
        let triangles = rest.windows(2).map(|pair| [*first, pair[1], pair[0]]);
        let lamp = Lamp { item, name, radiance: self.radiance, camera: self.camera };
        lamp.place(document, (world, triangles), scene)
    }
}

/// Adds a sphere of `radius` metres around the origin of `world`, whose scale and rotation do not count, that
/// has the radiant intensity `intensity`, W/sr.
///
/// # Errors
/// If the sphere is too far away, or its radiance out of range.
pub(super) fn place_sphere(
    document: &Document,
    item: String,
    (name, world): (&str, &DMat4),
    (intensity, radius): (Vec3, f32),
    scene: &mut Scene,
) -> Result<(), SceneError> {
    let radiance = intensity / (std::f32::consts::PI * radius * radius);
    let place = DMat4::from_translation(world.w_axis.truncate());
    let triangles = sphere(f64::from(radius)).into_iter();
    let lamp = Lamp { item, name, radiance: radiance.to_array(), camera: false };
    lamp.place(document, (&place, triangles), scene)
}

/// A lamp, and the place in the file of its values.
struct Lamp<'a> {
    item: String,
    name: &'a str,
    radiance: [f32; 3],
    camera: bool,
}

impl Lamp<'_> {
    /// Adds triangles of the lamp, in the space of `world`, as the last object of the scene.
    fn place(
        self,
        document: &Document,
        (world, triangles): (&DMat4, impl Iterator<Item = [DVec3; 3]>),
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        let is_possible = |value: f32| value == 0.0 || EMISSION.contains(&value);
        if !self.radiance.into_iter().all(is_possible) {
            let reason = format!("the radiance is {:?} W/(sr m^2)", self.radiance);
            let remedy = "state a radiance of 0, or of 1e-20 to 1e20";
            return Err(document.invalid(self.item, reason, remedy));
        }
        let material = scene.materials.len() as u32;
        scene.materials.push(Material {
            emission: Vec3::from(self.radiance),
            visibility: Visibility { camera: self.camera, light: false },
            ..Material::lambertian(self.name, Vec3::ZERO)
        });
        let object = scene.objects.len() as u32;
        scene.objects.push(self.name.to_owned());
        let is_mirror = world.determinant() < 0.0;
        let before = scene.triangles.len();
        for corners in triangles {
            let [a, b, c] = corners.map(|corner| world.transform_point3(corner).as_vec3());
            let placed =
                Triangle { object, ..Triangle::new(if is_mirror { [a, c, b] } else { [a, b, c] }, material) };
            let is_near = |corner: &Vec3| corner.abs().max_element() <= MAX_COORDINATE;
            if !placed.vertices.iter().all(is_near) {
                let reason = format!("the lamp lies further than {MAX_COORDINATE} m from the origin");
                return Err(document.invalid(self.item, reason, "move it towards the origin"));
            }
            if placed.area() <= 0.0 {
                scene.skipped_triangles += 1;
                continue;
            }
            allocation::push(&mut scene.triangles, placed)
                .map_err(|error| SceneError::memory(&document.path, "placing its lamps", error))?;
        }
        if scene.triangles.len() == before {
            let reason = "the lamp is so small beside its distance from the origin that it has no area";
            return Err(document.invalid(self.item, reason, "make it larger"));
        }
        Ok(())
    }
}

/// Triangles of an icosahedron whose faces are divided into four, counter-clockwise seen from outside. Their
/// area is that of a sphere of `radius`.
fn sphere(radius: f64) -> Vec<[DVec3; 3]> {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let corners: Vec<DVec3> = [-1.0, 1.0]
        .into_iter()
        .flat_map(|a| [-golden, golden].map(|b| (a, b)))
        .flat_map(|(a, b)| [[0.0, a, b], [a, b, 0.0], [b, 0.0, a]])
        .map(|corner| DVec3::from(corner).normalize())
        .collect();
    // Neighbours of an icosahedron's corner on the unit sphere are 1.05 apart, others 1.7.
    let are_near = |a: DVec3, b: DVec3| a.distance(b) < 1.2;
    let mut faces = Vec::new();
    for (i, &a) in corners.iter().enumerate() {
        for (j, &b) in corners.iter().enumerate().skip(i + 1) {
            for &c in &corners[j + 1..] {
                if are_near(a, b) && are_near(b, c) && are_near(a, c) {
                    let is_outward = (b - a).cross(c - a).dot(a) > 0.0;
                    faces.push(if is_outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    let divided = faces.into_iter().flat_map(|[a, b, c]| {
        let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    });
    let divided: Vec<[DVec3; 3]> = divided.collect();
    let area: f64 = divided.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length()).sum();
    let scale = radius * (2.0 * std::f64::consts::TAU / area).sqrt();
    divided.into_iter().map(|corners| corners.map(|corner| corner * scale)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(triangles: &[[DVec3; 3]]) -> f64 {
        triangles.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length()).sum()
    }

    #[test]
    fn a_sphere_has_its_area_and_looks_outwards() {
        let triangles = sphere(0.25);
        assert_eq!(triangles.len(), 80);
        assert!((area(&triangles) / (std::f64::consts::PI * 0.25) - 1.0).abs() < 1e-12);
        assert!(triangles.iter().all(|[a, b, c]| (*b - *a).cross(*c - *a).dot(*a + *b + *c) > 0.0));
    }

    #[test]
    fn an_ellipse_has_its_area() {
        let light = AreaLight { shape: Shape::Ellipse, size: [2.0, 0.5], radiance: [1.0; 3], camera: false };
        let corners = light.corners();
        let triangles: Vec<_> = corners[1..].windows(2).map(|pair| [corners[0], pair[1], pair[0]]).collect();
        assert!((area(&triangles) / (std::f64::consts::PI * 0.25) - 1.0).abs() < 1e-12);
        assert!(triangles.iter().all(|[a, b, c]| (*b - *a).cross(*c - *a).z < 0.0));
    }
}
