//! Puts meshes, materials, nodes and cameras together into a glTF file.

use base64::Engine;
use glam::Vec3;

use crate::document::{
    Accessor, Attributes, Buffer, BufferView, CameraEntry, Document, EmissiveStrength, Extensions, Extras,
    MaterialEntry, MeshEntry, MetallicRoughness, Node, Perspective, Phong, PhotoncardExtras, Primitive,
    Roots, Specular,
};
use crate::mesh::Mesh;

/// glTF's numbers for the type of a component and the use of a buffer view.
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// What a surface reflects and emits.
#[derive(Clone, Debug, Default)]
pub struct Material {
    name: String,
    albedo: [f64; 3],
    radiance: [f64; 3],
    double_sided: bool,
    phong: Option<Phong>,
}

impl Material {
    /// A purely Lambertian material; `albedo` is the reflected share, red, green and blue.
    pub fn diffuse(name: &str, albedo: [f64; 3]) -> Self {
        Self { name: name.into(), albedo, ..Self::default() }
    }

    /// The same, emitting `radiance` in W/(sr m^2).
    #[must_use]
    pub fn emitting(mut self, radiance: [f64; 3]) -> Self {
        self.radiance = radiance;
        self
    }

    /// The same on both sides.
    #[must_use]
    pub fn double_sided(mut self) -> Self {
        self.double_sided = true;
        self
    }

    /// The same with a Phong lobe on top.
    #[must_use]
    pub fn with_phong(mut self, phong: Phong) -> Self {
        self.phong = Some(phong);
        self
    }

    /// glTF keeps `emissiveFactor` within one; the rest of the radiance is the strength.
    fn emission(&self) -> (Option<[f64; 3]>, Option<EmissiveStrength>) {
        let peak = self.radiance.into_iter().fold(0.0, f64::max);
        if peak == 0.0 {
            (None, None)
        } else if peak <= 1.0 {
            (Some(self.radiance), None)
        } else {
            let factor = self.radiance.map(|channel| channel / peak);
            (Some(factor), Some(EmissiveStrength { emissive_strength: peak }))
        }
    }

    fn entry(&self) -> MaterialEntry {
        let [r, g, b] = self.albedo;
        let (emissive_factor, emissive_strength) = self.emission();
        MaterialEntry {
            name: self.name.clone(),
            pbr_metallic_roughness: MetallicRoughness {
                base_color_factor: [r, g, b, 1.0],
                metallic_factor: 0.0,
                roughness_factor: 1.0,
            },
            emissive_factor,
            double_sided: self.double_sided,
            extensions: Extensions { emissive_strength, specular: Specular { specular_factor: 0.0 } },
            extras: self.phong.map(|phong| Extras { photoncard: PhotoncardExtras { phong } }),
        }
    }
}

/// Vertices and indices already in the file, to be used by any number of meshes.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
    positions: usize,
    indices: usize,
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Where the eye is, in metres.
    pub eye: Vec3,
    /// What is in the middle of the picture.
    pub target: Vec3,
    /// The vertical field of view, in radians.
    pub yfov: f64,
    /// Width over height.
    pub aspect_ratio: f64,
}

impl Camera {
    /// The node's matrix: a glTF camera looks along its own -z with +y up.
    fn matrix(&self) -> [f32; 16] {
        let back = self.eye - self.target;
        // Divided rather than normalised: an axis stays exactly an axis.
        let back = back / back.length();
        let right = Vec3::Y.cross(back);
        let right = right / right.length();
        let up = back.cross(right);
        let mut matrix = [0.0; 16];
        for (column, vector) in [right, up, back, self.eye].into_iter().enumerate() {
            // Adding zero turns -0 into 0.
            matrix[4 * column..4 * column + 3].copy_from_slice(&(vector + Vec3::ZERO).to_array());
        }
        matrix[15] = 1.0;
        matrix
    }
}

/// A glTF file in the making.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    document: Document,
    roots: Vec<usize>,
    binary: Vec<u8>,
}

impl SceneBuilder {
    /// Adds a material and returns its index.
    pub fn material(&mut self, material: &Material) -> usize {
        self.document.materials.push(material.entry());
        self.document.materials.len() - 1
    }

