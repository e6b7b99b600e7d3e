//! Error of indirect light against a reference with many more gather rays.
//!
//! Sampling, the number of gather rays, the irradiance cache and precomputed irradiance change pixels. The
//! order of gathers, the size of tiles, the layout of the photon map and the caches do not change them. Only
//! the light that gather rays bring from the photon map is compared:
//!
//! ```text
//! L_indirect(x, w) = integral of f(x, w', w) L_map(y, -w') cos(theta') dw'
//! ```
//!
//! where `y` is the surface point that the ray from `x` in the direction `w'` hits, and `L_map` is the
//! radiance at `y` estimated from photons. Direct light is excluded, because shadow rays add noise to it, and
//! because gather rays and irradiance records contribute parts of it that depend on the number of rays. The
//! renders therefore use a card image without emission, so that their layer of indirect light is `L_indirect`
//! for every technique.

use photoncard_cards::scheduler::{GatherOrder, tiles};
use photoncard_map::photon_map::MappedImage;
use photoncard_picture::sums::{FilmPixel, SumFormat};
use photoncard_render::emulator::EmulatedKind;
use photoncard_render::emulator::direct::RenderedTile;
use photoncard_render::{RenderError, RenderSettings, Schedule};
use photoncard_shared::message::{Radiance, Sampling, Tile};
use serde::{Deserialize, Serialize};

use super::measure::Bench;
use super::sample::choose;

/// Error of indirect light in the pixels of one tile, as sums over pixels and channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TileDeviation {
    /// Number of pixels that were compared.
    pub pixels: usize,
    /// Sum of squared differences from the reference.
    pub squares: f64,
    /// Estimate of the part of [`Self::squares`] that is caused by the noise of the reference; it is
    /// unbiased.
    pub noise: f64,
    /// Sum of the pixels' channels.
    pub sum: f64,
    /// Sum of the reference's channels.
    pub reference: f64,
}

/// Error of a render's indirect light, compared with the indirect light of a reference with many gather rays.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Errors by tile. All pixels have equal weight.
    pub tiles: Vec<TileDeviation>,
}

impl Quality {
    /// Root mean square error over pixels and channels, divided by the reference's mean. The reference's
    /// estimated noise is subtracted from the squared differences; the error is 0 if the noise is greater.
    pub fn rmse(&self) -> f64 {
        let TileDeviation { squares, noise, .. } = self.total();
        self.relative((squares - noise).max(0.0))
    }

    /// Root mean square of the reference's noise, divided by the reference's mean.
    pub(crate) fn reference_noise(&self) -> f64 {
        self.relative(self.total().noise)
    }

    /// Mean of the pixels divided by the mean of the reference; 1 without bias.
    pub fn mean(&self) -> f64 {
        let TileDeviation { sum, reference, .. } = self.total();
        sum / reference
    }

    /// Returns the errors of all tiles except the tile with index `tile`.
    #[must_use]
    pub(crate) fn without(&self, tile: usize) -> Self {
        let others = self.tiles.iter().enumerate().filter(|(index, _)| *index != tile);
        Self { tiles: others.map(|(_, error)| *error).collect() }
    }

    /// Adds the errors of renders of the same tiles, such as those with several seeds, tile by tile.
    #[must_use]
    pub(crate) fn pooled<'a>(renders: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut pooled = Self::default();
        for Self { tiles } in renders {
            pooled.tiles.resize(tiles.len(), TileDeviation::default());
            for (sum, tile) in pooled.tiles.iter_mut().zip(tiles) {
                *sum = sum.plus(tile);
            }
        }
        pooled
    }

    fn total(&self) -> TileDeviation {
        self.tiles.iter().fold(TileDeviation::default(), TileDeviation::plus)
    }

    fn relative(&self, squares: f64) -> f64 {
        let TileDeviation { pixels, reference, .. } = self.total();
        let channels = 3.0 * pixels as f64;
        (squares / channels).sqrt() / (reference / channels)
    }
}

