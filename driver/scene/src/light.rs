//! Punctual lights: point, spot and directional (`KHR_lights_punctual`).

use glam::Vec3;

/// Point, spot or directional light in radiometric units. Lights of a file are converted from its
/// [`LightUnits`](super::LightUnits).
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    /// Name in the file, or `light N`.
    pub name: String,
    /// Kind of the light, with its position and direction.
    pub kind: PunctualKind,
    /// Colour times intensity per linear RGB channel: W/sr of point and spot lights, W/m^2 of directional
    /// lights.
    pub intensity: Vec3,
}

/// Kind of a punctual light, with its position and direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// Light in all directions from a point.
    Point {
        /// Position, metres.
        position: Vec3,
    },
    /// Light from a point into a cone. Between the inner and the outer cone the intensity falls off as
    /// `KHR_lights_punctual` recommends: `((cos - outer_cosine) / (inner_cosine - outer_cosine))^2`.
    Spot {
        /// Position of the apex, metres.
        position: Vec3,
        /// Unit vector of the cone's axis, in the direction in which light travels.
        direction: Vec3,
        /// Cosine of the inner cone angle, within which the intensity is full; above `outer_cosine`.
        inner_cosine: f32,
        /// Cosine of the outer cone angle, beyond which the intensity is 0.
        outer_cosine: f32,
    },
    /// Parallel light from infinitely far.
    Directional {
        /// Unit vector of the direction in which light travels.
        direction: Vec3,
    },
}
