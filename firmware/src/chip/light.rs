//! Components of a pixel's light, and their sums. In a frame with layers, a pixel has a sum for each
//! component; otherwise it has a single sum.
//!
//! A pixel's radiance is the sum of its components. Fixed-point sums are exact, so that this radiance has the
//! same bits with and without layers. With layers a pixel has [`SUMS_WITH_LAYERS`] sums, the last of which
//! counts gathers.

use glam::Vec3;
use photoncard_shared::budget::{SUMS_WITH_LAYERS, sums_of_pixel};
use photoncard_shared::message::FrameParameters;

use crate::fixed_point::ColourSum;

/// Component of a pixel's light. Light paths are in the notation of [the crate's documentation](crate).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// Paths `L S* E` and `L D S* E`: visible emission, and direct light found by shadow rays and by the
    /// pixel's own gather rays.
    Direct,
    /// Paths `L (S|D)* D S* D S* E`: radiance estimates at the ends of gather rays, and interpolated
    /// irradiance. Interpolated irradiance includes emission that gather rays of irradiance records hit.
    Indirect,
    /// Paths `L S+ D S* E`: radiance estimates in the caustic map.
    Caustic,
}

impl Component {
    /// Index of this component's sum for pixel number `pixel`, in an array of the sums of consecutive pixels.
    /// Without layers, all components of a pixel share one sum.
    #[inline(always)]
    pub fn sum_of(self, frame: &FrameParameters, pixel: usize) -> usize {
        if frame.layers { pixel * SUMS_WITH_LAYERS as usize + self as usize } else { pixel }
    }
}

/// Index of the count of gathers among a pixel's sums.
const GATHERS: usize = Component::Caustic as usize + 1;
const _: () = assert!(GATHERS + 1 == SUMS_WITH_LAYERS as usize);

/// Sums of one pixel's light, in the card image's radiance units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelLight([ColourSum; SUMS_WITH_LAYERS as usize]);

impl PixelLight {
    pub(super) const NONE: Self = Self([ColourSum::ZERO; SUMS_WITH_LAYERS as usize]);

    /// Creates the light of a pixel from its stored sums, at most [`SUMS_WITH_LAYERS`]; missing sums are 0.
    pub(super) fn of(sums: &[ColourSum]) -> Self {
        let mut light = Self::NONE;
        light.0.iter_mut().zip(sums).for_each(|(sum, stored)| *sum = *stored);
        light
    }

    /// Adds light, in the card image's radiance units, to a component.
    #[inline]
    pub(super) fn add(&mut self, frame: &FrameParameters, component: Component, brought: Vec3) {
        if let Some(sum) = self.0.get_mut(component.sum_of(frame, 0)) {
            sum.add_light(brought);
        }
    }

    /// Counts a sample with a final gather, if the frame has layers.
    #[inline]
    pub(super) fn count_gather(&mut self, frame: &FrameParameters) {
        if let Some(sum) = self.0.get_mut(GATHERS).filter(|_| frame.layers) {
            sum.add_light(Vec3::X);
        }
    }

    /// Sums of the pixel: one or, in a frame with layers, [`SUMS_WITH_LAYERS`].
    pub fn sums(&self, frame: &FrameParameters) -> &[ColourSum] {
        self.0.get(..sums_of_pixel(frame.layers) as usize).unwrap_or_default()
    }
}
