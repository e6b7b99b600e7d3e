//! How far pixels are from what many more gather rays give.
//!
//! Only the sampling, the number of gather rays, the irradiance cache and precomputed irradiance change pixels; the order of the gathers, the
//! tiles, the layout of the photon map and the caches do not.

use photoncard_shared::message::{Radiance, Sampling, Tile};
use serde::{Deserialize, Serialize};

use super::measure::Bench;
use super::sample::choose;
use crate::render::{RenderError, RenderSettings};
use crate::scheduler::{GatherOrder, tiles};

/// The error of some pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Root of the mean square error over pixels and channels, over the reference's mean.
    pub rmse: f64,
    /// The pixels' mean over the reference's.
    pub mean: f64,
    /// Pixels compared.
    pub pixels: usize,
}

/// Side of the tiles that are compared, pixels.
const TILE: u32 = 16;

/// Pixels that show a lit surface and no emitter, each with the radiance that many rays give it.
pub struct Reference {
    /// What was rendered.
    settings: RenderSettings,
    tiles: usize,
    /// Radiance, W/(sr m^2); `None` for a pixel that is left out.
    pixels: Vec<Option<[f32; 3]>>,
}

impl Reference {
    /// Renders some tiles with so many gather rays by the combined sampling, without the irradiance cache and with radiance by density. Eye rays and
    /// the places that shadow rays go to are those of `settings`.
    ///
    /// # Errors
    /// If the scene has no such camera, the image is not sound, or it is stopped.
    pub fn new(
        bench: &Bench,
        settings: &RenderSettings,
        tiles: usize,
        rays: u32,
    ) -> Result<Self, RenderError> {
        let settings = Self::settings(settings, rays);
        // Without any other ray all that is seen is emission.
        let emitters = RenderSettings { gather_rays: 0, shadow_rays: 0, ..settings.clone() };
        let emission = pixels(bench, &emitters, tiles)?;
        let radiance = pixels(bench, &settings, tiles)?;
        let kept = radiance.into_iter().zip(emission).map(|(pixel, emission)| {
            let is_lit = pixel != [0.0; 3] && emission == [0.0; 3];
            is_lit.then_some(pixel)
        });
        Ok(Self { pixels: kept.collect(), settings, tiles })
    }

    /// Whether it is the reference that [`Self::new`] would make of the same image.
    pub fn is_of(&self, settings: &RenderSettings, tiles: usize, rays: u32) -> bool {
        self.tiles == tiles && self.settings == Self::settings(settings, rays)
    }

    /// What a render is compared with; the layout of the map does not change it.
    fn settings(settings: &RenderSettings, rays: u32) -> RenderSettings {
        RenderSettings {
            gather_rays: rays,
            sampling: Sampling::Product,
            irradiance_error: None,
            radiance: Radiance::Density,
            ..comparable(settings)
        }
    }

    /// The error of a render of the same tiles.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn compare(&self, bench: &Bench, settings: &RenderSettings) -> Result<Quality, RenderError> {
        let rendered = pixels(bench, &comparable(settings), self.tiles)?;
        let (mut squares, mut sum, mut reference_sum, mut count) = (0.0, 0.0, 0.0, 0);
        for (reference, pixel) in self.pixels.iter().zip(rendered) {
            let Some(reference) = reference else { continue };
            for (&reference, value) in reference.iter().zip(pixel) {
                squares += (f64::from(value) - f64::from(reference)).powi(2);
                sum += f64::from(value);
                reference_sum += f64::from(reference);
            }
            count += 1;
        }
        let channels = (3 * count) as f64;
        let rmse = (squares / channels).sqrt() / (reference_sum / channels);
        Ok(Quality { rmse, mean: sum / reference_sum, pixels: count })
    }
}

/// The settings that make a pixel, in the order that is rendered fastest.
fn comparable(settings: &RenderSettings) -> RenderSettings {
    RenderSettings { tile: TILE, order: GatherOrder::Sort, bins: None, queue: None, ..settings.clone() }
}

/// Radiances of the pixels of some tiles.
fn pixels(bench: &Bench, settings: &RenderSettings, count: usize) -> Result<Vec<[f32; 3]>, RenderError> {
    let frame = bench.frame(settings)?;
    let chosen = choose(&tiles(settings.window(), TILE, settings.order), count);
    let chosen: Vec<Tile> = chosen.into_iter().map(|chosen| chosen.tile).collect();
    let unit = bench.mapped.image.view().0.header.radiance_unit;
    let rendered = bench.render(&frame, &chosen, &|memory| memory)?;
    let sums = rendered.iter().flat_map(|tile| &tile.sums);
    Ok(sums.map(|sum| (sum.value() * unit).to_array()).collect())
}
