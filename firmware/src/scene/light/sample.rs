//! Light samples and the surface points that receive them.

use glam::Vec3;

use crate::scene::Surface;

/// Surface point for which light is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Position, metres.
    pub position: Vec3,
    /// Unit normal. Light from below its horizon is excluded.
    pub normal: Vec3,
    /// Origin of shadow rays, just off the surface, metres.
    pub origin: Vec3,
}

impl Receiver {
    /// Receiver at a surface, on the side from which the surface is seen.
    #[inline(always)]
    pub fn new(surface: &Surface) -> Self {
        Self { position: surface.position, normal: surface.normal, origin: surface.offset_origin() }
    }
}

/// Sample of the light from all lights: one direction and the density of that direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub direction: Vec3,
    /// Distance of the light, metres; infinite for the environment and for distant lights.
    pub distance: f32,
    /// Irradiance on a surface that faces the light, divided by the probability of the sample, W/m^2. The
    /// expectation of this estimate is the irradiance from all lights.
    pub irradiance: Vec3,
    /// Probability density of the direction, 1/sr; `None` for lights without an area, which no gather ray
    /// hits.
    pub density: Option<f32>,
}
