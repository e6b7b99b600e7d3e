//! Loaded scenes: triangles, materials, textures, lights and cameras in world space.
//!
//! Coordinates are right-handed, y up, in metres; radiance is in W/(sr m^2) per linear RGB channel.
//! Coordinates are relative to the scene's own origin, which lies at [`Scene::offset`] in the file, because
//! single precision is coarse far from an origin.
#![forbid(unsafe_code)]

mod blender;
mod camera;
mod checksum;
mod coplanar;
mod environment;
pub mod error;
mod fixed;
pub mod gltf;
mod layers;
mod light;
mod light_units;
mod limits;
mod map_size;
mod material;
mod meshopt;
mod out_of_range;
mod parts;
mod radiance;
mod raster;
mod settings;
mod texture;
mod triangle;

use glam::{DVec3, Vec3};

pub use self::camera::Camera;
pub use self::environment::Environment;
pub use self::fixed::FixedScene;
pub use self::layers::{Coat, DiffuseTransmission, Layers, NormalMap, Sheen};
pub use self::light::{PunctualKind, PunctualLight};
pub use self::light_units::LightUnits;
pub use self::limits::BRIGHTEST;
pub use self::map_size::MAX_ENVIRONMENT_TEXELS;
pub use self::material::{Material, Reflection, Transmission};
pub use self::parts::{Part, parts};
pub use self::texture::shared_exponent;
pub use self::texture::{Encoding, Image, MAX_SIDE, MAX_TEXELS, Texture, Wrap};
pub use self::triangle::{CornerTangents, NO_ATTRIBUTES, NO_TANGENTS, Triangle, VertexAttributes};
use crate::error::SceneError;

/// Name of the default camera.
const FRAMED: &str = "framed";

/// Remedy of a scene without light.
const NO_LIGHT: &str = "give a material of at least one triangle an emissiveFactor above 0 (and KHR_materials_emissive_strength \
                        for its radiance), place a light of KHR_lights_punctual, or add an environment: --environment 1,1,1 \
                        is a white sky";

/// Scene in world space, with all instances expanded. [`gltf::load`] reads one from a file.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Position of the scene's origin in the coordinates of its file, metres. It is 0 unless the scene lies
    /// far from the file's origin.
    pub offset: DVec3,
    /// Triangles of non-zero area, in file order, counter-clockwise seen from the front.
    pub triangles: Vec<Triangle>,
    /// Attributes of the triangles that have any: normals, texture coordinates and colours of the corners.
    pub attributes: Vec<VertexAttributes>,
    /// Tangents of the triangles whose material has a normal map.
    pub tangents: Vec<CornerTangents>,
    /// Materials; the index in [`Triangle::material`] refers to this list.
    pub materials: Vec<Material>,
    /// Textures, mappings of images to surfaces; the indices in [`Material`] refer to this list.
    pub textures: Vec<Texture>,
    /// Images. One that textures use in two encodings is listed twice.
    pub images: Vec<Image>,
    /// Point, spot and directional lights (`KHR_lights_punctual`).
    pub lights: Vec<PunctualLight>,
    /// Environment light from infinitely far; `None` in a scene from a glTF file.
    pub environment: Option<Environment>,
    /// Cameras in file order. Never empty: a file without cameras gets one that frames the scene.
    pub cameras: Vec<Camera>,
    /// Program that wrote the file (`asset.generator`), if it says so.
    pub generator: Option<String>,
    /// Names of the file's variants of materials.
    pub variants: Vec<String>,
    /// Orthographic cameras of the file, which are not rendered: the number of perspective cameras before
    /// each, and its name.
    pub orthographic: Vec<(usize, String)>,
    /// Sentences about missing contents of the file and about contents that the renderer ignores, each once.
    pub notices: Vec<String>,
    /// Notices that matter only to some pictures: index in [`Self::notices`], and the subject.
    pub concerns: Vec<(usize, Concern)>,
    /// Sentences about contents of the file that the renderer interprets in another way than they are stated,
    /// each once.
    pub remarks: Vec<String>,
    /// Number of triangles of zero area, which were left out.
    pub skipped_triangles: usize,
}

