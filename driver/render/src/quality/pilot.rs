//! Pilot renders: small tiles spread over the picture, rendered on emulated chips to measure noise.

use std::ops::RangeInclusive;

use glam::Vec3;
use photoncard_firmware::sampler::hash;
use photoncard_map::pack::{PackedScene, SourceRadiance};
use photoncard_map::photon;
use photoncard_map::photon_map::{
    GatherParameters, MappedImage, PhotonSettings, PhotonsFor, TracedPhotons, map_traced,
};
use photoncard_picture::film::Window;
use photoncard_picture::sums::SumFormat;
use photoncard_scene::Scene;
use photoncard_shared::message::{CausticGather, FrameParameters, PixelLayers, Tile};

use super::paths::Deviations;
use super::spread::Levels;
use crate::emulator::EmulatedKind;
use crate::emulator::direct::{RenderedTile, render_tiles_apart};
use crate::{Observer, Phase, RenderError, RenderSettings, Sampling};

/// Grid of tiles in which noise is measured. Each tile has a pseudo-random position in its cell.
const SPREAD: Grid = Grid { cells: 8, side: 4 };
/// Grid of tiles in which the gather rays of irradiance records are counted. The tiles are large, because
/// tiles do not share the records at their borders.
const SURVEYED: Grid = Grid { cells: 4, side: 32 };
/// Maximum fraction of an unguided map's photons that the picture uses, at which the pilot also tries maps
/// guided to the camera. The fraction is greater in rooms, halls and Cornell boxes, where guiding gains
/// nothing.
const MAX_USED_SHARE: f64 = 0.3;
/// Range of the fraction of an unguided map's photons that the picture uses, in which the short pilot
/// estimates the error of a guided map instead of measuring it. Below it the picture uses less than a hundred
/// of the pilot's photons. In rooms with fractions of 0.11 and 0.15 the measured ratios of the squared errors
/// are 0.40 and 0.21, the estimated ones 0.22 and 0.30.
const ESTIMATED_SHARES: RangeInclusive<f64> = 0.003..=MAX_USED_SHARE;
/// Factor `c` in the estimate `c f E` of the squared error of a guided map. `E` is the squared error of an
/// unguided map, and `f` the fraction of its photons that the picture uses. `c` is above 1, because guided
/// photons differ in power.
const ERROR_BY_USED_SHARE: f64 = 2.0;
/// Ratio of the numbers of photons of the pilot's larger and smaller map.
const MORE: usize = 4;
/// Maximum radiance of the lights that caustics come from, mean and greatest, divided by the median radiance
/// of the picture, at which gather rays bring caustics and there is no caustic map. A gather ray that finds
/// such a light at the end of a specular path changes its pixel by few times the picture's radiance.
const MAX_RADIANCE_OF_CAUSTICS: SourceRadiance = SourceRadiance { mean: 16.0, greatest: 128.0 };
/// Number of photons whose paths are counted before the pilot.
const PROBED_PHOTONS: usize = 1024;
/// Maximum divisor of the pilot's numbers of photons, where a photon takes many paths.
const MAX_FEWER: f64 = 4.0;
/// Seeds of the two renders of a pair. They and `PHOTON_SEED` differ from the picture's seed, on which the
/// chosen settings must not depend.
const SEEDS: [u32; 2] = [0x5eed_0001, 0x5eed_0002];
const PHOTON_SEED: u32 = 0x5eed_0003;
/// Minimum side of the picture, pixels. In a smaller picture tiles would overlap.
const MIN_SIDE: u32 = SPREAD.cells * SPREAD.side;
/// Numbers of shadow rays per sample of the renders whose noise is compared.
pub(super) const SHADOW_RAYS: [u32; 2] = [1, 4];

/// Amount of work of a pilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Effort {
    /// Number of photons of the smaller map.
    few_photons: usize,
    /// Numbers of gather rays per sample of the renders whose noise is compared.
    gather_rays: [u32; 2],
    /// True if the error of a guided map is always measured, even where it could be estimated. Guiding takes
    /// most of a pilot's time.
    measures_guided: bool,
}

