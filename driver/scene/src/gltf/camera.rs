//! Cameras of the file, or a default one that shows the whole scene.

use std::collections::BTreeSet;

use glam::{DMat4, DVec3, Vec3};
use gltf::json::camera::Type;
use gltf::json::validation::Checked;

use super::document::Document;
use super::inside::{self, Framed};
use super::notices::Notices;
use crate::error::SceneError;
use crate::{Camera, FRAMED, Scene};

/// Width of the default camera's view, in units of the scene's width or height, whichever is larger.
const MARGIN: f32 = 1.05;

/// Tangent of half the default camera's field of view of 45 degrees.
const HALF_VIEW_TANGENT: f32 = std::f32::consts::SQRT_2 - 1.0;

/// Vertical field of view of a default camera inside a room: 65 degrees, in radians.
const WIDE_VIEW: f32 = 65.0 / 180.0 * std::f32::consts::PI;

/// Converts the file's cameras to those of the scene, under unique names.
pub(super) struct CameraPlacer<'a> {
    document: &'a Document,
    names: BTreeSet<String>,
}

impl<'a> CameraPlacer<'a> {
    pub(super) fn new(document: &'a Document) -> Self {
        Self { document, names: BTreeSet::new() }
    }

    /// Adds the camera `index` with the transform of `node`; scale and skew are ignored, as glTF requires.
    pub(super) fn place(
        &mut self,
        index: usize,
        node: usize,
        world: &DMat4,
        scene: &mut Scene,
        notices: &mut Notices,
    ) -> Result<(), SceneError> {
        let document = self.document;
        let source = &document.root.cameras[index];
        let name = self.name(index, node);
        let (Checked::Valid(Type::Perspective), Some(perspective)) = (source.type_, &source.perspective)
        else {
            let before = scene.cameras.len();
            scene.orthographic.push((before, name.clone()));
            notices.orthographic.push(name);
            return Ok(());
        };
        let item = |field| format!("cameras[{index}].perspective.{field}");
        let vertical_fov = perspective.yfov;
        if !(vertical_fov > 0.0 && vertical_fov < std::f32::consts::PI) {
            let reason = format!("a vertical field of view of {vertical_fov} radians is not possible");
            return Err(document.invalid(item("yfov"), reason, "state an angle between 0 and pi"));
        }
        let aspect = perspective.aspect_ratio;
        if let Some(aspect) = aspect.filter(|aspect| !(*aspect > 0.0 && aspect.is_finite())) {
            let reason = format!("an aspect ratio of {aspect} is not possible");
            return Err(document.invalid(item("aspectRatio"), reason, "state width over height, above 0"));
        }
        let (origin, right, up, forward) = axes(world).ok_or_else(|| {
            let reason = "the transform of the camera's node, with that of its parents, cannot be inverted";
            let remedy = "give the camera's node and its parents a finite scale other than 0";
            document.invalid(format!("nodes[{node}]"), reason, remedy)
        })?;
        scene.cameras.push(Camera { name, origin, right, up, forward, vertical_fov, aspect });
        Ok(())
    }

    /// Unique name of the camera: its own, else that of its node, else `camera N`.
    fn name(&mut self, index: usize, node: usize) -> String {
        let root = &self.document.root;
        let stated = [root.cameras[index].name.as_ref(), root.nodes[node].name.as_ref()];
        let name = stated.into_iter().flatten().find(|name| !self.names.contains(*name)).cloned();
        let name = name.unwrap_or_else(|| format!("camera {}", self.names.len()));
        self.names.insert(name.clone());
        name
    }
}

/// Position and right-handed unit axes of a camera; `None` for a degenerate transform.
fn axes(world: &DMat4) -> Option<(Vec3, Vec3, Vec3, Vec3)> {
    let determinant = world.determinant();
    if determinant == 0.0 || !determinant.is_finite() {
        return None;
    }
    let forward = (-world.z_axis.truncate()).try_normalize()?;
    let upward = world.y_axis.truncate().try_normalize()?;
    let right = forward.cross(upward).try_normalize()?;
    let up = right.cross(forward);
    let origin: DVec3 = world.w_axis.truncate();
    let placed = (origin.as_vec3(), right.as_vec3(), up.as_vec3(), forward.as_vec3());
    placed.0.is_finite().then_some(placed)
}

/// Default camera: inside a closed room that is lit from inside, else in front of the scene's bounding box.
pub(super) fn frame(scene: &Scene) -> (Camera, Framed) {
    match inside::view(scene) {
        Some((origin, forward)) => {
            let right = forward.cross(Vec3::Y);
            let camera = Camera { origin, right, forward, vertical_fov: WIDE_VIEW, ..from_front(scene) };
            (camera, Framed::FromInside)
        }
        None => (from_front(scene), Framed::FromFront),
    }
}

/// Default camera in front of the scene's bounding box, which sees the whole scene in a square or wider
/// picture.
fn from_front(scene: &Scene) -> Camera {
    let (low, high) = scene.bounds();
    let centre = low + (high - low) * 0.5;
    let half = (high - low) * 0.5;
    let vertical_fov = std::f32::consts::FRAC_PI_4;
    let distance = MARGIN * half.x.max(half.y).max(0.01 * half.z) / HALF_VIEW_TANGENT;
    Camera {
        name: FRAMED.to_owned(),
        origin: Vec3::new(centre.x, centre.y, high.z + distance),
        right: Vec3::X,
        up: Vec3::Y,
        forward: Vec3::NEG_Z,
        vertical_fov,
        aspect: None,
    }
}
