//! A scene that stays as it is between pictures, with what renders derive from all of it.

use std::borrow::Cow;
use std::ops::Deref;
use std::sync::OnceLock;

use super::{Camera, Scene};

/// A scene that stays as it is between pictures. What a render derives from all triangles and texels is computed once.
#[derive(Debug)]
pub struct FixedScene<'a> {
    scene: Cow<'a, Scene>,
    checksum: OnceLock<String>,
    without_cameras: OnceLock<String>,
    is_specular: OnceLock<bool>,
}

impl FixedScene<'_> {
    /// [`Scene::checksum`].
    pub fn checksum(&self) -> &str {
        self.checksum.get_or_init(|| self.scene.checksum())
    }

    /// [`Scene::checksum_without_cameras`].
    pub fn checksum_without_cameras(&self) -> &str {
        self.without_cameras.get_or_init(|| self.scene.checksum_without_cameras())
    }

    /// [`Scene::is_specular`].
    pub fn is_specular(&self) -> bool {
        *self.is_specular.get_or_init(|| self.scene.is_specular())
    }

    /// The scene.
    pub fn into_scene(self) -> Scene {
        self.scene.into_owned()
    }
}

impl Deref for FixedScene<'_> {
    type Target = Scene;

    fn deref(&self) -> &Scene {
        &self.scene
    }
}

impl FixedScene<'static> {
    /// The cameras of a scene of these checksums, with cameras and without. Of the rest nothing is there but whether it is specular.
    pub(crate) fn of_cameras(cameras: Vec<Camera>, checksums: [String; 2], is_specular: bool) -> Self {
        let [checksum, without_cameras] = checksums.map(OnceLock::from);
        let scene = Cow::Owned(Scene { cameras, ..Scene::default() });
        Self { scene, checksum, without_cameras, is_specular: is_specular.into() }
    }
}

impl From<Scene> for FixedScene<'static> {
    fn from(scene: Scene) -> Self {
        Self::of(Cow::Owned(scene))
    }
}

impl<'a> From<&'a Scene> for FixedScene<'a> {
    fn from(scene: &'a Scene) -> Self {
        Self::of(Cow::Borrowed(scene))
    }
}

impl<'a> FixedScene<'a> {
    fn of(scene: Cow<'a, Scene>) -> Self {
        Self {
            scene,
            checksum: OnceLock::new(),
            without_cameras: OnceLock::new(),
            is_specular: OnceLock::new(),
        }
    }
}
