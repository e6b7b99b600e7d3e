//! Scenes from glTF 2.0 files, `.gltf` and `.glb`.
//!
//! The `gltf` crate supplies the types of the JSON and its validation. Its readers of binary data panic on
//! malformed files, so the bytes are read here: every offset, stride and count is checked before use, and
//! nothing is allocated for a count alone.

mod accessor;
mod animation;
mod buffers;
mod camera;
mod compression;
mod document;
mod draco;
mod extensions;
mod extent;
mod extras;
mod files;
mod image;
mod inside;
mod instances;
mod json_scan;
mod keyframes;
mod lamps;
mod layers;
mod light;
mod limits;
mod material;
mod mesh;
mod mikktspace;
mod morph;
mod names;
mod nodes;
mod not_finite;
mod notices;
mod offset;
mod origin;
mod other_kinds;
mod pose;
mod primitive;
mod profiles;
mod room;
mod scene_file;
mod schema;
mod settings;
mod skin;
mod solid_glass;
mod specular_glossiness;
mod stated_places;
mod tangents;
mod texture;
mod topology;
mod touching_glass;
mod transform;
mod uri;
mod variants;
mod vertex;

use std::path::Path;

pub use self::animation::{Animation, Moment};
pub use self::limits::MAX_TRIANGLES;
pub use self::scene_file::SceneFile;
pub use self::settings::LoadSettings;
use crate::Scene;
use crate::error::SceneError;

/// Loads the default scene of a glTF file, or its first if the file states no default, with the default
/// settings. The scene must fit the memory of the reference chip.
///
/// ```
/// # use std::path::Path;
/// # fn main() -> Result<(), photoncard_scene::error::SceneError> {
/// let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell.gltf");
/// let mut scene = photoncard_scene::gltf::load(&path)?;
/// assert_eq!((scene.triangles.len(), scene.cameras[0].name.as_str()), (36, "camera"));
/// assert!(scene.notices.is_empty(), "every feature of the file is rendered");
/// scene.apply("light.emission=30,25,20")?;
/// scene.check_light()?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As [`load_with`].
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    load_with(path, &LoadSettings::default())
}

/// Loads the default scene of a glTF file, or its first scene if the file states no default.
///
/// [`Scene::notices`](crate::SceneContents::notices) names the features of the file that are not rendered.
///
/// # Errors
/// If the file, or a file it refers to, cannot be read, violates a rule of glTF, exceeds the cards' memory,
/// or has no triangle with an area; or if it lacks the variant of `settings`. The error names the location in
/// the file and the remedy. [`Scene::check_light`] checks for light.
pub fn load_with(path: &Path, settings: &LoadSettings) -> Result<Scene, SceneError> {
    SceneFile::open(path, settings)?.into_rest()
}
