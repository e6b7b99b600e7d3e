//! Sums of a tile's pixels: one for each pixel, or with layers one for each component of its light.
//!
//! Fixed-point sums are exact, so that layers do not change a bit of a pixel's radiance: it is the sum of the
//! components. With layers a pixel takes [`SUMS_WITH_LAYERS`] sums of the buffer, the last of which counts gathers, and
//! a tile has at most a fourth of the pixels.

use glam::Vec3;
use photoncard_shared::budget::{SUMS_WITH_LAYERS, sums_of_pixel};
use photoncard_shared::message::{FrameParameters, PixelLayers};

use crate::fixed_point::ColourSum;

/// Component of a pixel's light; light paths are in the notation of the crate's page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// `L S* E` and `L D S* E`: visible emission, and direct light by shadow rays and by the pixel's own gather rays.
    Direct,
    /// `L (S|D)* D S* D S* E`: radiance estimates at the ends of gather rays, and interpolated irradiance, which
    /// includes the emission met by the irradiance records' rays.
    Indirect,
    /// `L S+ D S* E`: radiance estimates in the caustic map.
    Caustic,
}

impl Component {
    /// Index of the component's sum of a pixel, among the tile's sums.
    #[inline(always)]
    pub fn sum_of(self, frame: &FrameParameters, pixel: usize) -> usize {
        if frame.layers { pixel * SUMS_WITH_LAYERS as usize + self as usize } else { pixel }
    }
}

/// Index, among a pixel's sums, of its count of gathers.
const GATHERS: usize = Component::Caustic as usize + 1;
const _: () = assert!(GATHERS + 1 == SUMS_WITH_LAYERS as usize);

/// Adds light, in the image's radiance units, to a component of pixel `target`.
#[inline]
pub(super) fn add_light(
    sums: &mut [ColourSum],
    frame: &FrameParameters,
    target: u16,
    component: Component,
    brought: Vec3,
) {
    if let Some(sum) = sums.get_mut(component.sum_of(frame, target.into())) {
        sum.add_light(brought);
    }
}

/// Counts a sample of a pixel with a final gather of its own, if the frame has layers.
#[inline]
pub(super) fn count_gather(sums: &mut [ColourSum], frame: &FrameParameters, pixel: usize) {
    if let Some(sum) = sums.get_mut(pixel * SUMS_WITH_LAYERS as usize + GATHERS).filter(|_| frame.layers) {
        sum.add_light(Vec3::X);
    }
}

/// Sums of one pixel of a tile; empty past the last pixel.
pub(super) fn sums_of<'a>(sums: &'a [ColourSum], frame: &FrameParameters, pixel: usize) -> &'a [ColourSum] {
    let count = sums_of_pixel(frame.layers) as usize;
    sums.get(pixel * count..(pixel + 1) * count).unwrap_or_default()
}

/// Radiance of a pixel, and its layers if the frame has any, from its sums; in the image's radiance units.
pub fn light_of(sums: &[ColourSum]) -> (Vec3, Option<PixelLayers>) {
    match sums {
        [direct, indirect, caustic, gathers] => {
            let mut all = *direct;
            all.add_sum(indirect);
            all.add_sum(caustic);
            let [direct, indirect, caustic] = [direct, indirect, caustic].map(|sum| sum.value().to_array());
            (all.value(), Some(PixelLayers { direct, indirect, caustic, gathers: gathers.value().x }))
        }
        _ => (sums.first().map_or(Vec3::ZERO, ColourSum::value), None),
    }
}
