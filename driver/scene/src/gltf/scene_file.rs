//! Open glTF file whose scene can be evaluated at several times of its animations.

use std::path::Path;
use std::sync::OnceLock;

use glam::DVec3;
use gltf::json;

use super::accessor::Source;
use super::animation::{self, Animation, Moment, Poses};
use super::buffers::Buffers;
use super::document::Document;
use super::extent::Anchor;
use super::inside::Framed;
use super::notices::{self, Notices, Sentences};
use super::room::Room;
use super::settings::LoadSettings;
use super::texture::Textures;
use super::{camera, material, nodes, profiles, solid_glass, touching_glass, variants};
use crate::error::SceneError;
use crate::{Camera, LightUnits, MAX_SIDE, Scene, SceneContents};

/// Open glTF file. Materials and images are read once, geometry for each moment.
///
/// ```
/// # use std::path::Path;
/// use photoncard_scene::gltf::{LoadSettings, Moment, SceneFile};
/// # fn main() -> Result<(), photoncard_scene::error::SceneError> {
/// let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell-moving.glb");
/// let file = SceneFile::open(&path, &LoadSettings::default())?;
/// let pan = Moment { animations: vec!["pan".into()], seconds: 0.5 };
/// assert!(file.only_cameras_move(&pan.animations)?);
/// let mut scene = file.at_rest()?;
/// scene.set_cameras(file.cameras_at(&pan)?);
/// assert_eq!(scene.cameras[0].origin.to_array(), [0.3, 0.1, 3.9]);
/// let play = file.at(&Moment { animations: vec!["play".into()], seconds: 0.5 })?;
/// assert_ne!(play.triangles, scene.triangles);
/// # Ok(())
/// # }
/// ```
pub struct SceneFile {
    document: Document,
    light_units: LightUnits,
    /// Scene without the meshes, lights and cameras of its nodes.
    bare: Scene,
    room: Room,
    /// Images that cannot be read, each with its reason.
    unreadable: Vec<String>,
    /// Default camera of a file without cameras, computed on first use. It frames the scene without
    /// animations.
    framed: OnceLock<(Camera, Framed)>,
    /// Offset of the scene's origin, computed on first use from the scene without animations.
    anchor: OnceLock<Anchor>,
}

impl SceneFile {
    /// Opens a file.
    ///
    /// # Errors
    /// If the file, or a file it refers to, cannot be read, violates a rule of glTF, or its materials and
    /// images exceed the cards' memory; or if it lacks the variant of `settings`. The error names the
    /// location in the file and the remedy.
    pub fn open(path: &Path, settings: &LoadSettings) -> Result<Self, SceneError> {
        let LoadSettings { dram_bytes, texture_limit, variant, light_units, lightmap_coordinates } = settings;
        let mut document = Document::read(path)?;
        document.has_lightmaps = *lightmap_coordinates;
        variant.as_deref().map_or(Ok(()), |name| variants::select(&mut document, name))?;
        let mut room = Room::new(path, *dram_bytes, texture_limit.unwrap_or(MAX_SIDE));
        room.materials(document.root.materials.len())?;
        let (bare, unreadable) = bare_scene(&document, &mut room)?;
        let (framed, anchor) = (OnceLock::new(), OnceLock::new());
        Ok(Self { document, light_units: *light_units, bare, room, unreadable, framed, anchor })
    }

    /// Evaluates the default scene of the file, or its first if it states no default, without animations.
    ///
    /// [`Scene::notices`](crate::SceneContents::notices) names the features of the file that are not
    /// rendered.
    ///
    /// # Errors
    /// If a node is invalid, the scene exceeds the cards' memory, or it has no triangle with an area.
    pub fn at_rest(&self) -> Result<Scene, SceneError> {
        self.placed(self.bare.clone(), None)
    }

    /// Does what [`Self::at_rest`] does, and consumes the file. If the file has animations, a remark says
    /// that they do not play.
    ///
    /// # Errors
    /// As [`Self::at_rest`].
    pub fn into_rest(mut self) -> Result<Scene, SceneError> {
        let bare = std::mem::take(&mut self.bare);
        let mut scene = self.placed(bare, None)?;
        scene.remarks.extend(notices::of_animations(&self.document.root));
        Ok(scene)
    }

    /// Evaluates the scene at a moment of its animations. A channel keeps its first value before the first
    /// keyframe, and its last value after the last one. The default camera of a file without cameras does not
    /// move.
    ///
    /// # Errors
    /// As [`Self::at_rest`], and if an animation is invalid or unknown, or two animations of the moment move
    /// the same property of a node.
    pub fn at(&self, moment: &Moment) -> Result<Scene, SceneError> {
        self.placed(self.bare.clone(), Some(moment))
    }

    /// Evaluates the cameras at a moment without the geometry. The result is empty if the file has no
    /// cameras.
    ///
    /// # Errors
    /// As [`Self::at`].
    pub fn cameras_at(&self, moment: &Moment) -> Result<Vec<Camera>, SceneError> {
        if self.anchor.get().is_none() {
            self.at_rest()?;
        }
        let buffers = Buffers::of(&self.document);
        let source = Source::new(&self.document, &buffers);
        nodes::cameras(&self.document, &animation::poses(&source, moment)?, self.anchor.get())
    }

