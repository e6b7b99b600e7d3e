//! Passes of a tile: eye ray, direct light, caustics, final gather. Each is a function that handles one
//! pixel, or one ray of it.

pub mod caustic;
pub mod direct;
pub mod eye;
pub mod features;
pub mod final_gather;
mod gather_ray;
mod near;
mod pixel_filter;
mod point;
mod search;
pub mod specular_path;

pub use point::{GatherPoint, Purpose};

use photoncard_shared::counters::Counters;
use photoncard_shared::message::{FrameParameters, PROBES};

use crate::gather::GatherRequest;
use crate::sampler::{Dimension, Pattern};
use crate::scene::SceneImage;

/// Length of a shadow ray divided by the distance of its light: below 1, so that rounding does not let the
/// ray hit the light itself.
const SHORTER: f32 = 1.0 - 8.0 * f32::EPSILON;

/// Arguments of every pass: scene, memory, frame parameters and counters.
pub struct Context<'a, M> {
    /// Scene data in card memory (card image).
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// Frame parameters.
    pub frame: &'a FrameParameters,
    /// Counters of the tile.
    pub counters: &'a mut Counters,
}

/// Arguments of a chip's work that are common to all of its tiles.
pub struct RenderJob<'a, M> {
    /// Scene data in card memory (card image).
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// Frame parameters.
    pub frame: &'a FrameParameters,
    /// Receiver of the gathers of pixels; `None` if the chip executes them itself.
    pub outlet: Option<&'a mut dyn GatherOutlet>,
}

impl<M> RenderJob<'_, M> {
    /// Arguments for a pass of the tile to which `counters` belong.
    #[inline(always)]
    pub fn context<'b>(&'b mut self, counters: &'b mut Counters) -> Context<'b, M> {
        Context { scene: self.scene, memory: self.memory, frame: self.frame, counters }
    }

    /// Arguments for a pass of a tile, and the receiver of its gathers.
    #[inline(always)]
    pub(crate) fn context_and_outlet<'b>(
        &'b mut self,
        counters: &'b mut Counters,
    ) -> (Context<'b, M>, Option<&'b mut dyn GatherOutlet>) {
        let Self { scene, memory, frame, outlet } = self;
        let outlet = outlet.as_deref_mut().map(|outlet| outlet as &mut dyn GatherOutlet);
        (Context { scene, memory, frame, counters }, outlet)
    }
}

/// Receiver of the gathers of pixels: a host that has memory for the gathers of a whole frame
/// (`--order hilbert`).
pub trait GatherOutlet {
    /// Takes a gather of the pixel with the row-major index `pixel` in its tile.
    fn take(&mut self, pixel: u32, request: GatherRequest);
}

/// Identity of a path of a pixel, from which the path's random numbers are derived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelSample {
    /// Column of the pixel in the whole picture.
    pub x: u32,
    /// Row of the pixel in the whole picture.
    pub y: u32,
    /// Index of the path in the pixel. It equals the index of the sample unless samples have several paths
    /// (adaptive sampling).
    pub sample: u32,
}

impl PixelSample {
    /// Pattern that is stratified over the pixel's paths, and the index of this path in the pattern. With
    /// adaptive sampling, probes have a pattern of their own: in a common pattern, later points would fill
    /// the strata that the probes left free, so that their mean would depend on the probes.
    #[inline(always)]
    pub fn stratified(self, frame: &FrameParameters, dimension: Dimension) -> (Pattern, u32) {
        let Self { x, y, sample } = self;
        let pattern = |number| Pattern::new(frame.seed, x, y, number, dimension);
        match sample.checked_sub(PROBES) {
            Some(index) if frame.adaptive_threshold.is_some() => (pattern(1), index),
            _ => (pattern(0), sample),
        }
    }
}
