//! Camera of the picture: the scene's camera, unless the settings move, turn or project it otherwise.

use glam::{DVec3, Vec3};
use photoncard_firmware::scene::Ray;
use photoncard_firmware::scene::camera::{depth_per_distance, ray_at};
use photoncard_scene::{Aperture, Camera, Lens, Projection, Scene};

use super::{Picture, RenderSettings};
use crate::error::RenderError;

/// Sine of the angle to the vertical below which a direction counts as vertical.
const VERTICAL: f64 = 1e-6;

impl RenderSettings {
    /// Determines the camera of the picture. [`Picture::camera_at`], [`Picture::look_at`], the three
    /// projections, [`Picture::shift`] and the lens each replace a property of the scene's camera; its other
    /// properties stay.
    ///
    /// # Errors
    /// If the scene has no camera with this name, or the values are not valid for a camera.
    pub fn camera(&self, scene: &Scene) -> Result<Camera, RenderError> {
        let Picture { camera, camera_at, look_at, up, .. } = &self.picture;
        let mut camera = scene.camera(camera.as_deref())?.clone();
        if let Some(at) = camera_at {
            camera.origin = placed("picture.camera_at", *at, scene)?;
        }
        let mut distance = None;
        if let Some(target) = look_at {
            let target = placed("picture.look_at", *target, scene)?;
            let view = target.as_dvec3() - camera.origin.as_dvec3();
            let forward = view.try_normalize().ok_or_else(|| at_the_camera(scene.in_file(target)))?;
            [camera.right, camera.up, camera.forward] = upright(forward).map(DVec3::as_vec3);
            distance = Some(view.length() as f32);
        }
        if let Some(up) = up {
            let axes = turned(camera.forward.as_dvec3(), *up)?;
            [camera.right, camera.up, camera.forward] = axes.map(DVec3::as_vec3);
        }
        self.picture.project(&mut camera)?;
        self.picture.focus(&mut camera, distance)?;
        if self.frame_camera(&camera).is_finite() {
            return Ok(camera);
        }
        let reason = "its numbers are too large for single precision".into();
        Err(refused("picture.camera", &camera.name, reason, "give a smaller size, shift or field of view"))
    }
}

impl RenderSettings {
    /// Point in the scene's coordinates that the middle of pixel `[column, row]` shows at a depth, metres
    /// (layer `Z`), through the middle of the lens.
    pub fn seen_point(&self, camera: &Camera, [column, row]: [u32; 2], depth: f32) -> Vec3 {
        let Picture { width, height, .. } = self.picture;
        let place = [(column, width), (row, height)].map(|(at, side)| (at as f32 + 0.5) / side as f32);
        let camera = self.frame_camera(camera);
        let Ray { origin, direction, .. } = ray_at(&camera, place, [0.0; 2]);
        origin + direction * (depth / depth_per_distance(&camera, direction))
    }
}

impl Picture {
    /// Sets the stated projection and lens shift. A lens or shift that the projection cannot have is removed.
    fn project(&self, camera: &mut Camera) -> Result<(), RenderError> {
        let Self { fov, orthographic, panorama, shift, .. } = *self;
        let replaced = match (fov, orthographic, panorama) {
            (None, None, None) => None,
            (Some(degrees), None, None) => Some(Projection::perspective(field_of_view(degrees)?)),
            (None, Some(height), None) => Some(Projection::orthographic(height).map_err(|reason| {
                refused("picture.orthographic", &height, reason, "give metres, such as 3")
            })?),
            (None, None, Some(degrees)) => Some(Projection::panorama(degrees).map_err(|reason| {
                let value = format!("{},{}", degrees[0], degrees[1]);
                refused("picture.panorama", &value, reason, "give 360,180 or 180,180")
            })?),
            _ => {
                let [reason, remedy] = ["a picture has one projection", "state one of them"];
                let field = if panorama.is_some() { "picture.panorama" } else { "picture.orthographic" };
                return Err(refused(field, &"with another projection", reason.into(), remedy));
            }
        };
        if let Some(projection) = replaced {
            camera.projection = projection;
            camera.aspect = panorama.map(|[longitude, latitude]| longitude / latitude).or(camera.aspect);
            if camera.vertical_fov().is_none() {
                camera.lens = None;
            }
            if panorama.is_some() {
                camera.shift = [0.0; 2];
            }
        }
        if let Some(shift) = shift {
            camera.set_shift(shift).map_err(|reason| {
                let value = format!("{},{}", shift[0], shift[1]);
                refused("picture.shift", &value, reason, "give parts of the longer side, such as 0,0.2")
            })?;
        }
        Ok(())
    }

