//! The record of a waiting gather: position, partial reflection, pixel.

use super::HilbertCode;
use crate::scene::PartialReflection;

/// Gather of photons at a position, whose radiance is added to a gather point's sum; 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherRequest {
    /// Position, on the photons' grid.
    pub position: HilbertCode,
    /// Partial reflection times the gather ray's weight, from photon power units to radiance units.
    pub reflection: PartialReflection,
    /// Index of the gather point whose sum takes the result.
    pub target: u16,
    /// Cell of the gather point's hemisphere with the ray's direction.
    pub cell: u8,
}

const _: () = assert!(size_of::<GatherRequest>() == 24);
