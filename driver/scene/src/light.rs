//! Punctual lights: point, spot and directional (`KHR_lights_punctual`).

use std::ops::RangeInclusive;

use glam::Vec3;

/// Range of the angle across the disk of a directional light, degrees.
pub(crate) const DISK_DEGREES: RangeInclusive<f32> = 0.0..=180.0;

/// Point, spot or directional light in radiometric units. Lights of a file are converted from its
/// [`LightUnits`](super::LightUnits).
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    /// Name in the file, or `light N`.
    pub name: String,
    /// Kind of the light, with its position and direction.
    pub kind: PunctualKind,
    /// Colour times intensity per linear RGB channel: W/sr of point and spot lights, W/m^2 of directional
    /// lights. Of a light with a profile it is that of the peak.
    pub intensity: Vec3,
    /// Axes of the light's node.
    pub axes: LightAxes,
}

/// Orientation of a light, to which its profile refers: two orthogonal unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightAxes {
    /// The node's -z: gamma = 0 of a profile.
    pub aim: Vec3,
    /// The node's x: C = 0 of a profile.
    pub across: Vec3,
}

impl Default for LightAxes {
    /// Axes of a node that is not rotated.
    fn default() -> Self {
        Self { aim: Vec3::NEG_Z, across: Vec3::X }
    }
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
    /// Light from a point, with the intensities of a [`LightProfile`](crate::LightProfile) in the directions
    /// of [`PunctualLight::axes`].
    Profile {
        /// Position, metres.
        position: Vec3,
        /// Index into [`SceneContents::textures`](crate::SceneContents::textures) of the profile's texture.
        texture: u32,
    },
    /// Light from infinitely far: parallel, or from a disk of uniform radiance, such as the sun's.
    Directional {
        /// Unit vector of the direction in which light travels, from the disk's middle.
        direction: Vec3,
        /// Angle across the disk, radians, 0 to pi; 0 for parallel light. The intensity is the irradiance of
        /// a surface perpendicular to `direction`, whatever the angle.
        angle: f32,
    },
}