/// Subject of a notice that matters only to pictures that use it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Concern {
    /// Default view. A picture that states its view does not use it.
    View,
    /// Cameras that cannot be used, in a file that has others.
    OtherCameras,
    /// Animations. A picture of the scene at rest does not use them.
    Animations,
    /// Environment light of the file. A picture may replace it by that of another file.
    Environment,
}

impl Scene {
    /// Notices that matter to a picture; `uses` returns whether the picture uses a subject.
    pub fn notices_on(&self, uses: impl Fn(Concern) -> bool) -> Vec<&str> {
        let is_idle =
            |index: usize| self.concerns.iter().any(|&(notice, concern)| notice == index && !uses(concern));
        let notices = self.notices.iter().enumerate();
        notices.filter(|(index, _)| !is_idle(*index)).map(|(_, notice)| &**notice).collect()
    }

    /// Converts a position from the scene's coordinates to the file's, metres. Without an offset the result
    /// prints as the argument does.
    pub fn in_file(&self, place: Vec3) -> DVec3 {
        // Of all double-precision numbers that round to a coordinate the one with its shortest decimal form
        // is meant.
        let decimal = |value: f32| value.to_string().parse().unwrap_or(f64::from(value));
        DVec3::from_array(place.to_array().map(decimal)) + self.offset
    }

    /// Converts a position from the file's coordinates to the scene's, metres.
    pub fn in_scene(&self, place: DVec3) -> Vec3 {
        (place - self.offset).as_vec3()
    }