    /// Sets the stated lens. `distance` is that of [`Self::look_at`], metres.
    fn focus(&self, camera: &mut Camera, distance: Option<f32>) -> Result<(), RenderError> {
        let Self { aperture, focus, width, height, .. } = *self;
        if aperture == Some(Aperture::Diameter(0.0)) {
            camera.lens = None;
            return Ok(());
        }
        let own = camera.lens;
        let Some(opening) = aperture.or(own.map(|lens| Aperture::Diameter(2.0 * lens.radius))) else {
            let reason = || "a pinhole is in focus everywhere".into();
            let remedy = "give an aperture too, such as f/2.8";
            return focus.map_or(Ok(()), |focus| Err(refused("picture.focus", &focus, reason(), remedy)));
        };
        let Some(distance) = focus.or(own.map(|lens| lens.focus)).or(distance) else {
            let reason = "a lens needs a distance in focus".into();
            return Err(refused(
                "picture.aperture",
                &opening,
                reason,
                "give the focus in metres, such as 2.5",
            ));
        };
        if let Some(focus) = focus {
            let remedy = "give metres, such as 2.5";
            Lens::check_focus(focus).map_err(|reason| refused("picture.focus", &focus, reason, remedy))?;
        }
        let remedy = "give one such as f/2.8, of a perspective camera";
        let set = camera.set_lens(opening, distance, width as f32 / height as f32);
        set.map_err(|reason| refused("picture.aperture", &opening, reason, remedy))
    }
}

fn refused(field: &'static str, value: &impl ToString, reason: String, remedy: &'static str) -> RenderError {
    RenderError::Setting { field, value: value.to_string(), reason, remedy: remedy.into() }
}

/// Right, up and forward vectors of a camera in whose picture the direction `up` is up.
///
/// # Errors
/// If the directions are parallel, or `up` has no length.
fn turned(forward: DVec3, up: [f64; 3]) -> Result<[DVec3; 3], RenderError> {
    // Squares of very long and of very short vectors are not finite, or 0.
    let scaled = DVec3::from(up) / DVec3::from(up).abs().max_element();
    let right = scaled.try_normalize().map(|up| forward.cross(up));
    let right = right.filter(|right| right.length() >= VERTICAL).ok_or_else(|| {
        let value = up.map(|number| format!("{number:e}")).join(",");
        let reason = "it is no direction, or that in which the camera looks".to_owned();
        refused("picture.up", &value, reason, "give another direction, such as 0,1,0")
    })?;
    let right = right.normalize();
    let up = right.cross(forward);
    Ok([right, up, forward])
}

/// Right, up and forward vectors of an upright camera: up is in the plane of the direction `forward` and +y.
/// For the directions +y and -y, which define no plane, right is +x, as if the camera were tilted from glTF's
/// default direction -z.
fn upright(forward: DVec3) -> [DVec3; 3] {
    let right = forward.cross(DVec3::Y);
    let right = if right.length() < VERTICAL { DVec3::X } else { right.normalize() };
    let up = right.cross(forward).normalize();
    [forward.cross(up), up, forward]
}

/// Converts a field of view from degrees to radians.
fn field_of_view(degrees: f32) -> Result<f32, RenderError> {
    let radians = degrees.to_radians();
    let half = libm::tanf(0.5 * radians);
    if half > 0.0 && half.is_finite() && radians < std::f32::consts::PI {
        return Ok(radians);
    }
    let reason = "a vertical field of view is above 0 and below 180 degrees".into();
    Err(refused("picture.fov", &degrees, reason, "give a number such as 40"))
}

/// Converts coordinates of the scene's file to a position in the scene.
fn placed(field: &'static str, place: [f64; 3], scene: &Scene) -> Result<Vec3, RenderError> {
    let place = DVec3::from_array(place);
    let placed = scene.in_scene(place);
    if placed.is_finite() {
        return Ok(placed);
    }
    let reason = "a place is three finite numbers of metres".into();
    Err(refused(field, &place, reason, "give X,Y,Z, such as 0,1.5,4"))
}

