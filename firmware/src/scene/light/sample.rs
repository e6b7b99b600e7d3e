//! Light samples and their receivers.

use glam::Vec3;

use crate::scene::Surface;

/// Surface point that light is sampled for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Position, metres.
    pub position: Vec3,
    /// Unit normal; light from below its horizon is excluded.
    pub normal: Vec3,
    /// Origin of shadow rays, just off the surface, metres.
    pub origin: Vec3,
}

impl Receiver {
    /// Receiver at a surface, on the side that it is seen from.
    #[inline(always)]
    pub fn new(surface: &Surface) -> Self {
        Self { position: surface.position, normal: surface.normal, origin: surface.offset_origin() }
    }
}

/// Sample of the light from all lights: one direction, with its density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub direction: Vec3,
    /// Distance of the light, metres; infinite for the environment and distant lights.
    pub distance: f32,
    /// Irradiance on a surface that faces the light over the probability of the sample, W/m^2: its
    /// expectation is the irradiance by all lights.
    pub irradiance: Vec3,
    /// Probability density of the direction, 1/sr; `None` for lights without extent, which no gather ray
    /// meets.
    pub density: Option<f32>,
}
