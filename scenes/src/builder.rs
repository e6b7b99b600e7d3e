//! Builds glTF files from meshes, materials, nodes and cameras.

use base64::Engine;
use glam::{Mat3, Quat, Vec2, Vec3};

use crate::document::{
    Accessor, Buffer, BufferView, CameraEntry, Document, ImageEntry, MaterialEntry, MeshEntry, Node,
    Perspective, Primitive, PrimitiveAttributes, Roots, Sampler, TextureEntry,
};
use crate::material::Material;
use crate::mesh::Mesh;

/// Constants of glTF: component types, targets of buffer views, and filters of samplers.
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const LINEAR: u32 = 9729;

/// Vertices and indices that are in the file. Any number of meshes can use them.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
    pub(crate) attributes: PrimitiveAttributes,
    indices: Option<usize>,
    mode: Option<u32>,
}

/// Topology of vertices without indices (glTF's `mode`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joined {
    /// `TRIANGLE_STRIP`: each vertex forms a triangle with the two before it. Every other triangle has the
    /// reverse vertex order.
    Strip,
    /// `TRIANGLE_FAN`: each vertex forms a triangle with the previous one and the first.
    Fan,
}

impl Joined {
    fn mode(self) -> u32 {
        match self {
            Self::Strip => 5,
            Self::Fan => 6,
        }
    }
}

/// Wrap mode: what a texture shows outside the texture coordinates 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image is repeated (`REPEAT`).
    Repeat,
    /// The image is repeated, and every other copy is mirrored (`MIRRORED_REPEAT`).
    Mirror,
    /// The texels at the border of the image continue (`CLAMP_TO_EDGE`).
    Clamp,
}

impl Wrap {
    fn number(self) -> u32 {
        match self {
            Self::Repeat => 10497,
            Self::Mirror => 33648,
            Self::Clamp => 33071,
        }
    }
}

/// Pinhole camera.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Position of the eye, metres.
    pub eye: Vec3,
    /// Point that is seen in the centre of the picture, metres.
    pub target: Vec3,
    /// Vertical field of view, radians.
    pub yfov: f64,
    /// Width over height.
    pub aspect_ratio: f64,
}

impl Camera {
    /// Returns the axes x, y and z of the camera's node: right, up and back. A glTF camera looks along -z,
    /// with +y up.
    fn axes(&self) -> [Vec3; 3] {
        let back = self.eye - self.target;
        // Unlike `normalize`, a division by the length leaves directions along coordinate axes exact.
        let back = back / back.length();
        let right = Vec3::Y.cross(back);
        let right = right / right.length();
        [right, back.cross(right), back]
    }

    pub(crate) fn rotation(&self) -> Quat {
        let [right, up, back] = self.axes();
        Quat::from_mat3(&Mat3::from_cols(right, up, back))
    }

    fn matrix(&self) -> [f32; 16] {
        let [right, up, back] = self.axes();
        let mut matrix = [0.0; 16];
        for (column, vector) in [right, up, back, self.eye].into_iter().enumerate() {
            // Adding zero turns -0 into 0.
            matrix[4 * column..4 * column + 3].copy_from_slice(&(vector + Vec3::ZERO).to_array());
        }
        matrix[15] = 1.0;
        matrix
    }
}

/// glTF file under construction.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    pub(crate) document: Document,
    pub(crate) roots: Vec<usize>,
    binary: Vec<u8>,
}

impl SceneBuilder {
    /// Adds a material and returns its index.
    pub fn material(&mut self, material: &Material) -> usize {
        self.document.materials.push(material.entry());
        self.document.materials.len() - 1
    }

    /// Adds an encoded image of type "image/png" or "image/jpeg"; returns its index.
    pub fn image(&mut self, name: &str, mime_type: &'static str, bytes: Vec<u8>) -> usize {
        let buffer_view = self.view(bytes, None);
        self.document.images.push(ImageEntry { name: name.into(), buffer_view, mime_type });
        self.document.images.len() - 1
    }

    /// Adds a texture with a bilinear filter and without mipmaps; returns its index.
    pub fn texture(&mut self, image: usize, [wrap_s, wrap_t]: [Wrap; 2]) -> usize {
        let sampler = Sampler {
            mag_filter: LINEAR,
            min_filter: LINEAR,
            wrap_s: wrap_s.number(),
            wrap_t: wrap_t.number(),
        };
        self.document.samplers.push(sampler);
        let sampler = self.document.samplers.len() - 1;
        self.document.textures.push(TextureEntry { sampler, source: image });
        self.document.textures.len() - 1
    }