impl Effort {
    pub(super) const FULL: Self = Self { few_photons: 16_384, gather_rays: [8, 32], measures_guided: true };
    /// Effort with half of the photons, three quarters of the gather rays and few guided maps, for drafts and
    /// short time limits. The chosen settings are less certain. Eight gather rays are the minimum, because
    /// gather points with fewer are sampled in another way.
    pub(super) const LESS: Self = Self { few_photons: 8_192, gather_rays: [8, 24], measures_guided: false };

    /// Effort with fewer photons if each of them takes more than one path.
    fn by(self, paths_of_photon: f64) -> Self {
        let fewer = self.few_photons as f64 / paths_of_photon.clamp(1.0, MAX_FEWER);
        Self { few_photons: fewer as usize, ..self }
    }
}

/// Variances and errors from which the settings follow, relative to the squared radiance of the pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Variances {
    /// Variance of a sample caused by its position, at edges and textures in a pixel. It is a lower bound:
    /// the variance `v / n` of `n` rays is subtracted, which is too great if the rays are stratified.
    pub(super) place: f64,
    /// Variance of a sample caused by one shadow ray.
    pub(super) shadow_ray: f64,
    /// Variance of a sample caused by one gather ray.
    pub(super) gather_ray: f64,
    /// Mean squared error of a map of one photon in 4x4 pixels, extrapolated by the law `1 / N`.
    pub(super) photon: f64,
    /// Errors of photon maps guided to the camera; `None` if the camera uses most photons anyway, or the user
    /// stated for which cameras photons are.
    pub(super) for_camera: Option<ForCamera>,
    /// Fraction of the samples with gather rays that see a surface with a Lambertian part.
    pub(super) lambertian: f64,
    /// Number of gather rays cast per pixel, divided by the setting `gather_rays`. It includes the rays of
    /// irradiance records and of samples without interpolation.
    pub(super) gather_rays_per_ray: f64,
    /// Number of paths from the lights per stored photon.
    pub(super) paths_of_photon: f64,
    /// True if gather rays bring caustics with little noise, so that a caustic map is not worth its time.
    pub(super) has_soft_caustics: bool,
    /// Median radiance of the lit pixels, W/(sr m^2); 1 in a black picture.
    pub(super) level: f64,
    /// Noise of the direct light of each pixel, measured from two pilot renders with equal settings, which
    /// cast the greater of the compared numbers of shadow and gather rays.
    pub(super) deviations: Deviations,
}

/// Errors of photon maps that are guided to the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ForCamera {
    /// [`Variances::photon`] of a map for the camera.
    pub(super) photon: f64,
    /// Squared error, including blur, of a map for the camera, divided by that of a map of as many photons
    /// for any camera. The error of the map for any camera is measured as its difference from the map for the
    /// camera. The difference of two maps for any camera would not show the blur that both have.
    pub(super) ratio: f64,
}

impl ForCamera {
    /// Computes the errors from two maps for the camera, `few` with fewer photons and `more` with more, and
    /// from `of_scene`, a map for any camera with as many photons as `more`.
    fn new(effort: Effort, best: &[Pixels; 2], [few, more]: [Pixels; 2], of_scene: &Pixels) -> Self {
        let photon = of_photon(effort, best, [&few, &more]);
        let own = photon / (MORE * effort.few_photons) as f64;
        let of_scene = (difference(best, [of_scene, &more]) - own).max(0.0);
        Self { photon, ratio: own / of_scene }
    }

    /// Estimates the errors of maps for the camera. `of_scene` is [`Variances::photon`] of a map for any
    /// camera, and `used_share` the fraction of its photons that the picture uses.
    fn estimated(of_scene: f64, used_share: f64) -> Self {
        let photon = ERROR_BY_USED_SHARE * used_share * of_scene;
        Self { photon, ratio: photon / of_scene }
    }
}

