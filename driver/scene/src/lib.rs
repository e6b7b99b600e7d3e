//! Loaded scenes: triangles, instances, materials, textures, lights and cameras in world space.
//!
//! Coordinates are relative to the scene's own origin, which lies at [`SceneContents::offset`] in the file's
//! coordinates. This origin is near the contents, because single precision is coarse far from an origin.
#![forbid(unsafe_code)]

mod blender;
mod camera;
mod contents;
mod coplanar;
mod environment;
pub mod error;
pub mod gltf;
mod instance;
mod layers;
mod light;
mod light_groups;
mod light_units;
mod limits;
mod map_size;
mod material;
mod meshopt;
mod nearest;
mod out_of_range;
mod parts;
mod photometry;
mod placed;
mod radiance;
mod raster;
mod reduction;
mod settings;
mod sky;
mod srgb;
mod texture;
mod triangle;

use std::ops::{Deref, DerefMut};
use std::sync::OnceLock;

use glam::{DVec3, Vec3};
use photoncard_shared::checksum::Checksum;

pub use self::camera::{Aperture, Camera, Lens, Projection};
pub use self::contents::{Concern, SceneContents};
pub use self::environment::Environment;
pub use self::instance::Instance;
pub use self::layers::{Coat, DiffuseTransmission, Layers, NormalMap, Sheen};
pub use self::light::{LightAxes, PunctualKind, PunctualLight};
pub use self::light_groups::{LightGroups, LightSource};
pub use self::light_units::LightUnits;
pub use self::limits::BRIGHTEST;
pub use self::map_size::MAX_ENVIRONMENT_TEXELS;
pub use self::material::{Material, Reflection, Transmission, Visibility};
pub use self::parts::{Part, parts};
pub use self::photometry::LightProfile;
pub use self::settings::profile_of;
pub use self::sky::{Daylight, NoSky, Sky};
pub use self::texture::shared_exponent;
pub use self::texture::{Encoding, Image, MAX_SIDE, Texture, Wrap};
pub use self::triangle::{CornerTangents, NO_ATTRIBUTES, NO_TANGENTS, Triangle, VertexAttributes};
use crate::error::SceneError;

/// Name of the camera that is added to a scene without perspective cameras.
const FRAMED: &str = "framed";

/// Help of the error that the scene has no light.
const NO_LIGHT: &str = "give a material of at least one triangle an emissiveFactor above 0 (and KHR_materials_emissive_strength \
                        for its radiance), place a light of KHR_lights_punctual, or add an environment: --environment 1,1,1 \
                        is a white sky";

/// Scene in world space. [`gltf::load`] reads one from a file.
///
/// It dereferences to its [contents](SceneContents). Checksums are computed once; mutable access to the
/// contents discards them.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    contents: SceneContents,
    known: Known,
}

/// Properties of a scene that take a pass over all triangles and texels, computed when first used.
#[derive(Clone, Debug, Default)]
struct Known {
    /// Result of [`SceneContents::bulk_checksum`].
    bulk: OnceLock<Checksum>,
    checksum: OnceLock<String>,
    without_cameras: OnceLock<String>,
    objects: OnceLock<String>,
    is_specular: OnceLock<bool>,
}

impl Deref for Scene {
    type Target = SceneContents;

    fn deref(&self) -> &SceneContents {
        &self.contents
    }
}

impl DerefMut for Scene {
    fn deref_mut(&mut self) -> &mut SceneContents {
        self.known = Known::default();
        &mut self.contents
    }
}

impl From<SceneContents> for Scene {
    fn from(contents: SceneContents) -> Self {
        Self { contents, known: Known::default() }
    }
}