    /// Adds the vertices and indices of a mesh. Indices have 16 bits if these suffice, else 32.
    pub fn geometry(&mut self, mesh: &Mesh) -> Geometry {
        let attributes = self.attributes(mesh);
        let indices = mesh.triangles.iter().flatten();
        // The index 0xffff means primitive restart, so that no vertex can have it.
        let (bytes, component): (Vec<u8>, u32) = if mesh.positions.len() <= 0xffff {
            (indices.flat_map(|&index| (index as u16).to_le_bytes()).collect(), UNSIGNED_SHORT)
        } else {
            (indices.flat_map(|&index| index.to_le_bytes()).collect(), UNSIGNED_INT)
        };
        let count = 3 * mesh.triangles.len();
        let indices = Some(self.accessor(bytes, Some(ELEMENT_ARRAY_BUFFER), component, count, "SCALAR"));
        Geometry { attributes, indices, mode: None }
    }

    /// Adds the vertices of a mesh without indices. Their order and `joined` define the triangles; the
    /// triangles of `mesh` are ignored.
    pub fn joined(&mut self, mesh: &Mesh, joined: Joined) -> Geometry {
        let attributes = self.attributes(mesh);
        Geometry { attributes, indices: None, mode: Some(joined.mode()) }
    }

    /// Adds the attributes of a mesh's vertices. Normals that equal the positions, as on a unit sphere, share
    /// their accessor.
    fn attributes(&mut self, mesh: &Mesh) -> PrimitiveAttributes {
        let (min, max) = mesh.bounds();
        let position = self.vectors(mesh.positions.iter().map(Vec3::to_array), "VEC3");
        self.document.accessors[position].min = Some(min.to_array().to_vec());
        self.document.accessors[position].max = Some(max.to_array().to_vec());
        let mut attributes = PrimitiveAttributes { position, ..PrimitiveAttributes::default() };
        if mesh.normals == mesh.positions {
            attributes.normal = Some(position);
        } else if !mesh.normals.is_empty() {
            attributes.normal = Some(self.vectors(mesh.normals.iter().map(Vec3::to_array), "VEC3"));
        }
        if !mesh.coordinates.is_empty() {
            attributes.texcoord_0 = Some(self.vectors(mesh.coordinates.iter().map(Vec2::to_array), "VEC2"));
        }
        if !mesh.colours.is_empty() {
            attributes.color_0 = Some(self.vectors(mesh.colours.iter().copied(), "VEC3"));
        }
        attributes
    }

    /// Adds an accessor for a vertex attribute.
    pub(crate) fn vectors<const N: usize>(
        &mut self,
        values: impl ExactSizeIterator<Item = [f32; N]>,
        kind: &'static str,
    ) -> usize {
        let count = values.len();
        let bytes = values.flatten().flat_map(f32::to_le_bytes).collect();
        self.accessor(bytes, Some(ARRAY_BUFFER), FLOAT, count, kind)
    }

    /// Adds an accessor of `count` elements that are not a vertex attribute.
    pub(crate) fn numbers(&mut self, values: &[f32], count: usize, kind: &'static str) -> usize {
        let bytes = values.iter().copied().flat_map(f32::to_le_bytes).collect();
        self.accessor(bytes, None, FLOAT, count, kind)
    }

    /// Adds an accessor for joints, four per vertex.
    pub(crate) fn joints(&mut self, joints: &[[u8; 4]]) -> usize {
        self.accessor(joints.as_flattened().to_vec(), Some(ARRAY_BUFFER), UNSIGNED_BYTE, joints.len(), "VEC4")
    }

    fn accessor(
        &mut self,
        bytes: Vec<u8>,
        target: Option<u32>,
        component_type: u32,
        count: usize,
        kind: &'static str,
    ) -> usize {
        let buffer_view = self.view(bytes, target);
        let accessor = Accessor { buffer_view, component_type, count, kind, min: None, max: None };
        self.document.accessors.push(accessor);
        self.document.accessors.len() - 1
    }