/// Renders the pilots of a picture. Returns the variances and errors that they show.
///
/// # Errors
/// If photons cannot be traced, the settings have no valid camera, or the observer stops the render.
pub(super) fn measure(
    effort: Effort,
    (scene, packed): (&Scene, &PackedScene),
    settings: &RenderSettings,
    observer: &dyn Observer,
) -> Result<Variances, RenderError> {
    let paths_of_photon = paths_of_photon(packed, observer)?;
    let effort = effort.by(paths_of_photon);
    let Effort { few_photons, gather_rays: numbers_of_gather_rays, measures_guided } = effort;
    let more_photons = MORE * few_photons;
    let settings = &enlarged(settings);
    // Tiles are spread over the whole picture, so that a crop has the same settings and pixels.
    let window = Window::full(settings.picture.width, settings.picture.height);
    let tiles = SPREAD.tiles(window);
    let [few_shadow_rays, shadow_rays] = SHADOW_RAYS;
    let [few_gather_rays, gather_rays] = numbers_of_gather_rays;
    // Rays have equal directions with all maps: only the maps differ.
    let by_map = settings.clone().with(|settings| {
        settings.integrator.shadow_rays = 0;
        settings.integrator.gather_rays = gather_rays;
        settings.integrator.sampling = Sampling::Reflection;
        settings.integrator.seed = SEEDS[0];
    });
    let render_map = |pilot: &Pilot| pilot.render_pixels(&by_map, &tiles);
    let pilot = |settings, photons| Pilot::new(scene, packed, settings, photons, observer);
    // Each pilot has its own card image, so only one pilot exists at a time.
    let few = pilot(settings, few_photons)?;
    let by_few_photons = render_map(&few)?;
    let gather_rays_per_ray = match settings.integrator.irradiance_error {
        Some(_) => few.gather_rays_per_ray(settings, &SURVEYED.tiles(window))?,
        None => by_few_photons.share_seen(),
    };
    drop(few);
    let mut more = pilot(settings, more_photons)?;
    let has_soft_caustics = more.has_caustics && {
        let pixels = more.render_pixels(&by_map.clone().with(|s| s.integrator.shadow_rays = 1), &tiles)?;
        packed.radiance_of_caustics().is_some_and(|light| is_soft(light, pixels.level()))
    };
    more.has_caustics &= !has_soft_caustics;
    let pair = |shadow_rays, gather_rays| -> Result<[Pixels; 2], RenderError> {
        let render = |seed| {
            let settings = settings.clone().with(|settings| {
                let integrator = &mut settings.integrator;
                (integrator.shadow_rays, integrator.gather_rays) = (shadow_rays, gather_rays);
                integrator.seed = seed;
            });
            more.render_pixels(&settings, &tiles)
        };
        Ok([render(SEEDS[0])?, render(SEEDS[1])?])
    };
    // Light has the noise of shadow rays and of gather rays. To separate the two, each pair of renders
    // reduces only one of the numbers of rays.
    let by_few_shadow_rays = pair(few_shadow_rays, gather_rays)?;
    let by_few_gather_rays = pair(shadow_rays, few_gather_rays)?;
    let best = pair(shadow_rays, gather_rays)?;
    let maps = [by_few_photons, render_map(&more)?];
    let used_share = more.used_share;
    drop(more);
    let photon = of_photon(effort, &best, [&maps[0], &maps[1]]);
    let for_camera = match used_share.filter(|share| *share < MAX_USED_SHARE) {
        Some(share) if measures_guided || !ESTIMATED_SHARES.contains(&share) => {
            let settings =
                settings.clone().with(|settings| settings.photons.photons_for = PhotonsFor::Camera);
            let guided = [few_photons, more_photons].map(|photons| render_map(&pilot(&settings, photons)?));
            let [few, more] = guided;
            Some(ForCamera::new(effort, &best, [few?, more?], &maps[1]))
        }
        share => share.map(|share| ForCamera::estimated(photon, share)),
    };
    let [shadow_ray, gather_ray] = [
        of_ray(SHADOW_RAYS, &by_few_shadow_rays, &best),
        of_ray(numbers_of_gather_rays, &by_few_gather_rays, &best),
    ];
    let of_rays = shadow_ray / f64::from(shadow_rays) + gather_ray / f64::from(gather_rays);
    Ok(Variances {
        place: (of_pairs([&best])[0] - of_rays).max(0.0),
        shadow_ray,
        gather_ray,
        photon,
        for_camera,
        lambertian: best[0].lambertian,
        gather_rays_per_ray,
        paths_of_photon,
        has_soft_caustics,
        level: level_of(&best),
        deviations: deviations(&best),
    })
}

