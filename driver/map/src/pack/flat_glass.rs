//! Flat glass: thin walls, and glass solids that are panes.
//!
//! A pane is a slab with parallel faces. Light that passes both faces keeps its direction, so that shadow
//! rays can pass a pane like a thin wall. The faces have a material record of their own ([`PANE`]). This
//! record applies the transmittance of the whole slab to light that enters. The model ignores the lateral
//! shift of the light by refraction, and the rim of the slab.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::Vec3;
use photoncard_scene::{Layers, Material, Reflection, Scene, Triangle, parts};
use photoncard_shared::layout::{self, PANE, Reflectance, THIN_WALLED};

use super::materials::{bare_record, transmission_of};

/// Minimum fraction of a slab's surface area that its two faces make up.
const FACES: f32 = 0.9;
/// Minimum ratio of the areas of two faces taken as equal, and minimum cosine between normals taken as
/// parallel.
const EQUAL: f32 = 0.99;
/// Maximum distance of a corner from its face's plane, divided by the thickness.
const EVEN: f32 = 0.02;
/// Rounding error of a coordinate, relative to the greatest coordinate.
const ROUNDING: f32 = 1e-6;
/// Panes of an absorbing material with equal `round(THICKNESS_STEPS ln(thickness))` share a record.
const THICKNESS_STEPS: f32 = 100.0;

/// Material record that panes share.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pane {
    /// Index of the panes' material in the scene.
    material: u32,
    /// Thickness of the panes, metres. Arbitrary for panes without absorption.
    thickness: f32,
}

/// Triangles whose materials are numbered as in the card image: first the scene's materials, then those of
/// panes.
pub(super) struct Glazing<'a> {
    pub(super) triangles: Cow<'a, [Triangle]>,
    panes: Vec<Pane>,
    /// Index of a pane in `panes`, by material and rounded thickness ([`THICKNESS_STEPS`]).
    known: BTreeMap<(u32, i32), u32>,
}

impl<'a> Glazing<'a> {
    /// Finds the panes of a scene.
    pub(super) fn new(scene: &'a Scene) -> Self {
        let may_be_pane: Vec<bool> = scene.materials.iter().map(may_be_pane).collect();
        let is_glass = |triangle: &Triangle| may_be_pane[triangle.material as usize];
        let glass: Vec<u32> = (0..)
            .zip(&scene.triangles)
            .filter(|(_, triangle)| is_glass(triangle))
            .map(|(index, _)| index)
            .collect();
        let mut glazing =
            Self { triangles: Cow::Borrowed(&scene.triangles), panes: Vec::new(), known: BTreeMap::new() };
        let corners: Vec<[Vec3; 3]> =
            glass.iter().map(|&index| scene.triangles[index as usize].vertices).collect();
        for part in parts(&corners) {
            let indices = || part.triangles.iter().map(|&part| glass[part as usize] as usize);
            let triangles: Vec<&Triangle> = indices().map(|index| &scene.triangles[index]).collect();
            let Some(thickness) = thickness_of_slab(&triangles) else { continue };
            // A face that is also a face of another solid has another ratio of refractive indices than the
            // rest.
            if !is_of_one_medium(scene, &triangles) {
                continue;
            }
            for index in indices() {
                let material = scene.triangles[index].material;
                let of_pane = glazing.material(scene, Pane { material, thickness });
                glazing.triangles.to_mut()[index].material = of_pane;
            }
        }
        glazing
    }

    /// Returns the index in the card image of a pane's material. Adds the material if it is new.
    fn material(&mut self, scene: &Scene, pane: Pane) -> u32 {
        let absorbs = transmission_of(&scene.materials[pane.material as usize])
            .is_some_and(|transmission| transmission.absorption != Vec3::ZERO);
        let step = if absorbs { (pane.thickness.ln() * THICKNESS_STEPS).round() as i32 } else { 0 };
        let index = *self.known.entry((pane.material, step)).or_insert_with(|| {
            self.panes.push(pane);
            self.panes.len() as u32 - 1
        });
        scene.materials.len() as u32 + index
    }

    /// Material records of the card image, given those of the scene's materials.
    pub(super) fn records(&self, mut records: Vec<layout::Material>) -> Vec<layout::Material> {
        for pane in &self.panes {
            records.push(pane.record(records[pane.material as usize]));
        }
        records
    }

    /// Extends a property of the scene's materials to all materials of the card image.
    pub(super) fn of_materials(&self, of_scene: &[bool]) -> Vec<bool> {
        let of_panes = self.panes.iter().map(|pane| of_scene[pane.material as usize]);
        of_scene.iter().copied().chain(of_panes).collect()
    }

    /// Returns for each material of the card image whether its surfaces are flat glass.
    pub(super) fn is_flat(&self, scene: &Scene) -> Vec<bool> {
        let of_scene = scene.materials.iter().map(|material| {
            let record = bare_record(material);
            record.flags & THIN_WALLED != 0 && is_smooth(&record)
        });
        of_scene.chain(self.panes.iter().map(|_| true)).collect()
    }
}

impl Pane {
    /// Record of the pane's faces, given the record of the material's other surfaces.
    fn record(&self, mut record: layout::Material) -> layout::Material {
        record.flags |= PANE;
        if let Reflectance::Glass { absorption, .. } = &mut record.reflectance {
            absorption.iter_mut().for_each(|coefficient| *coefficient *= self.thickness);
        }
        record
    }
}

