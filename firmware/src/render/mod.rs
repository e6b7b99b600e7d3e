//! The passes of a tile, each a function of one pixel or one ray.

pub mod caustic;
pub mod direct;
pub mod eye;
pub mod final_gather;
mod point;
mod search;
pub mod specular_path;

pub use point::{GatherPoint, Purpose};

use photoncard_shared::counters::Counters;
use photoncard_shared::message::FrameParameters;

use crate::gather::GatherRequest;
use crate::scene::SceneImage;

/// Context of a pass: the scene in its memory, the frame, and the counters.
pub struct Context<'a, M> {
    /// Where the records lie.
    pub scene: &'a SceneImage,
    /// Card memory.
    pub memory: &'a mut M,
    /// The frame's parameters.
    pub frame: &'a FrameParameters,
    /// What is counted.
    pub counters: &'a mut Counters,
    /// Who does the gathers of pixels, if it is not the chip.
    pub outlet: Option<&'a mut dyn GatherOutlet>,
}

/// Takes the gathers of pixels from a chip: a host that has room for those of a whole frame.
pub trait GatherOutlet {
    /// Takes a gather; its target is the pixel's number in the tile.
    fn take(&mut self, request: GatherRequest);
}

/// One sample of one pixel: what random numbers depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelSample {
    /// Column in the whole picture.
    pub x: u32,
    /// Row in the whole picture.
    pub y: u32,
    /// Number of the sample.
    pub sample: u32,
}