impl Scene {
    /// Applies a change to the contents.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut SceneContents)) -> Self {
        change(&mut self);
        self
    }

    /// Creates a scene that has cameras, an offset and names of light groups, but no triangles. Its methods
    /// return the given values: `checksum`, `checksum_without_cameras` and `checksum_of_objects` those in
    /// `checksums`, [`Self::is_specular`] the first of the last argument, whose other is
    /// [`SceneContents::is_in_watts`].
    pub fn of_cameras(
        cameras: Vec<Camera>,
        offset: DVec3,
        light_groups: Vec<String>,
        checksums: [String; 3],
        [is_specular, is_in_watts]: [bool; 2],
    ) -> Self {
        let [checksum, without_cameras, objects] = checksums.map(OnceLock::from);
        let light_groups = LightGroups::of_names(light_groups);
        let contents =
            SceneContents { cameras, offset, is_in_watts, light_groups, ..SceneContents::default() };
        let is_specular = is_specular.into();
        let known = Known { checksum, without_cameras, objects, is_specular, ..Known::default() };
        Self { contents, known }
    }

    /// Luminous efficacy by which the scene's irradiances become illuminances, lm/W: 683 for light in watts,
    /// 1 for light in the photometric units of glTF.
    pub fn lumens_per_watt(&self) -> f32 {
        if self.is_in_watts { light_units::EFFICACY } else { 1.0 }
    }

    /// Replaces the cameras, and keeps the checksums that do not depend on them.
    pub fn set_cameras(&mut self, cameras: Vec<Camera>) {
        self.contents.cameras = cameras;
        self.known.checksum = OnceLock::new();
    }

    /// CRC-32C of all contents that a render reads, as eight hexadecimal digits.
    pub fn checksum(&self) -> &str {
        self.known.checksum.get_or_init(|| self.contents.checksum(self.bulk_checksum(), &self.cameras))
    }

    /// CRC-32C of all contents that a render reads except the cameras, as eight hexadecimal digits. It covers
    /// everything that determines the scene's binary image in a card's memory.
    pub fn checksum_without_cameras(&self) -> &str {
        self.known.without_cameras.get_or_init(|| self.contents.checksum(self.bulk_checksum(), &[]))
    }

    /// CRC-32C of the objects' names, and of the object of each triangle and instance, as eight hexadecimal
    /// digits.
    pub fn checksum_of_objects(&self) -> &str {
        self.known.objects.get_or_init(|| self.contents.checksum_of_objects())
    }

    fn bulk_checksum(&self) -> Checksum {
        self.known.bulk.get_or_init(|| self.contents.bulk_checksum()).clone()
    }

    /// Returns the notices that matter to a picture: all except those about subjects that the picture does
    /// not use. `uses` returns whether the picture uses a subject.
    pub fn notices_on(&self, uses: impl Fn(Concern) -> bool) -> Vec<&str> {
        let is_idle =
            |index: usize| self.concerns.iter().any(|&(notice, concern)| notice == index && !uses(concern));
        let notices = self.notices.iter().enumerate();
        notices.filter(|(index, _)| !is_idle(*index)).map(|(_, notice)| &**notice).collect()
    }

    /// Converts a position from the scene's coordinates to the file's, metres. If the offset is 0, each
    /// coordinate of the result prints as the argument's does.
    pub fn in_file(&self, place: Vec3) -> DVec3 {
        // Takes the double-precision number that is nearest to the coordinate's shortest decimal form.
        let decimal = |value: f32| value.to_string().parse().unwrap_or(f64::from(value));
        DVec3::from_array(place.to_array().map(decimal)) + self.offset
    }

    /// Converts a position from the file's coordinates to the scene's, metres.
    pub fn in_scene(&self, place: DVec3) -> Vec3 {
        (place - self.offset).as_vec3()
    }

    /// Lower and upper corner of a box around the scene, metres; both zero for a scene without triangles. It
    /// is the smallest box around the triangles in world space and, for each instance, the transformed box of
    /// its group.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let all = triangle::bounds_of(&self.triangles)
            .into_iter()
            .chain(self.instance_bounds().map(|(_, corners)| corners));
        let around = all.reduce(|[low, high], [lower, upper]| [low.min(lower), high.max(upper)]);
        around.unwrap_or([Vec3::ZERO; 2]).into()
    }

    /// Returns the camera of this name, or the first one for `None`.
    ///
    /// # Errors
    /// If no camera has the name; the error lists the cameras' names.
    pub fn camera(&self, name: Option<&str>) -> Result<&Camera, SceneError> {
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
        let number =
            |triangles: &[Triangle]| triangles.iter().filter(|triangle| self.emits(triangle)).count();
        let groups: Vec<usize> = self.groups.iter().map(|group| number(group)).collect();
        let of_instances = self.instances.iter().map(|instance| groups[instance.group as usize]);
        number(&self.triangles) + of_instances.sum::<usize>()
    }

    fn emits(&self, triangle: &Triangle) -> bool {
        self.materials.get(triangle.material as usize).is_some_and(Material::is_emissive)
    }

    /// Returns whether the scene has an emissive triangle, a punctual light or a lit environment.
    pub(crate) fn has_light(&self) -> bool {
        self.lights.iter().any(|light| light.intensity.max_element() > 0.0)
            || self.environment.as_ref().is_some_and(Environment::is_lit)
            || self.stored_triangles().any(|triangle| self.emits(triangle))
    }

    /// Returns whether Blender's exporter wrote the file.
    pub fn is_of_blender(&self) -> bool {
        blender::is_exporter(self.generator.as_deref())
    }

    /// Rotation of an environment map about +y, degrees, counter-clockwise seen from above. It aligns the map
    /// with the conventions of the program that wrote the scene file: the middle of a map is +x in Blender,
    /// and -z in glTF viewers.
    pub fn environment_turn(&self) -> f32 {
        if self.is_of_blender() { -90.0 } else { 0.0 }
    }

    /// Returns whether any triangle's material focuses light ([`Self::specular_materials`]).
    pub fn is_specular(&self) -> bool {
        *self.known.is_specular.get_or_init(|| {
            let is_specular = self.specular_materials();
            self.stored_triangles().any(|triangle| is_specular.get(triangle.material as usize) == Some(&true))
        })
    }

    /// Returns for each material whether it focuses light. It does if it is a mirror or transmits light, has
    /// a coat or a sheen, or has a narrow lobe ([`Self::has_narrow_lobe`]).
    pub fn specular_materials(&self) -> Vec<bool> {
        self.materials.iter().map(|material| material.is_specular(self.minimum_roughness(material))).collect()
    }

    /// Returns whether the material's GGX lobe is narrow at one texel at least. Reflection by a narrow lobe
    /// is sampled with rays, not estimated from photons.
    pub fn has_narrow_lobe(&self, material: &Material) -> bool {
        material.has_narrow_lobe(self.minimum_roughness(material))
    }

    /// Returns for each material whether light can pass its surfaces without scattering: it has cut-outs
    /// (`alphaMode` `MASK`), or an alpha below 1 with `BLEND`.
    pub fn uncovered_materials(&self) -> Vec<bool> {
        let mut uncovered: Vec<bool> =
            self.materials.iter().map(|material| self.is_uncovered(material)).collect();
        for triangle in self.stored_triangles() {
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

    /// Checks that the scene has a light. Call it after all settings are applied and the environment is
    /// added.
    ///
    /// # Errors
    /// [`SceneError::NoLight`].
    pub fn check_light(&self) -> Result<(), SceneError> {
        let remedy = if self.is_of_blender() { blender::NO_LIGHT } else { NO_LIGHT };
        if self.has_light() { Ok(()) } else { Err(SceneError::NoLight { remedy }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(x: f32) -> Camera {
        let [right, up, forward] = [Vec3::X, Vec3::Y, Vec3::NEG_Z];
        let origin = Vec3::X * x;
        Camera::perspective("eye", origin, [right, up, forward], 1.0, None)
    }

    fn scene() -> Scene {
        Scene::default().with(|scene| {
            scene.triangles = vec![Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], 0)];
            scene.cameras = vec![camera(0.0)];
        })
    }

    fn checksums(scene: &Scene) -> [String; 2] {
        [scene.checksum(), scene.checksum_without_cameras()].map(str::to_owned)
    }

    #[test]
    fn a_changed_scene_has_the_checksums_of_a_new_one() {
        let mut scene = scene();
        let before = checksums(&scene);
        scene.triangles[0].vertices[0].z = 1.0;
        let after = checksums(&scene);
        assert!(before.iter().zip(&after).all(|(before, after)| before != after), "{before:?}, {after:?}");
        let new = self::scene().with(|scene| scene.triangles[0].vertices[0].z = 1.0);
        assert_eq!(after, checksums(&new));
    }

    #[test]
    fn cameras_that_are_set_are_those_of_the_scene_and_change_no_other_checksum() {
        let mut scene = scene();
        let [before, without_cameras] = checksums(&scene);
        scene.set_cameras(vec![camera(1.0)]);
        let moved = self::scene().with(|scene| scene.cameras = vec![camera(1.0)]);
        assert_eq!((checksums(&scene), &scene.cameras), (checksums(&moved), &moved.cameras));
        assert_ne!(scene.checksum(), before);
        assert_eq!(scene.checksum_without_cameras(), without_cameras);
    }
}
