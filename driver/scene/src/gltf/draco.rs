//! Compressed primitives (`KHR_draco_mesh_compression`), decoded by the crate `draco-core`.
//!
//! The length of a stream does not bound its contents: equal values may take no bytes. The decoder therefore
//! refuses counts above those of the primitive's accessors before it allocates. The counts are compared again
//! after decoding.

use std::collections::BTreeMap;

use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex};
use gltf::json;
use gltf::json::accessor::ComponentType;
use gltf::json::validation::Checked;
use photoncard_picture::allocation;
use photoncard_picture::foreign;
use serde::Deserialize;

use super::accessor::{Elements, Header, Source};
use super::compression::MAX_DECODED;
use super::document::Document;
use super::extensions::DRACO;
use super::limits::MAX_TRIANGLES;
use super::topology::Topology;
use crate::error::SceneError;

/// Assumed memory of the decoder per triangle, bytes. Without attribute seams the decoder takes 110 bytes,
/// with seams more.
const TRIANGLE_BYTES: u64 = 256;

/// Size of a triangle's indices, bytes.
const INDICES_BYTES: u64 = 3 * size_of::<u32>() as u64;

/// Maximum size per vertex of attributes that are in the stream but that the extension does not name, bytes.
const UNNAMED_BYTES: u64 = 64;

const REMEDY: &str =
    "compress the file again, or decompress it, for example by `npx @gltf-transform/cli copy IN.glb OUT.glb`";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Extension {
    buffer_view: usize,
    /// Unique ids of attributes in the stream, by their names in the primitive.
    attributes: BTreeMap<String, u32>,
}

/// Counts that a stream must have, according to the accessors of its primitive.
struct Counts {
    vertices: u64,
    /// Number of triangles. A strip may have fewer, because the stream lacks those of zero area.
    triangles: u64,
    /// Size of the attributes of one vertex, bytes.
    vertex_bytes: u64,
}

pub(super) struct Decoded<'s> {
    document: &'s Document,
    item: String,
    attributes: BTreeMap<String, u32>,
    mesh: Mesh,
}

impl<'s> Decoded<'s> {
    /// Decodes primitive `index` of a mesh, if it is compressed.
    pub(super) fn of(
        source: &Source<'s>,
        mesh: usize,
        index: usize,
        topology: Topology,
    ) -> Result<Option<Self>, SceneError> {
        let document = source.document;
        let primitive = &document.root.meshes[mesh].primitives[index];
        let Some(value) = primitive.extensions.as_ref().and_then(|extensions| extensions.others.get(DRACO))
        else {
            return Ok(None);
        };
        let item = format!("meshes[{mesh}].primitives[{index}].extensions.{DRACO}");
        let invalid = |reason: String| document.invalid(&item, reason, REMEDY);
        let extension = Extension::deserialize(value).map_err(|error| invalid(error.to_string()))?;
        let stream = source.bytes(extension.buffer_view, &item)?;
        let counts = Counts::of(document, primitive, topology, &extension).map_err(invalid)?;
        counts.check_memory(source, &item)?;
        let mesh = decode(stream, &counts).map_err(invalid)?;
        counts.check(topology, &mesh).map_err(invalid)?;
        Ok(Some(Self { document, item, attributes: extension.attributes, mesh }))
    }

    /// Packed elements of an attribute in the format of `accessor`; `None` if the attribute is not
    /// compressed.
    pub(super) fn attribute(&self, name: &str, accessor: Header) -> Result<Option<Vec<u8>>, SceneError> {
        let Some(&id) = self.attributes.get(name) else { return Ok(None) };
        let invalid = |reason: String| {
            self.document.invalid(format!("{}.attributes.{name}", self.item), reason, REMEDY)
        };
        let attribute = self.mesh.attribute_by_unique_id(id);
        let attribute = attribute.ok_or_else(|| invalid(format!("its stream has no attribute {id}")))?;
        let (found, components) = (attribute.data_type(), usize::from(attribute.num_components()));
        if component(found) != Some(accessor.component) || components != accessor.kind.multiplicity() {
            let reason = format!(
                "its stream has {components} components of {found:?}, and its accessor {:?} of {:?}",
                accessor.kind, accessor.component
            );
            return Err(invalid(reason));
        }
        let points = self.mesh.num_points();
        if accessor.count != points as u64 {
            let reason = format!("its stream has {points} vertices, and its accessor {}", accessor.count);
            return Err(invalid(reason));
        }
        let mut bytes = Vec::with_capacity(points * accessor.size());
        for point in 0..points {
            let value = value(attribute, point, accessor.size());
            bytes.extend(value.ok_or_else(|| invalid(format!("its stream has no value of vertex {point}")))?);
        }
        Ok(Some(bytes))
    }

    /// Indices of the primitive's triangles.
    pub(super) fn indices<'a>(&self) -> Elements<'a> {
        Elements::indices(self.mesh.faces().iter().flatten().map(|point| point.0))
    }
}

