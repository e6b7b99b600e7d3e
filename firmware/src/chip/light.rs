//! The light of a tile's pixels: a sum each, or with layers one of each component.
//!
//! Both ways the same terms are added in fixed point, so that a pixel's radiance is the same bit for bit: the sum of its
//! components is exact. With layers a pixel takes [`SUMS_WITH_LAYERS`] sums of the same buffer, of which the last counts
//! gathers, and a tile has a fourth of the pixels at most.

use glam::Vec3;
use photoncard_shared::budget::{SUMS_WITH_LAYERS, sums_of_pixel};
use photoncard_shared::message::{FrameParameters, PixelLayers};

use crate::fixed_point::ColourSum;

/// What a term of a pixel's light is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// Emission that is seen, what shadow rays bring, and emission that gather rays of the pixel meet.
    Direct,
    /// What gathers of photons bring, and interpolated irradiance, of which emission that rays of records met is a part.
    Indirect,
    /// Light that comes through specular surfaces.
    Caustic,
}

impl Component {
    /// Which sum of a tile it is added to, for a pixel of the tile.
    #[inline(always)]
    pub fn sum_of(self, frame: &FrameParameters, pixel: usize) -> usize {
        if frame.layers { pixel * SUMS_WITH_LAYERS as usize + self as usize } else { pixel }
    }
}

/// Which sum counts the gathers of a pixel.
const GATHERS: usize = Component::Caustic as usize + 1;
const _: () = assert!(GATHERS + 1 == SUMS_WITH_LAYERS as usize);

/// Adds light to the pixel that it is for, in radiance units.
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

/// Counts a sample of a pixel that takes a final gather of its own, if the picture has layers.
#[inline]
pub(super) fn count_gather(sums: &mut [ColourSum], frame: &FrameParameters, pixel: usize) {
    if let Some(sum) = sums.get_mut(pixel * SUMS_WITH_LAYERS as usize + GATHERS).filter(|_| frame.layers) {
        sum.add_light(Vec3::X);
    }
}

/// The sums of one pixel of a tile; of none past the last pixel.
pub(super) fn sums_of<'a>(sums: &'a [ColourSum], frame: &FrameParameters, pixel: usize) -> &'a [ColourSum] {
    let count = sums_of_pixel(frame.layers) as usize;
    sums.get(pixel * count..(pixel + 1) * count).unwrap_or_default()
}

/// The light of a pixel, from its sums: its radiance, and with layers of what that consists. In the image's radiance units.
pub(super) fn light_of(sums: &[ColourSum]) -> (Vec3, Option<PixelLayers>) {
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
