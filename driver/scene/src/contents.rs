//! Contents of a scene, and their checksum.

use std::fmt::Write;

use glam::DVec3;
use photoncard_shared::checksum::Checksum;

use crate::camera::Camera;
use crate::environment::Environment;
use crate::instance::Instance;
use crate::light::PunctualLight;
use crate::light_groups::{LightGroups, LightSource};
use crate::material::Material;
use crate::texture::{Image, Texture};
use crate::triangle::{CornerTangents, Triangle, VertexAttributes};

/// Contents of a [`Scene`](crate::Scene): triangles, instances, materials, textures, lights and cameras in
/// world space.
#[derive(Clone, Debug, Default)]
pub struct SceneContents {
    /// Position of the scene's origin in the coordinates of its file, metres. It is 0 unless the scene lies
    /// far from the file's origin.
    pub offset: DVec3,
    /// Triangles of non-zero area, in file order, counter-clockwise seen from the front.
    pub triangles: Vec<Triangle>,
    /// Groups of triangles, each in a space of its own, that [`Self::instances`] place in the scene.
    pub groups: Vec<Vec<Triangle>>,
    /// Instances of the groups, in file order.
    pub instances: Vec<Instance>,
    /// Attributes of the triangles that have any: normals, texture coordinates and colours of the corners.
    pub attributes: Vec<VertexAttributes>,
    /// Tangents of the triangles whose material has a normal map.
    pub tangents: Vec<CornerTangents>,
    /// Materials; the index in [`Triangle::material`] refers to this list.
    pub materials: Vec<Material>,
    /// Names of the objects: of the file's nodes that show triangles. A picture without layers of objects
    /// does not depend on them.
    pub objects: Vec<String>,
    /// Textures, mappings of images to surfaces; the indices in [`Material`] refer to this list.
    pub textures: Vec<Texture>,
    /// Images of the textures. An image that textures use in two encodings is listed twice.
    pub images: Vec<Image>,
    /// Point, spot and directional lights (`KHR_lights_punctual`).
    pub lights: Vec<PunctualLight>,
    /// True if all light is in watts: the file's lights were converted from lumens. Otherwise numbers are as
    /// in the file, for which glTF states candela, lux and cd/m^2.
    pub is_in_watts: bool,
    /// Light groups of the materials, lights and environment; none unless they are requested.
    pub light_groups: LightGroups,
    /// Light groups that the file states, by source.
    pub stated_light_groups: Vec<(LightSource, String)>,
    /// Environment light from infinitely far; `None` in a scene from a glTF file.
    pub environment: Option<Environment>,
    /// Cameras in file order. Never empty: a file without cameras gets one that frames the scene.
    pub cameras: Vec<Camera>,
    /// Program that wrote the file (`asset.generator`); `None` if the file does not name it.
    pub generator: Option<String>,
    /// Names of the file's material variants (`KHR_materials_variants`).
    pub variants: Vec<String>,
    /// Sentences about missing contents of the file and about contents that the renderer ignores, each once.
    pub notices: Vec<String>,
    /// Notices that matter only to some pictures: index in [`Self::notices`], and the subject.
    pub concerns: Vec<(usize, Concern)>,
    /// Sentences about contents of the file that the renderer does not interpret as the file states them,
    /// each once.
    pub remarks: Vec<String>,
    /// Number of triangles of zero area, which were left out.
    pub skipped_triangles: usize,
}

/// Subject of a notice that matters only to pictures that use the subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Concern {
    /// Default view, which a picture uses if no view is given for it.
    View,
    /// Animations, which a picture of the scene without animation does not use.
    Animations,
    /// Environment light of the file. A picture may use the environment of another file instead.
    Environment,
}

impl SceneContents {
    /// Stored triangles of the scene: those in world space, then those of each group once.
    pub fn stored_triangles(&self) -> impl Iterator<Item = &Triangle> {
        self.triangles.iter().chain(self.groups.iter().flatten())
    }

    /// Checksum of the triangles and instances with their attributes and tangents, and of all texels.
    pub(crate) fn bulk_checksum(&self) -> Checksum {
        let mut sum = Checksum::default();
        for triangle in self.stored_triangles() {
            triangle.vertices.iter().for_each(|vertex| add(&mut sum, &vertex.to_array()));
            sum.update(&triangle.material.to_le_bytes());
            sum.update(&triangle.attributes.to_le_bytes());
        }
        self.groups.iter().for_each(|group| sum.update(&(group.len() as u64).to_le_bytes()));
        for instance in &self.instances {
            sum.update(&instance.group.to_le_bytes());
            add(&mut sum, instance.to_world.as_flattened());
        }
        for attributes in &self.attributes {
            sum.update(&[u8::from(attributes.normals.is_some())]);
            attributes.normals.iter().flatten().for_each(|normal| add(&mut sum, &normal.to_array()));
            attributes.coordinates.iter().flatten().for_each(|place| add(&mut sum, &place.to_array()));
            add(&mut sum, attributes.colours.as_flattened());
            sum.update(&attributes.tangents.to_le_bytes());
        }
        self.tangents.iter().flatten().for_each(|tangent| add(&mut sum, &tangent.to_array()));
        for image in &self.images {
            sum.update(image.texels.as_flattened());
        }
        if let Some(environment) = &self.environment {
            add(&mut sum, environment.texels.as_flattened());
        }
        sum
    }

    /// CRC-32C of all contents that a render reads, as eight hexadecimal digits. `sum` is
    /// [`Self::bulk_checksum`]; `cameras` replace those of the scene.
    pub(crate) fn checksum(&self, mut sum: Checksum, cameras: &[Camera]) -> String {
        sum.update(self.description(cameras).as_bytes());
        format!("{:08x}", sum.value())
    }

    pub(crate) fn checksum_of_objects(&self) -> String {
        let mut sum = Checksum::default();
        sum.update(format!("{:?}", self.objects).as_bytes());
        let triangles = self.triangles.iter().map(|triangle| triangle.object);
        let instances = self.instances.iter().map(|instance| instance.object);
        triangles.chain(instances).for_each(|object| sum.update(&object.to_le_bytes()));
        format!("{:08x}", sum.value())
    }

    /// Text of all contents that a render reads, except those in [`Self::bulk_checksum`]. Its floating-point
    /// numbers parse back exactly.
    fn description(&self, cameras: &[Camera]) -> String {
        let mut text = String::new();
        let _ = write!(text, "{:?}{:?}{:?}{:?}", self.materials, cameras, self.textures, self.lights);
        for image in &self.images {
            let _ = write!(text, "{} {} {:?}", image.width, image.height, image.encoding);
        }
        let _ = write!(text, "{:?}", self.environment.as_ref().map(|map| (map.width, map.height)));
        if self.offset != DVec3::ZERO {
            let _ = write!(text, "{:?}", self.offset);
        }
        if let Some(map) = self.environment.as_ref().filter(|map| map.strength != 1.0) {
            let _ = write!(text, "{:?}", map.strength);
        }
        if !self.light_groups.names().is_empty() {
            let _ = write!(text, "{:?}", self.light_groups);
        }
        text
    }
}

fn add(sum: &mut Checksum, values: &[f32]) {
    values.iter().for_each(|value| sum.update(&value.to_le_bytes()));
}