/// Number of paths from the lights per stored photon. Few paths store photons where most light leaves the
/// scene, as around a single object.
fn paths_of_photon(packed: &PackedScene, observer: &dyn Observer) -> Result<f64, RenderError> {
    let pass = photon::trace(packed, PHOTON_SEED, PROBED_PHOTONS, &|_| !observer.is_stopped())?;
    Ok(pass.paths as f64 / pass.photons.len().max(1) as f64)
}

/// Variance `v` of a sample caused by one ray. The variance with `n` rays is `a + v / n`, where positions of
/// samples and other rays cause `a`. `noisy` and `best` are pairs of renders with the smaller and the greater
/// number of `rays`; their two variances determine `v`.
fn of_ray(rays: [u32; 2], noisy: &[Pixels; 2], best: &[Pixels; 2]) -> f64 {
    let [more, less] = of_pairs([noisy, best]);
    ((more - less) / (1.0 / f64::from(rays[0]) - 1.0 / f64::from(rays[1]))).max(0.0)
}

/// Relative variance of a sample in each pair of renders, over the pixels that see a surface in all renders.
/// It is divided by the squared radiance in the last pair.
fn of_pairs<const N: usize>(pairs: [&[Pixels; 2]; N]) -> [f64; N] {
    let seen: Vec<usize> = pixels_with_surfaces(&pairs).collect();
    let radiances = |pixels: &Pixels| seen.iter().map(|&pixel| pixels.radiance(pixel)).collect::<Vec<_>>();
    let pairs = pairs.map(|pair| pair.each_ref().map(radiances));
    let best = pairs.last().into_iter().flat_map(|[first, second]| first.iter().zip(second));
    let levels = Levels::new(best.map(|(first, second)| 0.5 * (first + second)));
    pairs.map(|[first, second]| 0.5 * levels.mean_square(first, second))
}

/// Indices of the pixels that see a surface in all renders.
fn pixels_with_surfaces(pairs: &[&[Pixels; 2]]) -> impl Iterator<Item = usize> {
    let pixels = pairs.first().map_or(0, |[first, _]| first.direct.len());
    (0..pixels).filter(move |&pixel| pairs.iter().copied().flatten().all(|pixels| pixels.is_seen[pixel]))
}

/// Median, over the lit pixels, of the mean radiance of two renders, W/(sr m^2); 1 for a black picture.
fn level_of(best: &[Pixels; 2]) -> f64 {
    let [first, second] = best;
    Levels::new((0..first.direct.len()).map(|pixel| 0.5 * (first.radiance(pixel) + second.radiance(pixel))))
        .median()
        .unwrap_or(1.0)
}

/// Returns whether gather rays find lights of this radiance, by way of specular surfaces, with little noise.
/// `level` is the median radiance of the picture's lit pixels, the background included.
fn is_soft(light: SourceRadiance, level: Option<f64>) -> bool {
    let SourceRadiance { mean, greatest } = MAX_RADIANCE_OF_CAUSTICS;
    level.is_some_and(|level| light.mean <= mean * level && light.greatest <= greatest * level)
}

