//! Primitives of a mesh: topology, and accessors of vertex attributes.

use std::cell::OnceCell;
use std::collections::HashSet;

use glam::{DVec3, Vec4};
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;
use photoncard_picture::allocation::OutOfMemory;

use super::accessor::{Elements, Format, Integers, Source};
use super::draco::Decoded;
use super::morph::{self, MorphTarget};
use super::offset::Bounds;
use super::room::{self, Room};
use super::topology::Topology;
use crate::error::SceneError;

const FLOATS: &[ComponentType] = &[ComponentType::F32];
const FRACTIONS: &[ComponentType] = &[ComponentType::F32, ComponentType::U8, ComponentType::U16];
/// Component types that `KHR_mesh_quantization` allows.
const QUANTIZED: &[ComponentType] =
    &[ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];

const INDICES: Format = Format {
    types: &[Type::Scalar],
    components: &[ComponentType::U8, ComponentType::U16, ComponentType::U32],
    integers: Integers::Whole,
};
const COLOURS: Format =
    Format { types: &[Type::Vec3, Type::Vec4], components: FRACTIONS, integers: Integers::Normalized };
const JOINTS: Format = Format {
    types: &[Type::Vec4],
    components: &[ComponentType::U8, ComponentType::U16],
    integers: Integers::Whole,
};
const WEIGHTS: Format =
    Format { types: &[Type::Vec4], components: FRACTIONS, integers: Integers::Normalized };

// Formats of vertex attributes, with `KHR_mesh_quantization` or without it.

const fn positions(is_quantized: bool) -> Format {
    let components = if is_quantized { QUANTIZED } else { FLOATS };
    Format { types: &[Type::Vec3], components, integers: Integers::AsStated }
}

const fn normals(is_quantized: bool) -> Format {
    let components = if is_quantized { QUANTIZED } else { FLOATS };
    Format { types: &[Type::Vec3], components, integers: Integers::Normalized }
}

const fn coordinates(is_quantized: bool) -> Format {
    let components = if is_quantized { QUANTIZED } else { FRACTIONS };
    let integers = if is_quantized { Integers::AsStated } else { Integers::Normalized };
    Format { types: &[Type::Vec2], components, integers }
}

const fn tangents(is_quantized: bool) -> Format {
    let components = if is_quantized { QUANTIZED } else { FLOATS };
    Format { types: &[Type::Vec4], components, integers: Integers::Normalized }
}

/// Tangents of a primitive, in the mesh's space.
pub(super) enum Tangents {
    /// Stated by the `TANGENT` attribute.
    Stated,
    /// Computed by `MikkTSpace`, triangle by triangle.
    Computed(Vec<[Vec4; 3]>),
}

/// Primitive of triangles whose accessors are within bounds.
pub(super) struct Primitive<'a> {
    pub(super) index: usize,
    pub(super) triangles: u64,
    /// True if the primitive's last vertices form no whole triangle.
    pub(super) has_incomplete: bool,
    topology: Topology,
    pub(super) positions: Elements<'a>,
    pub(super) indices: Option<Elements<'a>>,
    pub(super) normals: Option<Elements<'a>>,
    /// Stated tangents, if the material has a normal map.
    pub(super) tangents: Option<Elements<'a>>,
    /// Index of the set of texture coordinates along whose u the tangents point, if the material has a normal
    /// map.
    pub(super) tangent_set: Option<usize>,
    /// Checked or computed tangents; empty before the first instance is placed.
    pub(super) known_tangents: OnceCell<Tangents>,
    /// Texture coordinates of the sets that the material uses.
    pub(super) coordinates: [Option<Elements<'a>>; 2],
    pub(super) colours: Option<Elements<'a>>,
    /// `JOINTS_n` and `WEIGHTS_n` for each n: four joints of a vertex and their weights.
    pub(super) influences: Vec<(Elements<'a>, Elements<'a>)>,
    /// Morph targets, in the mesh's order.
    pub(super) targets: Vec<MorphTarget<'a>>,
    /// Index of the material in the scene.
    pub(super) material: u32,
}