    /// Adds the vertices and indices of a mesh; the indices are as narrow as the vertices allow.
    pub fn geometry(&mut self, mesh: &Mesh) -> Geometry {
        let (min, max) = mesh.bounds();
        let bytes = mesh.positions.iter().flat_map(Vec3::to_array).flat_map(f32::to_le_bytes).collect();
        let positions = self.accessor(bytes, ARRAY_BUFFER, FLOAT, mesh.positions.len(), "VEC3");
        self.document.accessors[positions].min = Some(min.to_array());
        self.document.accessors[positions].max = Some(max.to_array());
        let indices = mesh.triangles.iter().flatten();
        // 0xffff restarts a primitive, so it cannot name a vertex.
        let (bytes, component): (Vec<u8>, u32) = if mesh.positions.len() <= 0xffff {
            (indices.flat_map(|&index| (index as u16).to_le_bytes()).collect(), UNSIGNED_SHORT)
        } else {
            (indices.flat_map(|&index| index.to_le_bytes()).collect(), UNSIGNED_INT)
        };
        let count = 3 * mesh.triangles.len();
        let indices = self.accessor(bytes, ELEMENT_ARRAY_BUFFER, component, count, "SCALAR");
        Geometry { positions, indices }
    }

    fn accessor(
        &mut self,
        bytes: Vec<u8>,
        target: u32,
        component_type: u32,
        count: usize,
        kind: &'static str,
    ) -> usize {
        let (byte_offset, byte_length) = (self.binary.len(), bytes.len());
        self.binary.extend(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let buffer_view = self.document.buffer_views.len();
        self.document.buffer_views.push(BufferView { buffer: 0, byte_offset, byte_length, target });
        let accessor = Accessor { buffer_view, component_type, count, kind, min: None, max: None };
        self.document.accessors.push(accessor);
        self.document.accessors.len() - 1
    }

    /// Adds a mesh made of parts, each a geometry and the index of its material; returns its index.
    pub fn mesh(&mut self, name: &str, parts: &[(Geometry, usize)]) -> usize {
        let primitives = parts.iter().map(|&(geometry, material)| Primitive {
            attributes: Attributes { position: geometry.positions },
            indices: geometry.indices,
            material,
        });
        self.document.meshes.push(MeshEntry { name: name.into(), primitives: primitives.collect() });
        self.document.meshes.len() - 1
    }

    /// Adds a node that something else will have as its child; returns its index.
    pub fn node(&mut self, node: Node) -> usize {
        self.document.nodes.push(node);
        self.document.nodes.len() - 1
    }

    /// Adds a node at the top of the hierarchy.
    pub fn root(&mut self, node: Node) {
        let index = self.node(node);
        self.roots.push(index);
    }

    /// Adds a node at the top that shows `mesh` in `material`, both under the name of the node.
    pub fn object(&mut self, name: &str, mesh: &Mesh, material: usize) {
        let geometry = self.geometry(mesh);
        let mesh = Some(self.mesh(name, &[(geometry, material)]));
        self.root(Node { name: name.into(), mesh, ..Node::default() });
    }

    /// Adds a camera and its node, both under the same name.
    pub fn camera(&mut self, name: &str, camera: &Camera) {
        let (aspect_ratio, yfov) = (camera.aspect_ratio, camera.yfov);
        let perspective = Perspective { aspect_ratio, yfov, znear: 0.001, zfar: 1000.0 };
        self.document.cameras.push(CameraEntry { name: name.into(), kind: "perspective", perspective });
        let index = self.document.cameras.len() - 1;
        let matrix = Some(camera.matrix());
        self.root(Node { name: name.into(), camera: Some(index), matrix, ..Node::default() });
    }

    fn finish(mut self, uri: Option<String>) -> (Document, Vec<u8>) {
        let document = &mut self.document;
        document.scenes = vec![Roots { nodes: self.roots }];
        document.buffers = vec![Buffer { byte_length: self.binary.len(), uri }];
        if document.materials.iter().any(|material| material.extensions.emissive_strength.is_some()) {
            document.extensions_used.push("KHR_materials_emissive_strength");
        }
        document.extensions_used.push("KHR_materials_specular");
        (self.document, self.binary)
    }

    /// The scene as one `.gltf` file that holds its buffer itself.
    pub fn into_gltf(self) -> Vec<u8> {
        let encoded = base64::engine::general_purpose::STANDARD.encode(&self.binary);
        let (document, _) = self.finish(Some(format!("data:application/octet-stream;base64,{encoded}")));
        let mut json = serde_json::to_vec_pretty(&document).expect("the document has only string keys");
        json.push(b'\n');
        json
    }

    /// The scene as one `.glb` file.
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