/// Deviations of direct light in the pixels of a pair of renders.
fn deviations(pair: &[Pixels; 2]) -> Deviations {
    let renders = pair.each_ref();
    Deviations::new((0..pair[0].direct.len()).map(|pixel| {
        let [first, second] = renders.map(|pixels| pixels.radiance(pixel));
        (renders.map(|pixels| pixels.direct[pixel]), 0.5 * (first + second))
    }))
}

/// Relative mean squared error of tiles, extrapolated to a map of one photon. It is computed from the
/// difference between a map with fewer and a map with more photons, whose errors are independent.
fn of_photon(effort: Effort, best: &[Pixels; 2], maps: [&Pixels; 2]) -> f64 {
    difference(best, maps) * effort.few_photons as f64 / (1.0 + 1.0 / MORE as f64)
}

/// Mean squared difference between the indirect light of two maps, averaged over each tile, relative to the
/// squared radiance of the tile.
fn difference(best: &[Pixels; 2], maps: [&Pixels; 2]) -> f64 {
    // All tiles are of equal size.
    let pixels_of_tile = (best[0].direct.len() / SPREAD.number()).max(1);
    let mut tiles = vec![Vec::new(); SPREAD.number()];
    let all_see = |&pixel: &usize| maps.iter().all(|map| map.is_seen[pixel]);
    for pixel in pixels_with_surfaces(&[best]).filter(all_see) {
        tiles[pixel / pixels_of_tile].push(pixel);
    }
    tiles.retain(|pixels| 2 * pixels.len() > pixels_of_tile);
    let means = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let mean =
            |pixels: &Vec<usize>| pixels.iter().map(|&pixel| value(pixel)).sum::<f64>() / pixels.len() as f64;
        tiles.iter().map(mean).collect()
    };
    let levels = Levels::new(means(&|pixel| 0.5 * (best[0].radiance(pixel) + best[1].radiance(pixel))));
    let [first, second] = maps.map(|map| means(&|pixel| map.indirect[pixel]));
    levels.mean_square(first, second)
}

/// Photon map of a pilot with its scene.
struct Pilot<'a> {
    scene: &'a Scene,
    mapped: MappedImage,
    observer: &'a dyn Observer,
    /// True if the picture has a caustic map, which replaces the caustics of gather rays.
    has_caustics: bool,
    /// Fraction of the photons that the picture can use; `None` if the user stated for which cameras photons
    /// are.
    used_share: Option<f64>,
}

impl<'a> Pilot<'a> {
    fn new(
        scene: &'a Scene,
        packed: &PackedScene,
        settings: &RenderSettings,
        photons: usize,
        observer: &'a dyn Observer,
    ) -> Result<Self, RenderError> {
        observer.progress(Phase::Pilot, 0, 1);
        let of_picture = settings.photon_settings(scene);
        // Gathers in the caustic map find no photons, so that caustics add no noise.
        let photons = PhotonSettings { photons, seed: PHOTON_SEED, caustic_photons: 0, ..of_picture };
        let go_on = |_| !observer.is_stopped();
        let traced = TracedPhotons::new(packed, &photons, &go_on)?;
        let is_open = settings.photons.photons_for == PhotonsFor::Auto;
        let camera = settings.frame_camera(&settings.camera(scene)?);
        let used_share = is_open.then(|| traced.used_share(packed, &camera)).transpose()?;
        let mapped = map_traced(packed.clone(), traced, &photons, &go_on)?;
        let has_caustics = of_picture.caustic_photons > 0;
        Ok(Self { scene, mapped, observer, has_caustics, used_share })
    }

    /// Number of gather rays cast per pixel of `tiles`, with one sample per pixel and the setting
    /// `gather_rays` 1. It includes the rays of irradiance records and of samples without interpolation.
    fn gather_rays_per_ray(&self, settings: &RenderSettings, tiles: &[Tile]) -> Result<f64, RenderError> {
        let mut frame = self.frame(settings)?;
        (frame.samples, frame.planned_samples, frame.shadow_rays, frame.gather_rays, frame.seed) =
            (1, 1, 0, 1, SEEDS[0]);
        let rendered = self.render(&frame, tiles)?;
        let rays: u64 = rendered.iter().map(|tile| tile.counters.gather_rays).sum();
        let pixels: usize = tiles.iter().map(|tile| tile.pixels() as usize).sum();
        Ok(rays as f64 / pixels.max(1) as f64)
    }

