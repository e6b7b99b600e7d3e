//! Light samples, and the places that they are for.

use glam::Vec3;

use crate::scene::Surface;

/// A place that light is sampled for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// The place, metres.
    pub position: Vec3,
    /// Unit normal: only what is above its horizon counts.
    pub normal: Vec3,
    /// Where shadow rays start, off the surface, metres.
    pub origin: Vec3,
}

impl Receiver {
    /// A place on a surface, lit from the side that it is seen from.
    #[inline(always)]
    pub fn new(surface: &Surface) -> Self {
        Self { position: surface.position, normal: surface.normal, origin: surface.offset_origin() }
    }
}

/// Light from one direction, one sample of what comes from all lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub direction: Vec3,
    /// How far it is, metres; infinite for the environment and distant lights.
    pub distance: f32,
    /// Irradiance of a surface that faces it, W/m^2, over the probability of the sample: its mean over many is that by all
    /// lights.
    pub irradiance: Vec3,
    /// Probability density of the direction, 1/sr; `None` of lights without extent, which no other ray finds.
    pub density: Option<f32>,
}