impl TileDeviation {
    fn plus(self, other: &Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            squares: self.squares + other.squares,
            noise: self.noise + other.noise,
            sum: self.sum + other.sum,
            reference: self.reference + other.reference,
        }
    }
}

/// Side of the tiles that are compared, pixels.
const TILE: u32 = 16;

struct ReferencePixel {
    /// Indirect light, W/(sr m^2).
    light: [f64; 3],
    /// Estimated variance of the light, summed over the channels.
    noise: f64,
}

/// Reference picture of indirect light with many gather rays. Pixels that show an emitter or no lit surface
/// are excluded.
///
/// It is the mean, weighted by rays, of two renders with `n` and `m` rays and different strata. If their
/// errors are independent and their variances are `v / n` and `v / m`, the squared difference of the two is
/// `v (1 / n + 1 / m)` on average, and the variance of their mean is `v / (n + m)`.
pub(crate) struct Reference {
    /// Settings with which the reference was rendered.
    settings: RenderSettings,
    /// Pixels of each tile; `None` for an excluded pixel.
    tiles: Vec<Vec<Option<ReferencePixel>>>,
}

/// Numbers of rays of the two renders of a reference with `rays` rays in total. They are unequal, so that the
/// two renders have different strata.
fn halves(rays: u32) -> [u32; 2] {
    let first = 3 * rays / 8;
    [first, rays - first].map(|rays| rays.max(1))
}

impl Reference {
    /// Renders `tiles` tiles with `rays` gather rays per pixel, combined sampling, no irradiance cache, and
    /// density estimates instead of precomputed radiance. Eye rays are those of `settings`.
    ///
    /// # Errors
    /// If the settings' camera is not possible in the scene, the card image is malformed, or the bench is
    /// stopped.
    pub(crate) fn new(
        bench: &Bench,
        settings: &RenderSettings,
        tiles: usize,
        rays: u32,
    ) -> Result<Self, RenderError> {
        let settings = Self::settings(settings, rays);
        // Without gather rays and shadow rays a picture shows emission alone.
        let emitters = settings.clone().with(|s| s.integrator.gather_rays = 0);
        let emission = emitted(bench, &emitters, tiles)?;
        let rays = halves(rays);
        let [first, second] = rays
            .map(|rays| indirect(bench, &settings.clone().with(|s| s.integrator.gather_rays = rays), tiles));
        let rendered = first?.into_iter().zip(second?).zip(emission);
        let tiles = rendered.map(|((first, second), emission)| {
            let pixels = first.into_iter().zip(second).zip(emission);
            let of_pixel = |((first, second), emission)| {
                let pixel = ReferencePixel::new([first, second], rays);
                let is_lit = pixel.light != [0.0; 3] && emission == [0.0; 3];
                is_lit.then_some(pixel)
            };
            pixels.map(of_pixel).collect()
        });
        Ok(Self { tiles: tiles.collect(), settings })
    }

    /// Returns whether [`Self::new`] would create an equal reference from photons of the same scene.
    pub(crate) fn is_of(&self, settings: &RenderSettings, tiles: usize, rays: u32) -> bool {
        self.tiles.len() == tiles && self.settings == Self::settings(settings, rays)
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

    /// Renders the reference's tiles with `settings`. Returns their error.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn compare(&self, bench: &Bench, settings: &RenderSettings) -> Result<Quality, RenderError> {
        let rendered = indirect(bench, &comparable(settings), self.tiles.len())?;
        let tiles = self.tiles.iter().zip(rendered);
        Ok(Quality { tiles: tiles.map(|(reference, pixels)| error(reference, &pixels)).collect() })
    }
}