    /// Renders one sample of each pixel in the tiles, without the irradiance cache.
    fn render_pixels(&self, settings: &RenderSettings, tiles: &[Tile]) -> Result<Pixels, RenderError> {
        let mut frame = self.frame(settings)?;
        (frame.samples, frame.planned_samples, frame.irradiance_error, frame.layers) = (1, 1, None, true);
        let rendered = self.render(&frame, tiles)?;
        Ok(Pixels::new(&rendered, SumFormat::new(&self.mapped.image.view().0.header, &frame)))
    }

    fn frame(&self, settings: &RenderSettings) -> Result<FrameParameters, RenderError> {
        let camera = settings.camera(self.scene)?;
        let max_distance = self.mapped.gathers.max_distance;
        let neighbors = settings.photons.caustic_neighbors;
        let caustics = self.has_caustics.then_some(CausticGather { neighbors, max_distance });
        let frame = settings.frame(&camera, &GatherParameters { caustics, ..self.mapped.gathers });
        // The pilot reads the light of all groups alone, and its card image may have no identities. It
        // measures the errors of gathers and of single rays: all gather rays end at their surfaces.
        Ok(FrameParameters {
            position: false,
            coverage: false,
            identities: false,
            light_groups: 0,
            near_distance: 0.0,
            ..frame
        })
    }

    fn render(&self, frame: &FrameParameters, tiles: &[Tile]) -> Result<Vec<RenderedTile>, RenderError> {
        let is_stopped = || self.observer.is_stopped();
        let image = &self.mapped.image;
        let chip = EmulatedKind::Reference;
        Ok(render_tiles_apart(chip, image, frame, tiles, None, &is_stopped)?)
    }
}

/// Light of the pixels of a pilot render, averaged over channels, W/(sr m^2).
struct Pixels {
    direct: Vec<f64>,
    indirect: Vec<f64>,
    /// True for pixels whose sample casts gather rays: it sees a surface that reflects not only as a mirror.
    is_seen: Vec<bool>,
    /// Fraction of the samples with gather rays that see a surface with a Lambertian part.
    lambertian: f64,
}

impl Pixels {
    fn new(tiles: &[RenderedTile], format: SumFormat) -> Self {
        let mean = |light: [f32; 3]| f64::from(Vec3::from(light).element_sum()) / 3.0;
        let layers: Vec<PixelLayers> =
            tiles.iter().flat_map(|tile| tile.pixels(format).map(|pixel| pixel.layers)).collect();
        let direct = layers.iter().map(|layers| mean(layers.direct)).collect();
        let indirect = layers.iter().map(|layers| mean(layers.indirect)).collect();
        let is_seen: Vec<bool> = layers.iter().map(|layers| layers.gathers > 0.0).collect();
        let seen = is_seen.iter().filter(|is_seen| **is_seen).count();
        let lambertian: u64 = tiles.iter().map(|tile| tile.counters.lambertian_samples).sum();
        Self { direct, indirect, is_seen, lambertian: lambertian as f64 / seen.max(1) as f64 }
    }

    /// Fraction of the pixels whose sample casts gather rays; 0 without pixels.
    fn share_seen(&self) -> f64 {
        let seen = self.is_seen.iter().filter(|is_seen| **is_seen).count();
        seen as f64 / self.is_seen.len().max(1) as f64
    }

    /// Median radiance of the lit pixels, W/(sr m^2); `None` if there is none.
    fn level(&self) -> Option<f64> {
        Levels::new((0..self.direct.len()).map(|pixel| self.radiance(pixel))).median()
    }

    fn radiance(&self, pixel: usize) -> f64 {
        self.direct[pixel] + self.indirect[pixel]
    }
}

