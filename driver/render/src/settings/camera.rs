//! Camera of the picture: the scene's camera, unless the settings move, turn or zoom it.

use glam::{DVec3, Vec3};
use photoncard_scene::error::SceneError;
use photoncard_scene::{Camera, Scene};

use super::{Picture, RenderSettings};
use crate::error::RenderError;

/// Sine of the angle to the vertical below which a direction counts as vertical.
const VERTICAL: f64 = 1e-6;

impl RenderSettings {
    /// Determines the camera of the picture. [`Picture::camera_at`], [`Picture::look_at`] and
    /// [`Picture::fov`] each replace a property of the scene's camera; its other properties stay.
    ///
    /// # Errors
    /// If the scene has no camera with this name, or the values are not valid for a camera.
    pub fn camera(&self, scene: &Scene) -> Result<Camera, RenderError> {
        let Picture { camera, camera_at, look_at, fov, .. } = &self.picture;
        // If position and direction are stated, no property of an orthographic camera is used, and the first
        // camera can replace it.
        let is_placed = self.picture.states_view();
        let found = match (scene.camera(camera.as_deref()), scene.cameras.first()) {
            (Err(SceneError::OrthographicCamera { .. }), Some(other)) if is_placed => other,
            (found, _) => found?,
        };
        let mut camera = found.clone();
        if let Some(at) = camera_at {
            camera.origin = placed("picture.camera_at", *at, scene)?;
        }
        if let Some(target) = look_at {
            let target = placed("picture.look_at", *target, scene)?;
            let forward = (target.as_dvec3() - camera.origin.as_dvec3()).try_normalize();
            let forward = forward.ok_or_else(|| at_the_camera(scene.in_file(target)))?;
            [camera.right, camera.up, camera.forward] = upright(forward).map(DVec3::as_vec3);
        }
        if let Some(degrees) = *fov {
            camera.vertical_fov = field_of_view(degrees)?;
        }
        Ok(camera)
    }
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
    Err(RenderError::Setting {
        field: "picture.fov",
        value: degrees.to_string(),
        reason: "a vertical field of view is above 0 and below 180 degrees".into(),
        remedy: "give a number such as 40".into(),
    })
}

/// Converts coordinates of the scene's file to a position in the scene.
fn placed(field: &'static str, place: [f64; 3], scene: &Scene) -> Result<Vec3, RenderError> {
    let place = DVec3::from_array(place);
    let placed = scene.in_scene(place);
    if placed.is_finite() {
        return Ok(placed);
    }
    Err(RenderError::Setting {
        field,
        value: place.to_string(),
        reason: "a place is three finite numbers of metres".into(),
        remedy: "give X,Y,Z, such as 0,1.5,4".into(),
    })
}

fn at_the_camera(target: DVec3) -> RenderError {
    let [x, y, z] = target.to_array();
    RenderError::Setting {
        field: "picture.look_at",
        value: format!("{x},{y},{z}"),
        reason: "the camera itself is there".into(),
        remedy: "give another place, or move the camera by `picture.camera_at`".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        let camera = Camera {
            name: "eye".to_owned(),
            origin: Vec3::new(1.0, 2.0, 3.0),
            right: Vec3::Y,
            up: Vec3::NEG_X,
            forward: Vec3::NEG_Z,
            vertical_fov: 1.0,
            aspect: Some(1.5),
        };
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
        assert_eq!(zoomed, Camera { vertical_fov: 60_f32.to_radians(), ..own.clone() });
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
