//! Scene that is rendered several times without changes of geometry or materials, with cached checksums.

use std::borrow::Cow;
use std::ops::Deref;
use std::sync::OnceLock;

use glam::DVec3;
use photoncard_shared::checksum::Checksum;

use super::{Camera, Scene};

/// Scene whose geometry and materials stay fixed between renders. Checksums of all triangles and texels are
/// computed once.
#[derive(Debug)]
pub struct FixedScene<'a> {
    scene: Cow<'a, Scene>,
    /// [`Scene::bulk_checksum`].
    bulk: OnceLock<Checksum>,
    checksum: OnceLock<String>,
    without_cameras: OnceLock<String>,
    is_specular: OnceLock<bool>,
}

impl FixedScene<'_> {
    /// [`Scene::checksum`].
    pub fn checksum(&self) -> &str {
        self.checksum.get_or_init(|| self.scene.checksum_after(self.bulk(), &self.scene.cameras))
    }

    /// [`Scene::checksum_without_cameras`].
    pub fn checksum_without_cameras(&self) -> &str {
        self.without_cameras.get_or_init(|| self.scene.checksum_after(self.bulk(), &[]))
    }

    /// [`Scene::is_specular`].
    pub fn is_specular(&self) -> bool {
        *self.is_specular.get_or_init(|| self.scene.is_specular())
    }

    fn bulk(&self) -> Checksum {
        self.bulk.get_or_init(|| self.scene.bulk_checksum()).clone()
    }

    /// Replaces the cameras. Cached checksums of triangles and texels stay valid.
    pub fn set_cameras(&mut self, cameras: Vec<Camera>) {
        self.scene.to_mut().cameras = cameras;
        self.checksum = OnceLock::new();
    }

    /// Returns the scene.
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
    /// Creates a stand-in for a scene of which only the cameras, the offset, and the checksums with and
    /// without cameras are known, and whether it is specular.
    pub fn of_cameras(
        cameras: Vec<Camera>,
        offset: DVec3,
        checksums: [String; 2],
        is_specular: bool,
    ) -> Self {
        let [checksum, without_cameras] = checksums.map(OnceLock::from);
        let scene = Cow::Owned(Scene { cameras, offset, ..Scene::default() });
        Self { scene, bulk: OnceLock::new(), checksum, without_cameras, is_specular: is_specular.into() }
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
            bulk: OnceLock::new(),
            checksum: OnceLock::new(),
            without_cameras: OnceLock::new(),
            is_specular: OnceLock::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::Triangle;

    fn camera(x: f32) -> Camera {
        let [right, up, forward] = [Vec3::X, Vec3::Y, Vec3::NEG_Z];
        let origin = Vec3::X * x;
        Camera { name: "eye".to_owned(), origin, right, up, forward, vertical_fov: 1.0, aspect: None }
    }

    #[test]
    fn cameras_that_are_set_are_those_of_the_scene_and_change_no_other_checksum() {
        let triangles = vec![Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], 0)];
        let scene = Scene { triangles, cameras: vec![camera(0.0)], ..Scene::default() };
        let moved = Scene { cameras: vec![camera(1.0)], ..scene.clone() };
        let mut fixed = FixedScene::from(&scene);
        assert_eq!(fixed.checksum(), scene.checksum());
        fixed.set_cameras(moved.cameras.clone());
        assert_eq!((fixed.checksum(), fixed.cameras.as_slice()), (&*moved.checksum(), &*moved.cameras));
        assert_ne!(fixed.checksum(), scene.checksum());
        assert_eq!(fixed.checksum_without_cameras(), scene.checksum_without_cameras());
    }
}
