//! A gather that waits: its place, what of its reflection is known before any photon is, and its pixel.

use super::Place;
use crate::scene::PartialReflection;

/// A gather: where, how the photons found there are reflected, and whose sum the result goes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherRequest {
    /// The place.
    pub place: Place,
    /// The reflection, times the gather ray's weight, from photon power units to radiance units.
    pub reflection: PartialReflection,
    /// Whose sum it is: the number of a gather point on the chip.
    pub target: u16,
    /// The cell of the hemisphere above the gather point that the ray went through.
    pub cell: u8,
}

const _: () = assert!(size_of::<GatherRequest>() == 24);