fn at_the_camera(target: DVec3) -> RenderError {
    let [x, y, z] = target.to_array();
    let remedy = "give another place, or move the camera by `picture.camera_at`";
    refused("picture.look_at", &format!("{x},{y},{z}"), "the camera itself is there".into(), remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        let axes = [Vec3::Y, Vec3::NEG_X, Vec3::NEG_Z];
        let camera = Camera::perspective("eye", Vec3::new(1.0, 2.0, 3.0), axes, 1.0, Some(1.5));
        Scene::default().with(|scene| scene.cameras = vec![camera])
    }

    fn camera(change: impl FnOnce(&mut Picture)) -> Result<Camera, RenderError> {
        RenderSettings::default().with(|settings| change(&mut settings.picture)).camera(&scene())
    }

    #[test]
    fn unstated_properties_are_those_of_the_scenes_camera() {
        let own = scene().cameras.remove(0);
        assert_eq!(camera(|_| ()).unwrap(), own);
        let moved = camera(|picture| picture.camera_at = Some([4.0, 5.0, 6.0])).unwrap();
        assert_eq!(moved, Camera { origin: Vec3::new(4.0, 5.0, 6.0), ..own.clone() });
        let zoomed = camera(|picture| picture.fov = Some(60.0)).unwrap();
        assert_eq!(
            zoomed,
            Camera { projection: Projection::perspective(60_f32.to_radians()), ..own.clone() }
        );
        let turned = camera(|picture| picture.look_at = Some([4.0, 2.0, 3.0])).unwrap();
        assert_eq!(turned, Camera { right: Vec3::Z, up: Vec3::Y, forward: Vec3::X, ..own });
    }

    #[test]
    fn a_view_is_upright_and_orthonormal_in_every_direction() {
        for index in 1..1000 {
            let angle = |step: f64| (f64::from(index) * step).sin();
            let target = [angle(0.7), if index % 3 == 0 { 0.0 } else { 100.0 * angle(1.3) }, angle(1.9)];
            let camera =
                camera(|picture| (picture.camera_at, picture.look_at) = (Some([0.0; 3]), Some(target)));
            let Camera { right, up, forward, .. } = camera.unwrap();
            assert!(forward.distance(DVec3::from_array(target).normalize().as_vec3()) < 1e-6);
            assert!(right.cross(forward).distance(up) < 1e-6 && right.dot(forward).abs() < 1e-6);
            assert!((right.length() - 1.0).abs() < 1e-6);
            assert!(up.y >= 0.0 && right.y.abs() < 1e-6, "{up}");
        }
    }

    #[test]
    fn a_vertical_view_has_the_right_vector_of_a_camera_tilted_from_minus_z() {
        for (y, top) in [(-1.0, Vec3::NEG_Z), (1.0, Vec3::Z)] {
            for (x, z) in [(0.0, 0.0), (1e-8, -1e-8)] {
                let view = |picture: &mut Picture| {
                    (picture.camera_at, picture.look_at) = (Some([0.0; 3]), Some([x, y, z]));
                };
                let camera = camera(view).unwrap();
                assert!(
                    camera.right.distance(Vec3::X) < 1e-6 && camera.up.distance(top) < 1e-6,
                    "{camera:?}"
                );
            }
        }
    }

    #[test]
    fn invalid_views_are_refused_with_their_field() {
        let refused = |field: &str, change: &dyn Fn(&mut Picture)| match camera(change) {
            Err(RenderError::Setting { field: found, .. }) => assert_eq!(found, field),
            other => panic!("{other:?}"),
        };
        for fov in [0.0, -1.0, 180.0, 179.999_999, 1e-45, f32::NAN, f32::INFINITY] {
            refused("picture.fov", &|picture| picture.fov = Some(fov));
        }
        refused("picture.look_at", &|picture| picture.look_at = Some([1.0, 2.0, 3.0]));
        refused("picture.look_at", &|picture| picture.look_at = Some([1.0, f64::NAN, 3.0]));
        refused("picture.camera_at", &|picture| picture.camera_at = Some([f64::INFINITY, 0.0, 0.0]));
        let far = |picture: &mut Picture| {
            (picture.camera_at, picture.look_at) =
                (Some([f32::MAX.into(); 3]), Some([(-f32::MAX).into(); 3]));
        };
        assert!(camera(far).unwrap().forward.is_normalized());
    }
}