/// Multiplies width and height of the picture by the smallest integer that makes both at least [`MIN_SIDE`].
fn enlarged(settings: &RenderSettings) -> RenderSettings {
    let [width, height] = [settings.picture.width, settings.picture.height];
    let factor = MIN_SIDE.div_ceil(width.min(height).max(1));
    settings.clone().with(|settings| {
        let picture = &mut settings.picture;
        (picture.width, picture.height) = (width.saturating_mul(factor), height.saturating_mul(factor));
    })
}

/// A grid of cells over a picture, with one tile in each cell.
struct Grid {
    /// Number of rows and of columns.
    cells: u32,
    /// Side of a tile, pixels.
    side: u32,
}

impl Grid {
    /// Number of tiles in the grid.
    const fn number(&self) -> usize {
        (self.cells * self.cells) as usize
    }

    /// Tiles of equal size in a window, each at a pseudo-random position in its cell. In a small window there
    /// are fewer tiles, or one of the window's size.
    fn tiles(&self, window: Window) -> Vec<Tile> {
        let side = self.side;
        let [width, height] = [window.width(), window.height()];
        let [columns, rows] = [width, height].map(|extent| self.cells.min(extent.div_ceil(side)));
        let (tile_width, tile_height) = (side.min(width), side.min(height));
        let place = |cell: u32, cells: u32, extent: u32, side: u32, salt: u32| {
            let free = u64::from(extent - side) + 1;
            let [low, high] = [cell, cell + 1].map(|cell| free * u64::from(cell) / u64::from(cells));
            low as u32 + hash(salt) % (high - low).max(1) as u32
        };
        (0..columns * rows)
            .map(|id| Tile {
                id,
                x: window.x0 + place(id % columns, columns, width, tile_width, 2 * id),
                y: window.y0 + place(id / columns, rows, height, tile_height, 2 * id + 1),
                width: tile_width,
                height: tile_height,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn caustics_are_soft_if_no_light_is_far_brighter_than_the_picture() {
        let soft = |mean, greatest, level| is_soft(SourceRadiance { mean, greatest }, level);
        assert!(soft(8.0, 8.0, Some(0.5)) && soft(8.0, 64.0, Some(0.5)));
        assert!(!soft(8.1, 8.1, Some(0.5)) && !soft(8.0, 65.0, Some(0.5)));
        assert!(!soft(f64::INFINITY, f64::INFINITY, Some(1.0)) && !soft(1.0, 1.0, None));
    }

    #[test]
    fn an_estimate_gains_by_the_used_share_and_nothing_without_an_error() {
        let ForCamera { photon, ratio } = ForCamera::estimated(8.0, 0.05);
        assert_eq!((photon, ratio), (0.8, 0.1));
        assert!(ForCamera::estimated(0.0, 0.05).ratio.is_nan());
    }

    #[test]
    fn tiles_lie_in_the_window_and_are_spread_over_it() {
        for (x1, y1) in [(512, 512), (640, 48), (33, 3), (1, 1)] {
            let window = Window { x0: 7, x1: 7 + x1, y0: 5, y1: 5 + y1 };
            let tiles = SPREAD.tiles(window);
            assert_eq!(tiles.len() as u32, x1.div_ceil(4).min(8) * y1.div_ceil(4).min(8));
            for tile in &tiles {
                assert!(window.contains(tile.x, tile.y), "{tile:?}");
                assert!(window.contains(tile.x + tile.width - 1, tile.y + tile.height - 1), "{tile:?}");
            }
            let of_quarter = |quarter: usize| {
                let is_inside = |tile: &&Tile| {
                    [(tile.x - 7) >= x1 / 2, (tile.y - 5) >= y1 / 2] == [quarter % 2 == 1, quarter / 2 == 1]
                };
                tiles.iter().filter(is_inside).count()
            };
            if x1 >= 64 && y1 >= 64 {
                assert!((0..4).all(|quarter| of_quarter(quarter).abs_diff(16) <= 4));
            }
        }
    }
}