struct AttributeReader<'s, 'a> {
    source: &'s Source<'a>,
    item: String,
    primitive: &'s json::mesh::Primitive,
    /// Decoded attributes, if the primitive is compressed.
    decoded: Option<Decoded<'s>>,
}

impl<'a> AttributeReader<'_, 'a> {
    fn get(&self, semantic: Semantic, format: &Format) -> Result<Option<Elements<'a>>, SceneError> {
        let name = semantic.to_string();
        let item = format!("{}.attributes.{name}", self.item);
        let Some(accessor) = self.primitive.attributes.get(&Checked::Valid(semantic)) else {
            return Ok(None);
        };
        let decompress = |header| match &self.decoded {
            Some(decoded) => decoded.attribute(&name, header),
            None => Ok(None),
        };
        Elements::decompressed(self.source, accessor.value(), &item, format, decompress).map(Some)
    }

    fn indices(&self) -> Result<Option<Elements<'a>>, SceneError> {
        if let Some(decoded) = &self.decoded {
            return Ok(Some(decoded.indices()));
        }
        let item = format!("{}.indices", self.item);
        let accessor = self.primitive.indices;
        accessor.map(|accessor| Elements::new(self.source, accessor.value(), &item, &INDICES)).transpose()
    }

    /// Reads an attribute. Its count must be that of the positions.
    fn of_count(
        &self,
        count: u64,
        semantic: Semantic,
        format: &Format,
    ) -> Result<Option<Elements<'a>>, SceneError> {
        let item = format!("{}.attributes.{}", self.item, semantic.to_string());
        let elements = self.get(semantic, format)?;
        match elements.as_ref().map(|elements| elements.count).filter(|found| *found != count) {
            None => Ok(elements),
            Some(found) => {
                let reason = format!("there are {found} of them, and {count} positions");
                let remedy = "export the mesh again; its attributes do not fit together";
                Err(self.source.document.invalid(item, reason, remedy))
            }
        }
    }
}

impl<'a> Primitive<'a> {
    /// Reads primitive `index` of a mesh, with the sets of texture coordinates that its material uses and the
    /// set that defines its tangents.
    pub(super) fn new(
        source: &Source<'a>,
        mesh: usize,
        index: usize,
        topology: Topology,
        material: u32,
        (used_sets, tangent_set): ([bool; 2], Option<usize>),
    ) -> Result<Self, SceneError> {
        let document = source.document;
        let primitive = &document.root.meshes[mesh].primitives[index];
        let item = format!("meshes[{mesh}].primitives[{index}]");
        let decoded = Decoded::of(source, mesh, index, topology)?;
        // The stream of a compressed primitive is a list of triangles, whatever the primitive's mode.
        let topology = if decoded.is_some() { Topology::List } else { topology };
        let attributes = AttributeReader { source, item: item.clone(), primitive, decoded };
        let is_quantized = document.is_quantized();
        let positions = attributes.get(Semantic::Positions, &positions(is_quantized))?.ok_or_else(|| {
            let reason = "the primitive has no POSITION";
            document.invalid(&item, reason, "export the mesh again, with vertex positions")
        })?;
        let of_count = |semantic, format: &Format| attributes.of_count(positions.count, semantic, format);
        let mut sets = [None, None];
        for (set, found) in sets.iter_mut().enumerate().filter(|(set, _)| used_sets[*set]) {
            *found = of_count(Semantic::TexCoords(set as u32), &coordinates(is_quantized))?;
            if found.is_none() {
                let reason =
                    format!("its material has a texture that takes TEXCOORD_{set}, which is not there");
                let remedy = "unwrap the mesh in the modelling tool, or take the texture off its material";
                return Err(document.invalid(format!("{item}.attributes"), reason, remedy));
            }
        }
        let indices = attributes.indices()?;
        let count = indices.as_ref().map_or(positions.count, |indices| indices.count);
        let (triangles, has_incomplete) = topology.triangles(count);
        let normals = of_count(Semantic::Normals, &normals(is_quantized))?;
        // Without normals tangents are ignored (glTF 2.0, 3.7.2.1).
        let tangents = match tangent_set {
            Some(_) if normals.is_some() => of_count(Semantic::Tangents, &tangents(is_quantized))?,
            _ => None,
        };
        Ok(Self {
            index,
            triangles,
            has_incomplete,
            topology,
            normals,
            tangents,
            tangent_set,
            known_tangents: OnceCell::new(),
            coordinates: sets,
            colours: of_count(Semantic::Colors(0), &COLOURS)?,
            influences: influences(&attributes, positions.count)?,
            targets: morph::targets(source, &item, primitive, positions.count)?,
            material,
            positions,
            indices,
        })
    }