    /// Returns whether the file has animations.
    pub fn is_animated(&self) -> bool {
        !self.document.root.animations.is_empty()
    }

    /// Lists the animations of the file.
    ///
    /// # Errors
    /// If an animation is invalid.
    pub fn animations(&self) -> Result<Vec<Animation>, SceneError> {
        let buffers = Buffers::of(&self.document);
        let source = Source::new(&self.document, &buffers);
        let clips = self.document.root.animations.iter().enumerate();
        let described = clips.map(|(index, clip)| {
            Ok(Animation {
                name: animation::name(index, clip),
                seconds: animation::extent(&source, index)?,
                moves_only_cameras: self.moves_only_cameras(index),
            })
        });
        described.collect()
    }

    /// Returns whether the animations of these names move cameras alone, and neither meshes nor lights. An
    /// empty list means all animations.
    ///
    /// # Errors
    /// If `names` has a name that no animation has.
    pub fn only_cameras_move(&self, names: &[String]) -> Result<bool, SceneError> {
        let playing = animation::playing(&self.document, names)?;
        Ok(playing.into_iter().all(|index| self.moves_only_cameras(index)))
    }

    fn moves_only_cameras(&self, animation: usize) -> bool {
        let root = &self.document.root;
        let mut open: Vec<_> = animation::targets(&root.animations[animation]).collect();
        let is_joint =
            |node: usize| root.skins.iter().flat_map(|skin| &skin.joints).any(|joint| joint.value() == node);
        let mut seen = vec![false; root.nodes.len()];
        while let Some(index) = open.pop() {
            if std::mem::replace(&mut seen[index], true) {
                continue;
            }
            let node = &root.nodes[index];
            let extensions = node.extensions.as_ref();
            let has_light = extensions.is_some_and(|extensions| extensions.khr_lights_punctual.is_some())
                || profiles::of_node(node).is_some();
            if node.mesh.is_some() || has_light || is_joint(index) {
                return false;
            }
            open.extend(node.children.iter().flatten().map(json::Index::value));
        }
        true
    }

    /// Adds the meshes, lights and cameras of the nodes to a scene that has everything else. `moment` is
    /// `None` for the scene without animations.
    fn placed(&self, mut scene: Scene, moment: Option<&Moment>) -> Result<Scene, SceneError> {
        let Self { document, light_units, bare: _, room, unreadable, framed: _, anchor } = self;
        let buffers = Buffers::of(document);
        let source = Source::new(document, &buffers);
        let poses = moment.map_or(Ok(Poses::new()), |moment| animation::poses(&source, moment))?;
        let mut notices = Notices { unreadable: unreadable.clone(), ..Notices::default() };
        nodes::place(&source, &poses, *light_units, anchor, &mut scene, &mut room.clone(), &mut notices)?;
        scene.offset = anchor.get().map_or(DVec3::ZERO, |anchor| anchor.offset);
        let file = || document.path.clone();
        match (scene.placed_triangles() == 0, scene.skipped_triangles) {
            (true, 0) => return Err(SceneError::NoGeometry { file: file() }),
            (true, skipped) => return Err(SceneError::OnlyZeroArea { file: file(), skipped }),
            _ => {}
        }
        if scene.cameras.is_empty() {
            let (camera, view) = self.framed(&scene, moment)?;
            scene.cameras.push(camera);
            notices.framed = Some(view);
        }
        scene.lift_lamps().map_err(|error| {
            SceneError::memory(&document.path, "looking for lamps in other planes", error)
        })?;
        notices.glass = solid_glass::resolve(document, &mut scene)?;
        notices.touching_glass = touching_glass::join(&mut scene);
        let Sentences { ignored, concerns, remarks } = notices.finish(document);
        (scene.notices, scene.concerns, scene.remarks) = (ignored, concerns, remarks);
        Ok(scene)
    }

    /// Default camera of a file without cameras. Its position follows from the scene without animations.
    fn framed(&self, scene: &Scene, moment: Option<&Moment>) -> Result<(Camera, Framed), SceneError> {
        if moment.is_some() && self.framed.get().is_none() {
            self.at_rest()?;
        }
        Ok(self.framed.get_or_init(|| camera::frame(scene)).clone())
    }
}

/// Reads the scene without its nodes' meshes, lights and cameras. Returns it with descriptions of unreadable
/// images.
fn bare_scene(document: &Document, room: &mut Room) -> Result<(Scene, Vec<String>), SceneError> {
    let buffers = Buffers::of(document);
    let source = Source::new(document, &buffers);
    let mut textures = Textures::new(document);
    let materials = material::load(document, &mut textures)?;
    let stated_light_groups = material::light_groups(document)?;
    let generator = document.root.asset.generator.clone();
    let mut scene = Scene::from(SceneContents {
        materials,
        stated_light_groups,
        variants: variants::names(document),
        generator,
        ..SceneContents::default()
    });
    let mut unreadable = Vec::new();
    textures.finish(&source, room, &mut scene, &mut unreadable)?;
    Ok((scene, unreadable))
}