impl ReferencePixel {
    /// Creates a pixel from its light in two renders: the mean of `lights`, weighted by the numbers of rays
    /// `rays`, and the estimated variance of this mean.
    fn new(lights: [[f64; 3]; 2], rays: [u32; 2]) -> Self {
        let [first, second] = lights;
        let share = f64::from(rays[0]) / f64::from(rays[0] + rays[1]);
        let light = [0, 1, 2].map(|i| share * first[i] + (1.0 - share) * second[i]);
        let difference: f64 = first.iter().zip(second).map(|(first, second)| (first - second).powi(2)).sum();
        Self { light, noise: share * (1.0 - share) * difference }
    }
}

fn error(reference: &[Option<ReferencePixel>], pixels: &[[f64; 3]]) -> TileDeviation {
    let mut error = TileDeviation::default();
    for (reference, pixel) in reference.iter().zip(pixels) {
        let Some(ReferencePixel { light, noise }) = reference else { continue };
        error.pixels += 1;
        error.noise += noise;
        for (reference, value) in light.iter().zip(pixel) {
            error.squares += (value - reference).powi(2);
            error.sum += value;
            error.reference += reference;
        }
    }
    error
}

/// Returns `settings` with fixed values for the settings that do not change indirect light: tiles of 16x16
/// pixels, sorted gathers with the chip's own queue, no shadow rays, and photon gathers at the ends of all
/// gather rays.
fn comparable(settings: &RenderSettings) -> RenderSettings {
    let mut comparable = RenderSettings {
        schedule: Schedule {
            tile: Some(TILE),
            order: GatherOrder::Sort,
            bins: None,
            queue: None,
            in_flight: None,
            focus: None,
            part: None,
            keep_records: false,
        },
        ..settings.clone()
    };
    comparable.integrator.shadow_rays = 0;
    // The indirect light at near ends would need the emission that [`indirect`] takes away.
    comparable.integrator.near_distance = Some(0.0);
    comparable
}

/// Colours of the pixels by tile, W/(sr m^2).
type TilePixels = Vec<Vec<[f64; 3]>>;

/// Indirect light in `count` tiles, rendered from a card image that has the scene's photons but no emission.
fn indirect(bench: &Bench, settings: &RenderSettings, count: usize) -> Result<TilePixels, RenderError> {
    let MappedImage { image, gathers, paths, guiding, times } = bench.mapped;
    let image = image.without_emission();
    let dark = MappedImage { image, gathers: *gathers, paths: *paths, guiding: *guiding, times: *times };
    let bench = Bench { mapped: &dark, ..*bench };
    pixels(&bench, settings, true, count, |pixel| pixel.layers.indirect)
}

/// Visible emission in `count` tiles, rendered without gather rays and shadow rays.
fn emitted(bench: &Bench, settings: &RenderSettings, count: usize) -> Result<TilePixels, RenderError> {
    pixels(bench, settings, false, count, |pixel| pixel.pixel.radiance)
}

/// Renders `count` tiles, and returns the colour that `light` selects from the values of each pixel. `layers`
/// states whether the frame has layers.
fn pixels(
    bench: &Bench,
    settings: &RenderSettings,
    layers: bool,
    count: usize,
    light: impl Fn(&FilmPixel) -> [f32; 3],
) -> Result<TilePixels, RenderError> {
    let mut frame = bench.frame(settings)?;
    frame.layers = layers;
    let chosen = choose(&tiles(settings.window(), TILE, settings.schedule.order), count);
    let chosen: Vec<Tile> = chosen.into_iter().map(|chosen| chosen.tile).collect();
    let format = SumFormat::new(&bench.mapped.image.view().0.header, &frame);
    let rendered = bench.render(EmulatedKind::Reference, &frame, &chosen, None)?;
    let of_tile =
        |tile: &RenderedTile| tile.pixels(format).map(|pixel| light(&pixel).map(f64::from)).collect();
    Ok(rendered.iter().map(of_tile).collect())
}

#[cfg(test)]
mod tests {
    use rayon::{ThreadPool, ThreadPoolBuilder};

    use photoncard_map::pack::PackedScene;
    use photoncard_map::photon_map::map_photons;
    use photoncard_render::{Integrator, PhotonMaps, Picture};
    use photoncard_scene::{Scene, gltf};

