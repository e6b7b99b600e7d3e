//! Lights without extent (`KHR_lights_punctual`).

use glam::Vec3;

/// A light without extent. The photometric units of glTF stand for the radiometric ones of the same geometry, unit for
/// unit.
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    /// The name in the file, or `light N`.
    pub name: String,
    /// Where it is, and where its light goes.
    pub kind: PunctualKind,
    /// W/sr of point and spot lights, W/m^2 of directional ones, of each linear RGB channel: colour * intensity.
    pub intensity: Vec3,
}

/// Where a light without extent is, and where its light goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// To all sides from a place.
    Point {
        /// The place, metres.
        position: Vec3,
    },
    /// From a place into a cone. Between the cones the intensity falls off as `KHR_lights_punctual` recommends:
    /// `((cos - outer_cosine) / (inner_cosine - outer_cosine))^2`.
    Spot {
        /// The place, metres.
        position: Vec3,
        /// Unit vector of the cone's axis, the way light goes.
        direction: Vec3,
        /// Cosine of the angle up to which the intensity is the whole one; above `outer_cosine`.
        inner_cosine: f32,
        /// Cosine of the angle from which on there is no light.
        outer_cosine: f32,
    },
    /// From infinitely far.
    Directional {
        /// Unit vector, the way light goes.
        direction: Vec3,
    },
}