/// Returns whether slabs of a material are panes: the material bounds volumes, and neither roughness nor a
/// normal map nor a layer scatters light.
fn may_be_pane(material: &Material) -> bool {
    let is_plain = |layers: &Layers| {
        layers.normal.is_none()
            && layers.coat.is_none()
            && layers.sheen.is_none()
            && layers.diffuse_transmission.is_none()
    };
    let is_volume = transmission_of(material).is_some_and(|transmission| transmission.is_volume);
    is_volume
        && matches!(material.reflection, Reflection::MetallicRoughness { .. })
        && material.layers.as_deref().is_none_or(is_plain)
        && is_smooth(&bare_record(material))
}

fn is_smooth(record: &layout::Material) -> bool {
    matches!(record.reflectance, Reflectance::Glass { roughness: 0.0, .. })
}

/// Returns whether all triangles have the same index of refraction.
fn is_of_one_medium(scene: &Scene, triangles: &[&Triangle]) -> bool {
    let index = |triangle: &&Triangle| {
        transmission_of(&scene.materials[triangle.material as usize]).map(|transmission| transmission.ior)
    };
    triangles.windows(2).all(|pair| index(&pair[0]) == index(&pair[1]))
}

/// Distance between the two faces of a slab; `None` if the triangles do not form a slab.
fn thickness_of_slab(triangles: &[&Triangle]) -> Option<f32> {
    let largest = triangles.iter().max_by(|a, b| a.area().total_cmp(&b.area()))?;
    let axis = largest.scaled_normal().normalize_or_zero();
    let corners = || triangles.iter().flat_map(|triangle| triangle.vertices);
    let greatest = corners().map(|corner| corner.abs().max_element()).fold(0.0, f32::max);
    let [lower, upper] = corners()
        .map(|corner| axis.dot(corner))
        .fold([f32::INFINITY, f32::NEG_INFINITY], |[lower, upper], height| {
            [lower.min(height), upper.max(height)]
        });
    let thickness = upper - lower;
    let tolerance = EVEN * thickness + ROUNDING * greatest;
    let face = |height: f32, side: f32| -> f32 {
        let is_on_face = |triangle: &&&Triangle| {
            let is_level = |corner: Vec3| (axis.dot(corner) - height).abs() <= tolerance;
            triangle.vertices.into_iter().all(is_level)
                && triangle.scaled_normal().normalize_or_zero().dot(axis) * side >= EQUAL
        };
        triangles.iter().filter(is_on_face).map(|triangle| triangle.area()).sum()
    };
    let all: f32 = triangles.iter().map(|triangle| triangle.area()).sum();
    // The faces of a cavity, and those of a mesh turned inside out, face each other.
    let is_slab = [1.0, -1.0].into_iter().any(|side| {
        let (above, below) = (face(upper, side), face(lower, -side));
        above + below >= FACES * all && above.min(below) >= EQUAL * above.max(below)
    });
    (is_slab && thickness > 2.0 * ROUNDING * greatest).then_some(thickness)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Box that faces outwards.
    fn block(sides: Vec3) -> Vec<Triangle> {
        let corner = |bits: usize| Vec3::from([0, 1, 2].map(|axis| (bits >> axis & 1) as f32 * sides[axis]));
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
            .into_iter()
            .flat_map(|face| {
                let [a, b, c, d] = face.map(corner);
                [Triangle::new([a, b, c], 0), Triangle::new([a, c, d], 0)]
            })
            .collect()
    }

    fn thickness(triangles: &[Triangle]) -> Option<f32> {
        thickness_of_slab(&triangles.iter().collect::<Vec<_>>())
    }

    #[test]
    fn a_box_with_one_short_side_is_a_slab_in_any_orientation() {
        let thin = block(Vec3::new(1.0, 0.02, 2.0));
        let close = |found: Option<f32>| found.is_some_and(|found| (found - 0.02).abs() < 1e-5);
        assert!(close(thickness(&thin)), "{:?}", thickness(&thin));
        for angle in [0.3, 1.1, 2.5] {
            let turn = glam::Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), angle);
            let turned: Vec<_> = thin
                .iter()
                .map(|triangle| Triangle {
                    vertices: triangle.vertices.map(|corner| turn * corner + 5.0),
                    ..*triangle
                })
                .collect();
            assert!(close(thickness(&turned)), "{:?}", thickness(&turned));
        }
        let mut inside_out = thin.clone();
        inside_out.iter_mut().for_each(|triangle| triangle.vertices.swap(1, 2));
        assert!(close(thickness(&inside_out)));
        // The two faces are a slab even without its rim.
        assert!(close(thickness(&thin[4..8])));
    }

    #[test]
    fn cubes_wedges_and_sheets_are_not_slabs() {
        assert_eq!(thickness(&block(Vec3::ONE)), None);
        let mut wedge = block(Vec3::new(1.0, 0.02, 1.0));
        for corner in wedge.iter_mut().flat_map(|triangle| &mut triangle.vertices) {
            corner.y *= 1.0 + corner.x;
        }
        assert_eq!(thickness(&wedge), None);
        assert_eq!(thickness(&block(Vec3::ONE)[..2]), None);
        assert_eq!(thickness(&[]), None);
    }
}
