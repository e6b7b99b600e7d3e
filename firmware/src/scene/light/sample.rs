//! Light samples and the surface points that receive them.

use glam::Vec3;

use crate::scene::Surface;

/// Surface point for which light is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Position, metres.
    pub position: Vec3,
    /// Unit normal. Light from the other side of the surface is ignored.
    pub normal: Vec3,
    /// Origin of shadow rays, just off the surface, metres.
    pub origin: Vec3,
}

impl Receiver {
    /// Creates the receiver of a surface, on the side from which the surface is seen.
    #[inline(always)]
    pub fn new(surface: &Surface) -> Self {
        Self { position: surface.position, normal: surface.normal, origin: surface.offset_origin() }
    }
}

/// Light sample: a direction to one light, and an estimate of the irradiance from all lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub direction: Vec3,
    /// Distance of the light, metres; infinite for the environment and for distant lights.
    pub distance: f32,
    /// Irradiance from the light on a surface perpendicular to `direction`, divided by the probability of the
    /// sample, W/m^2. The expectation of this value times the receiver's cosine is the irradiance from all
    /// lights, without occlusion.
    pub irradiance: Vec3,
    /// Probability density of the direction, 1/sr; `None` for lights without an area (point, spot and distant
    /// lights), which no gather ray can hit.
    pub density: Option<f32>,
    /// Light group of the light.
    pub light_group: u8,
}
