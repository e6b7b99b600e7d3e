//! The record of a waiting gather: place, partially evaluated reflection, pixel.

use super::Place;
use crate::scene::PartialReflection;

/// A gather of photons at a place, reflected into a gather point's sum; 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherRequest {
    /// The place.
    pub place: Place,
    /// The reflection, times the gather ray's weight, from photon power units to radiance units.
    pub reflection: PartialReflection,
    /// Number of the gather point on the chip whose sum takes the result.
    pub target: u16,
    /// Cell of the hemisphere above the gather point that the ray went through.
    pub cell: u8,
}

const _: () = assert!(size_of::<GatherRequest>() == 24);
