//! Cameras of the file, or a default one that shows the whole scene.

use std::collections::BTreeSet;

use glam::{DMat4, DVec3, Vec3};
use gltf::json::camera::{Orthographic, Type};
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde_json::Value;

use super::document::Document;
use super::extras;
use super::inside::{self, Framed};
use crate::camera::EXTENTS;
use crate::error::SceneError;
use crate::{Aperture, Camera, FRAMED, Projection, Scene};

/// Width of the default camera's view, in units of the scene's width or height, whichever is larger.
const MARGIN: f32 = 1.05;

/// Tangent of half the default camera's field of view of 45 degrees.
const HALF_VIEW_TANGENT: f32 = std::f32::consts::SQRT_2 - 1.0;

/// Vertical field of view of a default camera inside a room: 65 degrees, in radians.
const WIDE_VIEW: f32 = 65.0 / 180.0 * std::f32::consts::PI;

/// Properties of a camera under the key `photoncard` of its `extras`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Extras {
    /// [`Camera::shift`].
    shift: Option<[f32; 2]>,
    /// Diameter in metres, or an f-number such as `f/2.8`; of a picture of the file's aspect ratio.
    aperture: Option<Value>,
    /// [`crate::Lens::focus`], metres.
    focus: Option<f32>,
    /// Angles of longitude and latitude, degrees.
    panorama: Option<[f32; 2]>,
}

/// Reads a number of metres, or a text such as `f/2.8`.
fn aperture_of(value: &Value) -> Result<Aperture, String> {
    match value {
        Value::String(text) => text.parse(),
        other => other.to_string().parse(),
    }
}

impl Extras {
    /// Changes a camera.
    ///
    /// # Errors
    /// The reason why the properties are not possible.
    fn apply(self, camera: &mut Camera) -> Result<(), String> {
        let Self { shift, aperture, focus, panorama } = self;
        if let Some(degrees) = panorama {
            (camera.projection, camera.aspect) =
                (Projection::panorama(degrees)?, Some(degrees[0] / degrees[1]));
        }
        camera.set_shift(shift.unwrap_or_default())?;
        match (aperture, focus) {
            (None, None) => Ok(()),
            (Some(aperture), Some(focus)) => {
                let aperture = aperture_of(&aperture)?;
                camera.set_lens(aperture, focus, camera.aspect.unwrap_or(1.0))
            }
            (Some(_), None) => Err("an aperture needs a focus".into()),
            (None, Some(_)) => Err("a focus needs an aperture".into()),
        }
    }
}

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
    ) -> Result<(), SceneError> {
        let document = self.document;
        let name = self.name(index, node);
        let (projection, aspect) = self.projection(index)?;
        let (origin, right, up, forward) = axes(world).ok_or_else(|| {
            let reason = "the transform of the camera's node, with that of its parents, cannot be inverted";
            let remedy = "give the camera's node and its parents a finite scale other than 0";
            document.invalid(format!("nodes[{node}]"), reason, remedy)
        })?;
        let (shift, lens) = ([0.0; 2], None);
        let mut camera = Camera { name, origin, right, up, forward, projection, shift, lens, aspect };
        if let Some(extras) = self.extras(index)? {
            extras.apply(&mut camera).map_err(|reason| self.invalid_extras(index, reason))?;
        }
        scene.cameras.push(camera);
        Ok(())
    }

    /// Projection and aspect ratio of a camera, by glTF's own properties.
    fn projection(&self, index: usize) -> Result<(Projection, Option<f32>), SceneError> {
        let source = &self.document.root.cameras[index];
        let invalid = |field: &str, reason: String, remedy| {
            Err(self.document.invalid(format!("cameras[{index}].{field}"), reason, remedy))
        };
        if let (Checked::Valid(Type::Orthographic), Some(Orthographic { xmag, ymag, .. })) =
            (source.type_, &source.orthographic)
        {
            // Some exporters state mirrored extents.
            let [half_width, half_height] = [xmag, ymag].map(|extent| extent.abs());
            let aspect = half_width / half_height;
            for (field, extent, ratio) in [("ymag", half_height, 1.0), ("xmag", half_width, aspect)] {
                if !(EXTENTS.contains(&extent) && ratio.is_normal()) {
                    let reason = format!("half an extent of {extent} m is not possible");
                    return invalid(&format!("orthographic.{field}"), reason, "state metres above 0");
                }
            }
            return Ok((Projection::Orthographic { half_height }, Some(aspect)));
        }
        let Some(perspective) = &source.perspective else {
            let reason = "the camera states no projection".into();
            return invalid("type", reason, "state perspective or orthographic, and its properties");
        };
        let vertical_fov = perspective.yfov;
        if !(vertical_fov > 0.0 && vertical_fov < std::f32::consts::PI) {
            let reason = format!("a vertical field of view of {vertical_fov} radians is not possible");
            return invalid("perspective.yfov", reason, "state an angle between 0 and pi");
        }
        let aspect = perspective.aspect_ratio;
        if let Some(aspect) = aspect.filter(|aspect| !(*aspect > 0.0 && aspect.is_finite())) {
            let reason = format!("an aspect ratio of {aspect} is not possible");
            return invalid("perspective.aspectRatio", reason, "state width over height, above 0");
        }
        Ok((Projection::Perspective { vertical_fov }, aspect))
    }

    /// Properties of a camera that glTF lacks.
    fn extras(&self, index: usize) -> Result<Option<Extras>, SceneError> {
        let source = &self.document.root.cameras[index];
        extras::read(&source.extras).map_err(|reason| self.invalid_extras(index, reason))
    }

    fn invalid_extras(&self, index: usize, reason: String) -> SceneError {
        let item = format!("cameras[{index}].extras.photoncard");
        let remedy = r#"state some of {"photoncard": {"shift": [x, y], "aperture": "f/2.8", "focus": metres, "panorama": [360, 180]}}"#;
        self.document.invalid(item, reason, remedy)
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
            let projection = Projection::perspective(WIDE_VIEW);
            let camera = Camera { origin, right, forward, projection, ..from_front(scene) };
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
    let origin = Vec3::new(centre.x, centre.y, high.z + distance);
    Camera::perspective(FRAMED, origin, [Vec3::X, Vec3::Y, Vec3::NEG_Z], vertical_fov, None)
}
