//! Decides by the shape of a mesh whether its glass is solid or thin-walled.
//!
//! Blender writes no thickness although its users mean solids. In its files, closed parts of glass meshes
//! therefore bound volumes. In all files, a flat sheet of glass with a thickness becomes a thin wall of that
//! thickness. A material that occurs in several forms is copied for each form.

use std::collections::BTreeMap;

use glam::Vec3;
use gltf::json;
use photoncard_picture::allocation;

use super::document::Document;
use crate::error::SceneError;
use crate::{Material, Reflection, Scene, Transmission, Triangle, parts};

/// Memory per edge of a triangle while edges are matched, bytes.
const BYTES_OF_AN_EDGE: u64 = 64;
/// Maximum ratio of a sheet's stated thickness to its extent at which it becomes a thin wall. Water surfaces
/// exceed it, because their thickness is the depth of the water.
const THIN: f32 = 0.1;
/// Tolerances of flatness: the maximum distance from the plane is `UNEVEN[0] extent + UNEVEN[1] c`, where c
/// is the greatest absolute coordinate.
const UNEVEN: [f32; 2] = [1e-4, 1e-6];

/// Names of glass materials, by what became of some of their surfaces.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Resolved {
    /// Materials whose closed parts became solid.
    pub(super) solid: Vec<String>,
    /// Materials whose flat sheets became thin walls.
    pub(super) walls: Vec<String>,
    /// Materials with a thickness on open parts that are not flat.
    pub(super) open: Vec<String>,
}

/// Indices of triangles by material and by form.
type Surfaces = BTreeMap<u32, BTreeMap<Form, Vec<u32>>>;

/// Form of a part of a glass surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Form {
    AsStated,
    Solid,
    Wall,
    /// Open surface for which the file states a volume. It is left unchanged.
    Open,
}

/// Makes closed parts of glass meshes solid if their material states no thickness, in files of Blender. Makes
/// flat sheets of glass thin-walled if their material states a thickness, in all files.
///
/// # Errors
/// If the system refuses the memory for the edges.
pub(super) fn resolve(document: &Document, scene: &mut Scene) -> Result<Resolved, SceneError> {
    let is_considered: Vec<bool> = scene
        .materials
        .iter()
        .map(|material| transmission(material).is_some_and(|it| it.is_volume || document.is_of_blender()))
        .collect();
    let of_glass = |triangle: &Triangle| is_considered[triangle.material as usize];
    let glass: Vec<u32> = (0..)
        .zip(&scene.triangles)
        .filter(|(_, triangle)| of_glass(triangle))
        .map(|(index, _)| index)
        .collect();
    allocation::check(3 * glass.len() as u64 * BYTES_OF_AN_EDGE)
        .map_err(|error| SceneError::memory(&document.path, "matching edges of glass", error))?;
    let corners: Vec<[Vec3; 3]> =
        glass.iter().map(|&index| scene.triangles[index as usize].vertices).collect();
    let thicknesses: Vec<f32> =
        (0..scene.materials.len()).map(|index| stated_thickness(document, index)).collect();
    let mut surfaces = Surfaces::default();
    for part in parts(&corners) {
        let triangles = || part.triangles.iter().map(|&index| &corners[index as usize]);
        // Two sheets back to back are closed, but enclose no volume.
        let is_flat = is_flat(&triangles());
        let is_closed = part.is_closed && !is_flat;
        let extent = extent(triangles());
        for &index in &part.triangles {
            let triangle = glass[index as usize];
            let material = scene.triangles[triangle as usize].material;
            let is_volume = transmission(&scene.materials[material as usize]).is_some_and(|it| it.is_volume);
            let is_thin = is_flat && thicknesses[material as usize] <= THIN * extent;
            let form = match (is_closed, is_volume) {
                (true, false) => Form::Solid,
                (false, true) if is_thin => Form::Wall,
                (false, true) => Form::Open,
                _ => Form::AsStated,
            };
            surfaces.entry(material).or_default().entry(form).or_default().push(triangle);
        }
    }
    let names = |form: Form| {
        let materials = surfaces.iter().filter(|(_, of_forms)| of_forms.contains_key(&form));
        materials.map(|(&material, _)| scene.materials[material as usize].name.clone()).collect()
    };
    let [solid, walls, open] = [Form::Solid, Form::Wall, Form::Open].map(names);
    change(scene, &surfaces, &thicknesses);
    Ok(Resolved { solid, walls, open })
}

