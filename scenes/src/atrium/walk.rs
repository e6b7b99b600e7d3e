//! Animation of a camera that walks through the court, past the fountain and up to the far arcade.

use glam::Vec3;

use super::{LENS, lit_court};
use crate::builder::Camera;
use crate::motion::{Between, Track, Values};

/// Time between two consecutive views, seconds.
const INTERVAL: f32 = 2.0;

/// Positions of the eye and of its target, metres. The first pair is that of the atrium's camera `court`.
const VIEWS: [[[f32; 3]; 2]; 6] = [
    [[-11.2, 2.0, -2.9], [-2.0, 3.4, 0.6]],
    [[-7.4, 1.9, -1.9], [1.0, 3.2, 0.9]],
    [[-3.6, 1.8, -2.0], [3.5, 3.0, 1.6]],
    [[0.0, 1.8, -2.5], [6.5, 3.0, 1.6]],
    [[3.8, 1.8, -1.6], [10.0, 3.2, 1.2]],
    [[7.4, 1.8, -0.4], [14.0, 3.4, 0.4]],
];

/// Returns, as a `.glb` file, the court with its sky and sun and a camera that walks for ten seconds.
pub(crate) fn walk() -> Vec<u8> {
    let mut scene = lit_court();
    let (yfov, aspect_ratio) = LENS;
    let views = VIEWS.map(|[eye, target]| Camera {
        eye: Vec3::from_array(eye),
        target: Vec3::from_array(target),
        yfov,
        aspect_ratio,
    });
    let node = scene.moving_camera("walk", &views[0]);
    let track = |values| Track { node, values, interval: INTERVAL, between: Between::Smooth };
    let eyes = Values::Translations(views.iter().map(|view| view.eye).collect());
    let turns = Values::Rotations(views.iter().map(Camera::rotation).collect());
    scene.animation("walk", &[track(eyes), track(turns)]);
    scene.into_glb()
}