    /// Lower and upper corner of the scene's bounding box, metres; both zero for a scene without triangles.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let mut vertices = self.triangles.iter().flat_map(|triangle| triangle.vertices);
        let first = vertices.next().unwrap_or(Vec3::ZERO);
        vertices.fold((first, first), |(low, high), vertex| (low.min(vertex), high.max(vertex)))
    }

    /// Returns the camera of this name, or the first one for `None`.
    ///
    /// # Errors
    /// If no camera has the name, or the camera is orthographic; the error lists the cameras' names.
    pub fn camera(&self, name: Option<&str>) -> Result<&Camera, SceneError> {
        if let Some(name) = self.orthographic_camera(name) {
            return Err(SceneError::OrthographicCamera {
                name: name.to_owned(),
                remedy: self.orthographic_remedy(),
            });
        }
        let found = match name {
            None => self.cameras.first(),
            Some(name) => self.cameras.iter().find(|camera| camera.name == name),
        };
        found.ok_or_else(|| {
            let cameras: Vec<_> = self.cameras.iter().map(|camera| format!("'{}'", camera.name)).collect();
            SceneError::UnknownCamera {
                name: name.unwrap_or_default().to_owned(),
                remedy: self.camera_remedy(&cameras.join(", ")),
            }
        })
    }

    /// Name of the orthographic camera that was requested: the one of this name or, for `None`, the file's
    /// first camera if it is orthographic.
    fn orthographic_camera(&self, name: Option<&str>) -> Option<&str> {
        let is_meant = |(before, camera): &&(usize, String)| match name {
            None => *before == 0,
            Some(name) => camera == name,
        };
        self.orthographic.iter().find(is_meant).map(|(_, name)| &**name)
    }

    fn orthographic_remedy(&self) -> String {
        let others = self.cameras.iter().filter(|camera| camera.name != FRAMED);
        let others: Vec<_> = others.map(|camera| format!("'{}'", camera.name)).collect();
        let place = "place a perspective one by --camera-at X,Y,Z and --look-at X,Y,Z";
        if others.is_empty() {
            return format!("{place}, or export the camera as a perspective one");
        }
        format!("choose a perspective one by --camera: {}; or {place}", others.join(", "))
    }

    fn camera_remedy(&self, names: &str) -> String {
        let choice = format!("choose one of: {names}");
        let is_framed = self.cameras.iter().all(|camera| camera.name == FRAMED);
        if is_framed && self.is_of_blender() {
            format!("{choice}; or {}", blender::NO_CAMERA)
        } else {
            choice
        }
    }

    /// Number of triangles that emit light.
    pub fn emissive_triangles(&self) -> usize {
        self.triangles.iter().filter(|triangle| self.emits(triangle)).count()
    }

    fn emits(&self, triangle: &Triangle) -> bool {
        self.materials.get(triangle.material as usize).is_some_and(Material::is_emissive)
    }

    /// Returns whether the scene has an emissive triangle, a punctual light or a lit environment.
    pub fn has_light(&self) -> bool {
        self.lights.iter().any(|light| light.intensity.max_element() > 0.0)
            || self.environment.as_ref().is_some_and(Environment::is_lit)
            || self.triangles.iter().any(|triangle| self.emits(triangle))
    }

    /// Returns whether Blender's exporter wrote the file.
    pub fn is_of_blender(&self) -> bool {
        blender::is_exporter(self.generator.as_deref())
    }

    /// Rotation about +y, degrees, counter-clockwise seen from above, that aligns an environment map with the
    /// conventions of the program that wrote the file. The middle of a map is +x in Blender and -z in glTF
    /// viewers.
    pub fn environment_turn(&self) -> f32 {
        if self.is_of_blender() { -90.0 } else { 0.0 }
    }

    /// Returns whether any triangle has one of the [`Self::specular_materials`].
    pub fn is_specular(&self) -> bool {
        let is_specular = self.specular_materials();
        self.triangles.iter().any(|triangle| is_specular.get(triangle.material as usize) == Some(&true))
    }

    /// Flags of the materials that focus light. They reflect or transmit perfectly specularly, or have a lobe
    /// that rays follow.
    pub fn specular_materials(&self) -> Vec<bool> {
        self.materials.iter().map(|material| material.is_specular(self.minimum_roughness(material))).collect()
    }

    /// Returns whether a material has a narrow lobe that rays follow, at some texel at least.
    pub fn has_narrow_lobe(&self, material: &Material) -> bool {
        material.has_narrow_lobe(self.minimum_roughness(material))
    }

    /// Flags of the materials with partial coverage: they have cut-outs, or an alpha below 1 with `alphaMode`
    /// `BLEND`.
    pub fn uncovered_materials(&self) -> Vec<bool> {
        let mut uncovered: Vec<bool> =
            self.materials.iter().map(|material| self.is_uncovered(material)).collect();
        for triangle in &self.triangles {
            let attributes = self.attributes.get(triangle.attributes as usize);
            let has_alpha =
                attributes.is_some_and(|list| list.colours.iter().any(|&[.., alpha]| alpha < 1.0));
            let blends =
                self.materials.get(triangle.material as usize).is_some_and(|material| material.blends);
            if let Some(entry) = uncovered.get_mut(triangle.material as usize).filter(|_| blends && has_alpha)
            {
                *entry = true;
            }
        }
        uncovered
    }

    fn is_uncovered(&self, material: &Material) -> bool {
        let texture = material.base_texture.and_then(|index| self.textures.get(index as usize));
        let image = texture.and_then(|texture| self.images.get(texture.image as usize));
        let has_alpha = || image.is_some_and(|image| image.texels.iter().any(|&[.., alpha]| alpha < u8::MAX));
        material.alpha_cutoff.is_some() || material.blends && (material.alpha < 1.0 || has_alpha())
    }

    /// Minimum of a material's roughness texture, 0 to 1; 1 without a texture.
    fn minimum_roughness(&self, material: &Material) -> f32 {
        let texture = material.metallic_roughness_texture.and_then(|index| self.textures.get(index as usize));
        let image = texture.and_then(|texture| self.images.get(texture.image as usize));
        image.map_or(1.0, Image::minimum_green)
    }

    /// Enables the compensation of multiple scattering between microfacets for all metallic-roughness
    /// materials.
    pub fn compensate_energy(&mut self) {
        self.materials.iter_mut().for_each(|material| material.energy_compensation = true);
    }

    /// Checks that the scene has a light. Call it once settings are applied and an environment is added.
    ///
    /// # Errors
    /// [`SceneError::NoLight`].
    pub fn check_light(&self) -> Result<(), SceneError> {
        let remedy = if self.is_of_blender() { blender::NO_LIGHT } else { NO_LIGHT };
        if self.has_light() { Ok(()) } else { Err(SceneError::NoLight { remedy }) }
    }
}