    /// Returns whether the triangles may have attributes beyond positions, according to the accessors.
    pub(super) fn may_have_attributes(&self) -> bool {
        self.is_mapped() || self.normals.is_some() || self.colours.is_some()
    }

    pub(super) fn is_mapped(&self) -> bool {
        self.coordinates.iter().any(Option::is_some)
    }

    /// Lower bound of the card memory that each stored copy of the primitive takes, bytes.
    ///
    /// # Errors
    /// If the system refuses the memory for the set of vertex positions.
    pub(super) fn bytes_of_a_card(&self) -> Result<u64, OutOfMemory> {
        let sets = 1 + u64::from(self.coordinates[1].is_some());
        // Normals may equal the triangles' own, and colours may be white: these need no records.
        let has_tangents = self.tangent_set.is_some();
        let attributes =
            if self.is_mapped() { room::attributes(self.triangles, sets, has_tangents) } else { 0 };
        Ok(Room::geometry(self.triangles, self.corners_in_different_places()?) + attributes)
    }

    /// Counts distinct vertex positions. The set grows with the positions that the file contains, not with a
    /// count that it states, so a small hostile file cannot take much memory.
    fn corners_in_different_places(&self) -> Result<u64, OutOfMemory> {
        let mut places = HashSet::new();
        for corner in (0..self.triangles).flat_map(|triangle| self.corners(triangle)) {
            let vertex = self.indices.as_ref().map_or(corner, |indices| indices.unsigned(corner));
            places.try_reserve(1).map_err(|_| OutOfMemory::doubling::<[u32; 3]>(places.len()))?;
            places.insert(self.positions.vec3(vertex).map(f32::to_bits));
        }
        Ok(places.len() as u64)
    }

    /// Bounds, in the mesh's space, of the vertices that the triangles use.
    pub(super) fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for corner in (0..self.triangles).flat_map(|triangle| self.corners(triangle)) {
            let vertex = self.indices.as_ref().map_or(corner, |indices| indices.unsigned(corner));
            if vertex < self.positions.count {
                bounds.add(DVec3::from(self.positions.vec3(vertex).map(f64::from)));
            }
        }
        bounds
    }

    /// Positions of a triangle's corners in the primitive's index list. Without an index list, they are the
    /// indices of the vertices.
    pub(super) fn corners(&self, triangle: u64) -> [u64; 3] {
        self.topology.vertices(triangle)
    }
}

fn influences<'a>(
    attributes: &AttributeReader<'_, 'a>,
    count: u64,
) -> Result<Vec<(Elements<'a>, Elements<'a>)>, SceneError> {
    let mut pairs = Vec::new();
    loop {
        let set = pairs.len() as u32;
        let joints = attributes.of_count(count, Semantic::Joints(set), &JOINTS)?;
        let weights = attributes.of_count(count, Semantic::Weights(set), &WEIGHTS)?;
        let (Some(joints), Some(weights)) = (joints, weights) else { return Ok(pairs) };
        pairs.push((joints, weights));
    }
}
