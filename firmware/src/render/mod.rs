//! Passes of a tile, each a function of one pixel or one ray: eye ray, direct light, caustics, final gather.

pub mod caustic;
pub mod direct;
pub mod eye;
pub mod final_gather;
mod pixel_filter;
mod point;
mod search;
pub mod specular_path;

pub use point::{GatherPoint, Purpose};

use photoncard_shared::counters::Counters;
use photoncard_shared::message::FrameParameters;

use crate::gather::GatherRequest;
use crate::scene::SceneImage;

/// Length of a shadow ray over the distance of its light: it ends before the emitter's surface, whatever the rounding.
const SHORTER: f32 = 1.0 - 8.0 * f32::EPSILON;

/// Arguments of every pass: scene, memory, frame parameters and counters.
pub struct Context<'a, M> {
    /// Sections of the card image.
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// Frame parameters.
    pub frame: &'a FrameParameters,
    /// Counters of the tile.
    pub counters: &'a mut Counters,
    /// Receiver of the pixels' gathers, if the chip does not execute them itself.
    pub outlet: Option<&'a mut dyn GatherOutlet>,
}

/// Receiver of gathers of pixels: a host with memory for the gathers of a whole frame (`--order hilbert`).
pub trait GatherOutlet {
    /// Takes a gather; its target is the pixel's index in the tile.
    fn take(&mut self, request: GatherRequest);
}

/// One sample of one pixel, on which random numbers depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelSample {
    /// Column of the pixel in the whole picture.
    pub x: u32,
    /// Row of the pixel in the whole picture.
    pub y: u32,
    /// Index of the sample in the pixel.
    pub sample: u32,
}