    use super::*;

    /// A small picture of the Cornell box.
    struct Room {
        scene: Scene,
        mapped: MappedImage,
        pool: ThreadPool,
        settings: RenderSettings,
    }

    impl Room {
        fn new() -> Self {
            let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/cornell.gltf");
            let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
            let settings = RenderSettings {
                picture: Picture { width: 32, height: 32, ..Picture::default() },
                photons: PhotonMaps { count: 10_000, neighbors: 30, ..PhotonMaps::default() },
                integrator: Integrator { gather_rays: 16, near_distance: Some(0.0), ..Integrator::default() },
                ..RenderSettings::default()
            };
            let pool = ThreadPoolBuilder::new().num_threads(2).build();
            let pool = pool.expect("threads start");
            let packed = PackedScene::new(&scene).expect("packs");
            let mapped = map_photons(packed, &settings.photon_settings(&scene), &|_| true).expect("maps");
            Self { scene, mapped, pool, settings }
        }

        fn bench(&self) -> Bench<'_> {
            Bench { scene: &self.scene, mapped: &self.mapped, pool: &self.pool, is_stopped: &|| false }
        }
    }

    #[test]
    fn indirect_light_equals_the_layer_of_the_lit_scene_without_records() {
        let room = Room::new();
        let layer = |pixel: &FilmPixel| pixel.layers.indirect;
        let lit = pixels(&room.bench(), &room.settings, true, 4, layer).unwrap();
        let dark = indirect(&room.bench(), &comparable(&room.settings), 4).unwrap();
        assert!(dark.iter().flatten().any(|pixel| pixel.iter().all(|channel| *channel > 0.0)));
        assert!(lit == dark);
        let cached = room.settings.clone().with(|s| s.integrator.irradiance_error = Some(0.2));
        let [lit, dark] = [
            pixels(&room.bench(), &cached, true, 4, layer).unwrap(),
            indirect(&room.bench(), &comparable(&cached), 4).unwrap(),
        ];
        assert!(lit != dark, "records of a lit scene interpolate a share of its direct light");
    }

    #[test]
    fn error_falls_with_rays_and_excludes_the_noise_of_the_reference() {
        let room = Room::new();
        let error = |rays: u32, of_reference: u32| {
            let reference = Reference::new(&room.bench(), &room.settings, 4, of_reference).unwrap();
            let settings = room.settings.clone().with(|s| s.integrator.gather_rays = rays);
            reference.compare(&room.bench(), &settings).unwrap()
        };
        let [few, more] = [error(8, 512), error(64, 512)];
        assert!(more.rmse() < 0.5 * few.rmse(), "{} {}", few.rmse(), more.rmse());
        assert!((more.mean() - 1.0).abs() < 0.05, "{}", more.mean());
        // The noise of a noisier reference increases the squared differences, but not the RMSE.
        let rough = error(8, 48);
        assert!(rough.reference_noise() > 2.0 * few.reference_noise());
        assert!((rough.rmse() / few.rmse() - 1.0).abs() < 0.1, "{} {}", few.rmse(), rough.rmse());
    }

    #[test]
    fn a_tile_can_be_omitted_from_a_quality() {
        let tile = |squares| TileDeviation { pixels: 1, squares, noise: 1.0, sum: 2.0, reference: 3.0 };
        let quality = Quality { tiles: vec![tile(4.0), tile(13.0)] };
        assert_eq!(quality.without(1), Quality { tiles: vec![tile(4.0)] });
        assert!((quality.without(1).rmse() - 1.0).abs() < 1e-12);
        assert!((quality.rmse() - (15.0_f64 / 6.0).sqrt()).abs() < 1e-12);
        assert_eq!(Quality { tiles: vec![tile(0.5)] }.rmse(), 0.0);
        assert!((quality.mean() - 2.0 / 3.0).abs() < 1e-12);
    }
}
