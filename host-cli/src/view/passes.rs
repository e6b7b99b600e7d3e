//! Settings of coarse and full passes.

use photoncard_driver::render::{Filter, Integrator, RenderSettings, Sampling};

/// Maximum number of pixels of a coarse picture that gathers at each pixel. Above it, interpolation of
/// irradiance is faster.
const FEW_PIXELS: u64 = 1 << 12;
/// Gather rays per pixel and per irradiance record, in coarse pictures.
const RAYS: [u32; 2] = [6, 16];
/// Maximum relative error of interpolated irradiance in coarse pictures.
const IRRADIANCE_ERROR: f32 = 1.0;

/// Settings of a coarse picture with one pixel for each square of `step` x `step`. The photon maps are those
/// of the settled picture, so that none is traced again. Rays follow the reflection alone, which for few rays
/// is faster than to search photons for a table of directions.
pub(super) fn coarse(settings: &RenderSettings, step: u32) -> RenderSettings {
    settings.clone().with(|settings| {
        let picture = &mut settings.picture;
        let Integrator { gather_rays, shadow_rays, irradiance_error, .. } = settings.integrator;
        [picture.width, picture.height] = [picture.width, picture.height].map(|side| side.div_ceil(step));
        let is_small = u64::from(picture.width) * u64::from(picture.height) <= FEW_PIXELS;
        picture.filter = Filter::Box;
        let [of_pixel, of_record] = RAYS.map(|rays| rays.min(gather_rays));
        let error = irradiance_error.unwrap_or(IRRADIANCE_ERROR).max(IRRADIANCE_ERROR);
        settings.integrator = Integrator {
            samples: 1,
            gather_rays: if is_small { of_pixel } else { of_record },
            shadow_rays: shadow_rays.min(1),
            sampling: Sampling::Reflection,
            irradiance_error: (!is_small && gather_rays > 0).then_some(error),
            adaptive_threshold: None,
            ..settings.integrator
        };
        settings.cards.verify = None;
    })
}

/// Settings of the settled picture. Tiles near `focus` come first.
pub(super) fn full(settings: &RenderSettings, focus: Option<[u32; 2]>) -> RenderSettings {
    settings.clone().with(|settings| {
        let middle = [settings.picture.width / 2, settings.picture.height / 2];
        settings.schedule.focus = Some(focus.unwrap_or(middle));
    })
}