    fn view(&mut self, bytes: Vec<u8>, target: Option<u32>) -> usize {
        let (byte_offset, byte_length) = (self.binary.len(), bytes.len());
        self.binary.extend(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.document.buffer_views.push(BufferView { buffer: 0, byte_offset, byte_length, target });
        self.document.buffer_views.len() - 1
    }

    /// Adds a mesh; returns its index. Each of `parts` is a geometry and the index of its material.
    pub fn mesh(&mut self, name: &str, parts: &[(Geometry, usize)]) -> usize {
        let primitives = parts.iter().map(|&(geometry, material)| Primitive {
            attributes: geometry.attributes,
            indices: geometry.indices,
            material,
            mode: geometry.mode,
            targets: None,
        });
        self.document.meshes.push(MeshEntry { name: name.into(), primitives: primitives.collect() });
        self.document.meshes.len() - 1
    }

    /// Adds a node that will be the child of another; returns its index.
    pub fn node(&mut self, node: Node) -> usize {
        self.document.nodes.push(node);
        self.document.nodes.len() - 1
    }

    /// Adds a root node; returns its index.
    pub fn root(&mut self, node: Node) -> usize {
        let index = self.node(node);
        self.roots.push(index);
        index
    }

    /// Adds a mesh with a material, and a root node for the mesh. Both have the name `name`.
    pub fn object(&mut self, name: &str, mesh: &Mesh, material: usize) {
        let geometry = self.geometry(mesh);
        self.placed(name, geometry, material);
    }

    /// Does the same as [`Self::object`] for a geometry that is already in the file.
    pub fn placed(&mut self, name: &str, geometry: Geometry, material: usize) {
        let mesh = Some(self.mesh(name, &[(geometry, material)]));
        self.root(Node { name: name.into(), mesh, ..Node::default() });
    }

    /// Adds a camera and a root node for the camera. Both have the name `name`.
    pub fn camera(&mut self, name: &str, camera: &Camera) {
        let index = self.lens(name, camera);
        let matrix = Some(camera.matrix());
        self.root(Node { name: name.into(), camera: Some(index), matrix, ..Node::default() });
    }

    /// Adds a camera without a node; returns its index.
    pub(crate) fn lens(&mut self, name: &str, camera: &Camera) -> usize {
        let (aspect_ratio, yfov) = (camera.aspect_ratio, camera.yfov);
        let perspective = Perspective { aspect_ratio, yfov, znear: 0.001, zfar: 1000.0 };
        self.document.cameras.push(CameraEntry { name: name.into(), kind: "perspective", perspective });
        self.document.cameras.len() - 1
    }

    fn finish(mut self, uri: Option<String>) -> (Document, Vec<u8>) {
        let document = &mut self.document;
        document.scenes = vec![Roots { nodes: self.roots }];
        document.buffers = vec![Buffer { byte_length: self.binary.len(), uri }];
        let mut used: Vec<_> =
            document.materials.iter().flat_map(|material| material.extensions.names()).collect();
        used.extend(document.materials.iter().filter_map(MaterialEntry::transform_extension));
        used.extend(document.extensions.as_ref().map(|_| "KHR_lights_punctual"));
        used.sort_unstable();
        used.dedup();
        document.extensions_used = used;
        (self.document, self.binary)
    }

    /// Encodes the scene as one `.gltf` file with an embedded buffer.
    pub fn into_gltf(self) -> Vec<u8> {
        let encoded = base64::engine::general_purpose::STANDARD.encode(&self.binary);
        let (document, _) = self.finish(Some(format!("data:application/octet-stream;base64,{encoded}")));
        let mut json = serde_json::to_vec_pretty(&document).expect("the document has only string keys");
        json.push(b'\n');
        json
    }

    /// Encodes the scene as one `.glb` file.
    pub fn into_glb(self) -> Vec<u8> {
        let (document, binary) = self.finish(None);
        let mut json = serde_json::to_vec(&document).expect("the document has only string keys");
        json.resize(json.len().next_multiple_of(4), b' ');
        let length = |bytes: usize| u32::try_from(bytes).expect("a scene is far below 4 GiB").to_le_bytes();
        let mut file = Vec::from(*b"glTF");
        file.extend(2u32.to_le_bytes());
        file.extend(length(12 + 8 + json.len() + 8 + binary.len()));
        for (kind, chunk) in [(b"JSON", json), (b"BIN\0", binary)] {
            file.extend(length(chunk.len()));
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }
}