/// Replaces the material of triangles whose form differs from the stated one. The material is copied if its
/// surfaces have several forms.
fn change(scene: &mut Scene, surfaces: &Surfaces, thicknesses: &[f32]) {
    for (&material, of_forms) in surfaces {
        let original = scene.materials[material as usize].clone();
        for (&form, triangles) in of_forms.iter().filter(|(form, _)| [Form::Solid, Form::Wall].contains(form))
        {
            let changed = of_form(&original, form, thicknesses[material as usize]);
            if of_forms.len() == 1 {
                scene.materials[material as usize] = changed;
            } else {
                let copy = scene.materials.len() as u32;
                scene.materials.push(changed);
                triangles.iter().for_each(|&triangle| scene.triangles[triangle as usize].material = copy);
            }
        }
    }
}

/// Copy of a glass material in another form. The base colour of a wall includes the absorption over
/// `thickness` metres.
fn of_form(material: &Material, form: Form, thickness: f32) -> Material {
    let mut material = material.clone();
    if let Reflection::MetallicRoughness { base_colour, transmission: Some(transmission), .. } =
        &mut material.reflection
    {
        transmission.is_volume = form == Form::Solid;
        if form == Form::Wall {
            let depth = transmission.absorption * -thickness;
            *base_colour *= Vec3::from_array(depth.to_array().map(libm::expf));
            transmission.absorption = Vec3::ZERO;
        }
    }
    material
}

/// Transmission of a material; `None` if it transmits no light.
pub(super) fn transmission(material: &Material) -> Option<Transmission> {
    let Reflection::MetallicRoughness { transmission, .. } = material.reflection else { return None };
    transmission.filter(|transmission| transmission.factor > 0.0)
}

/// Thickness that the file states for a material of the scene, metres; 0 if it states none.
fn stated_thickness(document: &Document, material: usize) -> f32 {
    let of =
        |material: &json::Material| Some(material.extensions.as_ref()?.volume.as_ref()?.thickness_factor.0);
    document.root.materials.get(material).and_then(of).unwrap_or(0.0)
}

/// Extent of triangles: the length of the diagonal of their bounding box, metres.
fn extent<'a>(triangles: impl Iterator<Item = &'a [Vec3; 3]>) -> f32 {
    let bounds = triangles.flatten().map(|&corner| [corner, corner]);
    let bounds = bounds.reduce(|[lower, upper], [corner, _]| [lower.min(corner), upper.max(corner)]);
    bounds.map_or(0.0, |[lower, upper]| lower.distance(upper))
}

/// Returns whether triangles lie in one plane.
fn is_flat<'a>(triangles: &(impl Iterator<Item = &'a [Vec3; 3]> + Clone)) -> bool {
    let normal = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a);
    let largest =
        triangles.clone().max_by(|a, b| normal(a).length_squared().total_cmp(&normal(b).length_squared()));
    let Some(largest) = largest else { return false };
    let axis = normal(largest).normalize_or_zero();
    let corners = || triangles.clone().flatten();
    let greatest = corners().map(|corner| corner.abs().max_element()).fold(0.0, f32::max);
    let tolerance = UNEVEN[0] * extent(triangles.clone()) + UNEVEN[1] * greatest;
    corners().all(|corner| axis.dot(*corner - largest[0]).abs() <= tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_is_flat_whichever_way_it_is_turned_and_a_bent_one_is_not() {
        let sheet = |bend: f32| {
            let corner = |x: f32, y: f32| Vec3::new(x, y, 0.3 * x - 0.7 * y + bend * x * y + 4.0);
            let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            [[a, b, c], [a, c, d]]
        };
        assert!(is_flat(&sheet(0.0).iter()));
        assert!(!is_flat(&sheet(0.01).iter()));
        assert!(!is_flat(&[].iter()));
    }
}