impl Counts {
    fn of(
        document: &Document,
        primitive: &json::mesh::Primitive,
        topology: Topology,
        extension: &Extension,
    ) -> Result<Self, String> {
        let accessors = &document.root.accessors;
        let indices = primitive.indices.ok_or("a compressed primitive has no indices")?;
        let indices = accessors[indices.value()].count.0;
        let triangles = match topology {
            Topology::List => indices / 3,
            Topology::Strip => indices.saturating_sub(2),
            Topology::Fan => return Err("a fan of triangles cannot be compressed".to_owned()),
        };
        let (mut vertices, mut vertex_bytes) = (0, 0);
        for (semantic, accessor) in &primitive.attributes {
            let Checked::Valid(semantic) = semantic else { continue };
            let accessor = &accessors[accessor.value()];
            if !extension.attributes.contains_key(&semantic.to_string()) {
                continue;
            }
            if let (Checked::Valid(kind), Checked::Valid(component)) =
                (accessor.type_, accessor.component_type)
            {
                vertices = vertices.max(accessor.count.0);
                vertex_bytes += (kind.multiplicity() * component.0.size()) as u64;
            }
        }
        Ok(Self { vertices, triangles, vertex_bytes })
    }

    /// Maximum size of all attributes in the stream, bytes.
    fn stream_bytes(&self) -> u64 {
        self.vertices.saturating_mul(self.vertex_bytes + UNNAMED_BYTES)
    }

    /// Size of the attributes and indices that stay in memory, bytes.
    fn kept_bytes(&self) -> u64 {
        let attributes = self.vertices.saturating_mul(self.vertex_bytes);
        attributes.saturating_add(self.triangles.saturating_mul(INDICES_BYTES))
    }

    /// Adds this primitive to the sums over all decompressed primitives. Checks that the sums stay within
    /// limits, and that the process can have the memory to decompress the primitive.
    fn check_memory(&self, source: &Source<'_>, item: &str) -> Result<(), SceneError> {
        let (document, sums) = (source.document, &source.decompressed);
        let triangles = sums.triangles.get().saturating_add(self.triangles);
        if triangles > MAX_TRIANGLES as u64 {
            return Err(SceneError::TooManyTriangles { file: document.path.clone(), limit: MAX_TRIANGLES });
        }
        let kept = sums.bytes.get().saturating_add(self.kept_bytes());
        if kept > MAX_DECODED {
            let reason = format!(
                "the compressed primitives up to this one, of {} vertices, take {kept} bytes, more than {MAX_DECODED}",
                self.vertices
            );
            return Err(document.invalid(item, reason, REMEDY));
        }
        sums.triangles.set(triangles);
        sums.bytes.set(kept);
        let bytes = self.stream_bytes().saturating_add(self.triangles.saturating_mul(TRIANGLE_BYTES));
        allocation::check(bytes)
            .map_err(|error| SceneError::memory(&document.path, "decompressing its primitives", error))
    }

    /// Checks the number of triangles of a decoded stream.
    fn check(&self, topology: Topology, mesh: &Mesh) -> Result<(), String> {
        let found = mesh.num_faces() as u64;
        // A strip's triangles of zero area are not in the stream.
        if found == self.triangles || topology == Topology::Strip && found < self.triangles {
            return Ok(());
        }
        Err(format!("its stream has {found} triangles, and the accessor of its indices {}", self.triangles))
    }
}

fn decode(stream: &[u8], counts: &Counts) -> Result<Mesh, String> {
    let limits = DecodeLimits::default()
        .with_max_points(counts.vertices)
        .with_max_faces(counts.triangles)
        .with_max_decoded_bytes(counts.stream_bytes());
    let mut buffer = DecoderBuffer::new(stream).with_limits(limits);
    foreign::decode(
        || {
            let mut mesh = Mesh::new();
            let done = MeshDecoder::new().decode(&mut buffer, &mut mesh);
            done.map(|()| mesh).map_err(|error| format!("its stream is damaged, or of another size: {error}"))
        },
        || "its stream is damaged".to_owned(),
    )
}

/// Component type of glTF that equals a data type of Draco, if there is one.
fn component(kind: DataType) -> Option<ComponentType> {
    match kind {
        DataType::Int8 => Some(ComponentType::I8),
        DataType::Uint8 => Some(ComponentType::U8),
        DataType::Int16 => Some(ComponentType::I16),
        DataType::Uint16 => Some(ComponentType::U16),
        DataType::Uint32 => Some(ComponentType::U32),
        DataType::Float32 => Some(ComponentType::F32),
        _ => None,
    }
}

/// Bytes of an attribute's value at a point, which is Draco's word for a vertex.
fn value(attribute: &PointAttribute, point: usize, size: usize) -> Option<&[u8]> {
    let index = attribute.mapped_index(PointIndex(point as u32)).0 as usize;
    let stride = usize::try_from(attribute.byte_stride()).ok()?;
    let start = index.checked_mul(stride)?;
    attribute.buffer().data().get(start..start.checked_add(size)?)
}
