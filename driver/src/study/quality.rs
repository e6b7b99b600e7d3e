//! Error of pixels against a reference with many more gather rays.
//!
//! Only the sampling, the number of gather rays, the irradiance cache and precomputed irradiance change pixels; the
//! order of the gathers, the tiles, the layout of the photon map and the caches do not.

use photoncard_firmware::kind;
use photoncard_shared::message::{Radiance, Sampling, Tile};
use serde::{Deserialize, Serialize};

use super::measure::Bench;
use super::sample::choose;
use crate::render::{RenderError, RenderSettings, Schedule};
use crate::scheduler::{GatherOrder, tiles};

/// Error of a render's pixels against a [`Reference`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Root mean square error over pixels and channels, relative to the reference's mean.
    pub rmse: f64,
    /// Mean of the pixels over the mean of the reference; 1 without bias.
    pub mean: f64,
    /// Number of pixels compared.
    pub pixels: usize,
}

/// Side of the tiles that are compared, pixels.
const TILE: u32 = 16;

/// Reference picture by many gather rays, of the pixels that show a lit surface and no emitter.
pub struct Reference {
    /// Settings of the reference render.
    settings: RenderSettings,
    tiles: usize,
    /// Radiance, W/(sr m^2); `None` for a pixel that is left out.
    pixels: Vec<Option<[f32; 3]>>,
}

impl Reference {
    /// Renders `tiles` tiles with `rays` gather rays per pixel by combined sampling, without the irradiance cache, and
    /// with radiance by density estimation. Eye rays and shadow rays are those of `settings`.
    ///
    /// # Errors
    /// If the scene has no camera of the settings' name, the card image is malformed, or the bench is stopped.
    pub fn new(
        bench: &Bench,
        settings: &RenderSettings,
        tiles: usize,
        rays: u32,
    ) -> Result<Self, RenderError> {
        let settings = Self::settings(settings, rays);
        // Eye rays alone see emission and nothing else.
        let emitters = settings.clone().with(|s| {
            s.integrator.gather_rays = 0;
            s.integrator.shadow_rays = 0;
        });
        let emission = pixels(bench, &emitters, tiles)?;
        let radiance = pixels(bench, &settings, tiles)?;
        let kept = radiance.into_iter().zip(emission).map(|(pixel, emission)| {
            let is_lit = pixel != [0.0; 3] && emission == [0.0; 3];
            is_lit.then_some(pixel)
        });
        Ok(Self { pixels: kept.collect(), settings, tiles })
    }

    /// Returns whether [`Self::new`] would make this reference from the same card image.
    pub fn is_of(&self, settings: &RenderSettings, tiles: usize, rays: u32) -> bool {
        self.tiles == tiles && self.settings == Self::settings(settings, rays)
    }

    /// Settings of the reference for a render with `settings`.
    fn settings(settings: &RenderSettings, rays: u32) -> RenderSettings {
        comparable(settings).with(|s| {
            s.photons.radiance = Radiance::Density;
            s.integrator.gather_rays = rays;
            s.integrator.sampling = Sampling::Product;
            s.integrator.irradiance_error = None;
        })
    }

    /// Renders the reference's tiles with `settings`, and returns their error.
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

/// `settings` with tiles, order and queues replaced, which do not change pixels: the fastest order.
fn comparable(settings: &RenderSettings) -> RenderSettings {
    RenderSettings {
        schedule: Schedule {
            tile: Some(TILE),
            order: GatherOrder::Sort,
            bins: None,
            queue: None,
            in_flight: None,
        },
        ..settings.clone()
    }
}

/// Radiances of the pixels of `count` tiles, W/(sr m^2).
fn pixels(bench: &Bench, settings: &RenderSettings, count: usize) -> Result<Vec<[f32; 3]>, RenderError> {
    let frame = bench.frame(settings)?;
    let chosen = choose(&tiles(settings.window(), TILE, settings.schedule.order), count);
    let chosen: Vec<Tile> = chosen.into_iter().map(|chosen| chosen.tile).collect();
    let unit = bench.mapped.image.view().0.header.radiance_unit;
    let rendered = bench.render::<kind::Reference, _>(&frame, &chosen, &|memory| memory)?;
    let sums = rendered.iter().flat_map(|tile| &tile.sums);
    Ok(sums.map(|sum| (sum.value() * unit).to_array()).collect())
}
