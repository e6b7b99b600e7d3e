//! The scene with its lightmaps as a glb file: a node and a mesh for each object, a primitive for each
//! material, page and scale.

use std::collections::{BTreeMap, HashMap};

use glam::DVec2;
use photoncard_scene::Triangle;
use serde_json::{Map, Value, json};

use super::baked::Baked;
use super::error::BakeError;
use super::file::File;
use super::materials::Materials;
use super::pages::{Scales, srgb_png};
use super::plan::Plan;
use super::surfaces::{Primitive, Surfaces};

/// Form of the materials of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MaterialForm {
    /// Black, with the outgoing radiance as emission: the file shows its light without lights.
    #[default]
    Baked,
    /// As in the scene, with the irradiance as a loose texture that `extras` name.
    Kept,
}

photoncard_picture::choices!(MaterialForm { Baked = "baked", Kept = "kept" });

/// Linear filters without mipmaps, which would mix charts; clamped to the edge.
const FILTERS: [u32; 2] = [9729, 9729];
const CLAMPED: [u32; 2] = [33_071, 33_071];

/// A corner of a triangle, as bits, which are equal for equal vertices.
type Corner = [u32; 16];

/// Vertices of a primitive.
#[derive(Default)]
struct Vertices {
    numbers: HashMap<Corner, u32>,
    corners: Vec<Corner>,
    indices: Vec<u32>,
}

/// Values of a material that is being written.
struct Writer<'a> {
    plan: &'a Plan,
    form: MaterialForm,
    materials: Materials<'a>,
    scales: Scales,
    /// Chart of each triangle, and places of its corners on the chart's page.
    places: BTreeMap<u32, (u32, [DVec2; 3])>,
    /// Texture of each page.
    textures: Vec<usize>,
    /// Materials that stay, by their number in the scene.
    kept: BTreeMap<u32, usize>,
}

/// Bytes of a glb file of the scene with its lightmaps. If `rgbm` names files, one a page, the file's extras
/// name them and their range.
///
/// # Errors
/// If an image cannot be encoded, or the file has 4 GB or more.
pub fn write(plan: &Plan, baked: &Baked, form: MaterialForm, rgbm: &[String]) -> Result<Vec<u8>, BakeError> {
    let mut extras = Map::new();
    if !rgbm.is_empty() {
        extras.insert("rgbm".into(), json!({ "files": rgbm, "range": baked.range() }));
    }
    let surfaces = plan.surfaces();
    let pages = match form {
        MaterialForm::Baked => &baked.radiance,
        MaterialForm::Kept => &baked.irradiance,
    };
    let mut file = File::default();
    let scales = match form {
        MaterialForm::Baked => Scales::of_charts(pages, surfaces.primitives.len(), plan.atlas().charts.len()),
        // A program multiplies lightmaps.
        MaterialForm::Kept => Scales::even(pages, surfaces.primitives.len()),
    };
    let mut textures = Vec::with_capacity(pages.len());
    for (number, page) in pages.iter().enumerate() {
        let image = file.image(&format!("lightmap {number}"), &srgb_png(page, &scales)?);
        textures.push(file.texture(image, FILTERS, CLAMPED));
    }
    let places = (0..).zip(&plan.atlas().charts).flat_map(|(index, chart)| {
        let of_chart = move |places: &[DVec2; 3]| (index, *places);
        chart.triangles.iter().copied().zip(chart.places.iter().map(of_chart))
    });
    let places = places.collect();
    let materials = Materials::new(&surfaces.scene);
    let mut writer = Writer { plan, form, materials, scales, places, textures, kept: BTreeMap::new() };
    let alike = |one: &(usize, &Primitive), other: &(usize, &Primitive)| one.1.object == other.1.object;
    let numbered: Vec<_> = surfaces.primitives.iter().enumerate().collect();
    for object in numbered.chunk_by(alike) {
        writer.object(&mut file, object)?;
    }
    extras.insert("texels_per_metre".into(), json!(plan.atlas().density));
    extras.insert("lightmaps".into(), json!(writer.textures));
    let mut roots: Vec<usize> = (0..file.nodes.len()).collect();
    let offset = surfaces.scene.offset.to_array();
    if offset != [0.0; 3] {
        file.nodes.push(json!({ "name": "origin", "translation": offset, "children": roots }));
        roots = vec![file.nodes.len() - 1];
    }
    file.finish(&roots, &extras.into())
}

