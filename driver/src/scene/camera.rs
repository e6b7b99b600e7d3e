//! Cameras.

use glam::Vec3;

/// A perspective camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, or `camera N`.
    pub name: String,
    /// Position of the pinhole, metres.
    pub origin: Vec3,
    /// Unit vector to the right of the picture.
    pub right: Vec3,
    /// Unit vector to the top of the picture.
    pub up: Vec3,
    /// Unit vector of the view direction.
    pub forward: Vec3,
    /// Vertical field of view in radians; the horizontal one follows from the picture's aspect.
    pub vertical_fov: f32,
    /// Width over height, if the file states it.
    pub aspect: Option<f32>,
}
