//! Components of a pixel's light and its light groups, and their sums. A pixel has a sum for each component
//! in a frame with layers, and one for each group in a frame with light groups; otherwise it has a single
//! sum.
//!
//! A pixel's radiance is the sum of its components, and the sum of its groups. Fixed-point sums are exact, so
//! that both have the same bits. The sums of the components come first, then a count of gathers, then the
//! sums of the groups ([`PixelForm::sums_of_light`]).

use glam::Vec3;
use photoncard_shared::budget::{MAX_SUMS, SUMS_WITH_LAYERS};
use photoncard_shared::message::{FrameParameters, GroupSums, LayerSums, PixelForm, PixelSums};

use crate::fixed_point::ColourSum;
use crate::light_groups::{GroupedLight, LightGroups};

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

/// Index of the count of gathers among a pixel's sums.
const GATHERS: usize = Component::Caustic as usize + 1;
const _: () = assert!(GATHERS + 1 == SUMS_WITH_LAYERS as usize);

/// Adds light, in the card image's radiance units, to the sums of a pixel: to those of its component and of
/// its groups, or to the only one.
#[inline(always)]
pub fn add_light(
    frame: &FrameParameters,
    sums: &mut [ColourSum],
    component: Component,
    brought: &GroupedLight,
) {
    if let (PixelForm { layers: false, light_groups: 0, .. }, Some(sum)) = (frame.form(), sums.first_mut()) {
        sum.add_light(brought.of_group(0));
        return;
    }
    add_separate_light(frame, sums, component, brought);
}

/// Does [`add_light`] in a frame with layers or light groups.
#[inline(never)]
fn add_separate_light(
    frame: &FrameParameters,
    sums: &mut [ColourSum],
    component: Component,
    brought: &GroupedLight,
) {
    let layers = if frame.layers { SUMS_WITH_LAYERS as usize } else { 0 };
    let Some((of_layers, of_groups)) = sums.split_at_mut_checked(layers) else { return };
    let groups = LightGroups::of(frame);
    if let Some(sum) = of_layers.get_mut(component as usize) {
        brought.groups(groups).for_each(|light| sum.add_light(light));
    }
    if frame.light_groups > 0 {
        of_groups.iter_mut().zip(brought.groups(groups)).for_each(|(sum, light)| sum.add_light(light));
    }
}

/// Sums of one pixel's light, in the card image's radiance units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelLight([ColourSum; MAX_SUMS as usize]);

impl PixelLight {
    pub(super) const NONE: Self = Self([ColourSum::ZERO; MAX_SUMS as usize]);

    /// Creates the light of a pixel from its stored sums, at most [`MAX_SUMS`]; missing sums are 0.
    pub(super) fn of(sums: &[ColourSum]) -> Self {
        let mut light = Self::NONE;
        light.0.iter_mut().zip(sums).for_each(|(sum, stored)| *sum = *stored);
        light
    }

    /// Adds light, in the card image's radiance units, to a component.
    #[inline]
    pub(super) fn add(&mut self, frame: &FrameParameters, component: Component, brought: &GroupedLight) {
        add_light(frame, &mut self.0, component, brought);
    }

    /// Counts a sample with a final gather, if the frame has layers.
    #[inline]
    pub(super) fn count_gather(&mut self, frame: &FrameParameters) {
        if let Some(sum) = self.0.get_mut(GATHERS).filter(|_| frame.layers) {
            sum.add_light(Vec3::X);
        }
    }

    /// Sums of the pixel, [`PixelForm::sums_of_light`] of them.
    pub fn sums(&self, frame: &FrameParameters) -> &[ColourSum] {
        self.0.get(..frame.form().sums_of_light() as usize).unwrap_or_default()
    }
}

/// Sums of a pixel as a card sends them, of `view` and these sums of light.
pub(super) fn with_light(view: PixelSums, form: PixelForm, light: &[ColourSum]) -> PixelSums {
    let mut sums = view;
    let mut of_groups = light;
    if form.layers
        && let Some(([direct, indirect, caustic, gathers], rest)) = light.split_first_chunk()
    {
        let [direct, indirect, caustic] = [direct, indirect, caustic].map(ColourSum::bits);
        sums = sums.with_layers(LayerSums { direct, indirect, caustic, gathers: gathers.value().x as u32 });
        of_groups = rest;
    }
    match form {
        PixelForm { light_groups: 1.., .. } => {
            sums.with_light_groups(GroupSums::new(of_groups.iter().map(ColourSum::bits)))
        }
        PixelForm { layers: true, .. } => sums,
        _ => sums.with_light(light.first().map_or([0; 3], ColourSum::bits)),
    }
}