impl Writer<'_> {
    fn object(&mut self, file: &mut File, primitives: &[(usize, &Primitive)]) -> Result<(), BakeError> {
        let mut written = Vec::new();
        for &(number, primitive) in primitives {
            // The charts of a primitive may lie on several pages and have several scales: each is a material.
            let mut parts: BTreeMap<Option<(u32, u32)>, Vec<u32>> = BTreeMap::new();
            for &triangle in &primitive.triangles {
                parts.entry(self.light(number as u32, triangle)).or_default().push(triangle);
            }
            for (part, triangles) in parts {
                let light = part.map(|(page, scale)| (page, f32::from_bits(scale)));
                written.push(self.primitive(file, primitive, light, &triangles)?);
            }
        }
        let object = primitives.first().map_or(0, |(_, primitive)| primitive.object);
        let name = self.plan.surfaces().name(object);
        file.meshes.push(json!({ "name": name, "primitives": written }));
        file.nodes.push(json!({ "name": name, "mesh": file.meshes.len() - 1 }));
        Ok(())
    }

    /// Page of a triangle and the bits of its scale there; `None` without a lightmap.
    fn light(&self, primitive: u32, triangle: u32) -> Option<(u32, u32)> {
        let (chart, _) = self.places.get(&triangle)?;
        let page = self.plan.atlas().charts.get(*chart as usize)?.page;
        Some((page, self.scales.of(primitive, *chart).to_bits()))
    }

    /// Part of a primitive; `light` is its page and scale.
    fn primitive(
        &mut self,
        file: &mut File,
        primitive: &Primitive,
        light: Option<(u32, f32)>,
        triangles: &[u32],
    ) -> Result<Value, BakeError> {
        let vertices = self.vertices(triangles);
        let corners = &vertices.corners;
        let mut attributes = Map::new();
        let mut add = |name: &str, accessor: usize| attributes.insert(name.into(), json!(accessor));
        add("POSITION", file.vectors(&values::<3>(corners, 0), true));
        add("NORMAL", file.vectors(&values::<3>(corners, 3), false));
        add("TEXCOORD_0", file.vectors(&values::<2>(corners, 6), false));
        if light.is_some() {
            add("TEXCOORD_1", file.vectors(&values::<2>(corners, 10), false));
        }
        let second = values::<2>(corners, 8);
        if second.iter().any(|place| *place != [0.0; 2]) {
            let name = if light.is_some() { "TEXCOORD_2" } else { "TEXCOORD_1" };
            add(name, file.vectors(&second, false));
        }
        let colours = values::<4>(corners, 12);
        if colours.iter().any(|colour| *colour != [1.0; 4]) {
            add("COLOR_0", file.vectors(&colours, false));
        }
        let indices = file.indices(&vertices.indices);
        let material = self.material(file, primitive, light)?;
        Ok(json!({ "attributes": attributes, "indices": indices, "material": material }))
    }

    fn material(
        &mut self,
        file: &mut File,
        primitive: &Primitive,
        light: Option<(u32, f32)>,
    ) -> Result<usize, BakeError> {
        let surfaces = self.plan.surfaces();
        let Some(material) = surfaces.scene.materials.get(primitive.material as usize) else { return Ok(0) };
        let light = light.and_then(|(page, scale)| Some((*self.textures.get(page as usize)?, scale)));
        let Some((texture, scale)) = light else {
            if let Some(&written) = self.kept.get(&primitive.material) {
                return Ok(written);
            }
            let kept = self.materials.kept(file, material, [0, 1])?;
            file.materials.push(kept.into());
            self.kept.insert(primitive.material, file.materials.len() - 1);
            return Ok(file.materials.len() - 1);
        };
        let mut written = match self.form {
            MaterialForm::Baked => self.materials.baked(file, material, [0, 2], (texture, scale))?,
            MaterialForm::Kept => self.materials.kept(file, material, [0, 2])?,
        };
        let quantity = match self.form {
            MaterialForm::Baked => "radiance",
            MaterialForm::Kept => "irradiance",
        };
        let lightmap = json!({
            "texture": texture, "texCoord": 1, "scale": scale, "encoding": "srgb", "quantity": quantity
        });
        let extras = written.entry("extras").or_insert_with(|| json!({ "photoncard": {} }));
        if let Some(own) = extras.get_mut("photoncard").and_then(Value::as_object_mut) {
            own.insert("lightmap".into(), lightmap);
        }
        let written = Value::from(written);
        // Equal materials of several objects are one.
        let known = file.materials.iter().position(|other| *other == written);
        Ok(known.unwrap_or_else(|| {
            file.materials.push(written);
            file.materials.len() - 1
        }))
    }

    fn vertices(&self, triangles: &[u32]) -> Vertices {
        let mut vertices = Vertices::default();
        for &index in triangles {
            let triangle = self.plan.surfaces().triangle(index);
            for corner in self.corners(index, &triangle) {
                let next = vertices.corners.len() as u32;
                let number = *vertices.numbers.entry(corner).or_insert(next);
                if number == next {
                    vertices.corners.push(corner);
                }
                vertices.indices.push(number);
            }
        }
        vertices
    }

    /// Position, normal, both sets of coordinates, place on the page and colour of a triangle's corners.
    fn corners(&self, index: u32, triangle: &Triangle) -> [Corner; 3] {
        let surfaces: &Surfaces = self.plan.surfaces();
        let attributes = surfaces.attributes(triangle);
        let normals = surfaces.normals(triangle);
        let size = f64::from(self.plan.atlas().size);
        let places = self.places.get(&index).map_or([DVec2::ZERO; 3], |(_, places)| *places);
        std::array::from_fn(|corner| {
            let [first, second] = attributes.coordinates.map(|set| set[corner].to_array());
            let place = (places[corner] / size).as_vec2().to_array();
            let position = triangle.vertices[corner].to_array();
            let values = position.into_iter().chain(normals[corner].to_array()).chain(first);
            let values = values.chain(second).chain(place).chain(attributes.colours[corner]);
            let mut bits = [0; 16];
            bits.iter_mut().zip(values).for_each(|(bits, value)| *bits = (value + 0.0).to_bits());
            bits
        })
    }
}

/// Vectors of corners: `N` values from number `from` on.
fn values<const N: usize>(corners: &[Corner], from: usize) -> Vec<[f32; N]> {
    let vector = |corner: &Corner| {
        let mut vector = [0.0; N];
        let own = corner.iter().skip(from);
        vector.iter_mut().zip(own).for_each(|(value, bits)| *value = f32::from_bits(*bits));
        vector
    };
    corners.iter().map(vector).collect()
}
