//! Does all gathers of a frame along one Hilbert curve. It is the bound with which the orders of a chip are
//! compared.
//!
//! No chip can do this, because the gathers of a frame take gigabytes. Emulated chips pass their gathers to
//! the host, which sorts them, and does them when all rays are cast (Steinhurst, Coombe, Lastra 2005).
//! Gathers of irradiance records, whose results are needed before those of pixels, stay on the chips.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use photoncard_firmware::chip::{Component, PixelView};
use photoncard_firmware::fixed_point::ColourSum;
use photoncard_firmware::gather::GatherRequest;
use photoncard_firmware::kind::ReferenceCandidates;
use photoncard_firmware::render::final_gather::gathered;
use photoncard_firmware::render::{Context, GatherOutlet};
use photoncard_map::pack::CardImage;
use photoncard_picture::sink::{FinishedTile, TileSink};
use photoncard_picture::sums::SumFormat;
use photoncard_shared::budget::sums_of_pixel;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters, PixelSums, Tile};
use rayon::prelude::*;

use super::direct::{RenderedTile, render_tile_of};
use super::dram::EmulatedDram;
use super::measured::Measured;
use super::memory_model::{CacheSettings, MeasuredMemory, MemoryTraffic};
use super::{EmulatedChip, EmulatedKind};

/// Maximum number of gathers kept at once. With 32 bytes each they take 4.3 GB.
const MAX_GATHERS: u64 = 1 << 27;
/// Approximate number of gathers in one round of casting. The host takes them over after the round.
const GATHERS_PER_CAST: u64 = 1 << 21;
const GATHERS_PER_TASK: usize = 4096;
/// Number of gathers per task if memory is modelled. It is large, so that the empty caches at a task's
/// beginning hardly matter.
const GATHERS_PER_COUNTED_TASK: usize = 1 << 22;
/// Minimum number of gathers between two reports of progress.
const GATHERS_PER_ROUND: usize = 256 * GATHERS_PER_TASK;

/// Error of [`render_along_curve`].
#[derive(Debug, thiserror::Error)]
pub enum CurveError {
    /// The frame may have more gathers than can be kept.
    #[error(
        "the frame may have {gathers} gathers, and at most {MAX_GATHERS} are kept at once, as memory allows"
    )]
    TooManyGathers {
        /// Number of gathers that the frame may have: gather rays of all pixels and samples.
        gathers: u64,
    },
    /// The image is malformed.
    #[error("the card image is malformed: {0}")]
    Image(Fault),
    /// The threads cannot be started.
    #[error("the chips could not be started: {0}")]
    Start(#[from] rayon::ThreadPoolBuildError),
    /// The caller stopped the render.
    #[error("stopped before the picture was complete")]
    Stopped,
}

impl From<Fault> for CurveError {
    fn from(fault: Fault) -> Self {
        Self::Image(fault)
    }
}

/// A gather that waits for its turn along the curve.
#[derive(Clone, Copy)]
struct Waiting {
    /// Index in [`Frame::sums`] of the sum to which the result is added.
    sum: u32,
    request: GatherRequest,
}

/// State of a frame: the sums of its pixels, tile after tile (one per pixel, or several with layers), and the
/// gathers whose results are not yet added.
struct Frame {
    sums: Vec<ColourSum>,
    /// Albedo, normal and depth of the pixels.
    views: Vec<PixelView>,
    waiting: Vec<Waiting>,
    counters: Counters,
    traffic: MemoryTraffic,
}

/// A tile whose rays are cast, and the gathers that it leaves to the host.
struct CastTile {
    tile: RenderedTile,
    /// Gathers with the indices of their pixels in the tile.
    waiting: Vec<(u32, GatherRequest)>,
}

/// Collector of the gathers of a chip.
struct Outlet(Vec<(u32, GatherRequest)>);

impl GatherOutlet for Outlet {
    fn take(&mut self, pixel: u32, request: GatherRequest) {
        self.0.push((pixel, request));
    }
}

/// A frame to be rendered along the curve.
#[derive(Clone, Copy)]
pub struct CurveJob<'a> {
    /// The card image.
    pub image: &'a CardImage,
    /// The frame's parameters.
    pub frame: &'a FrameParameters,
    /// Tiles of the frame, in the order in which their rays are cast.
    pub tiles: &'a [Tile],
    /// Number of emulated reference chips, each on its own thread.
    pub chips: usize,
}

/// Work and memory traffic of a frame.
pub struct CurveOutcome {
    /// Counters of the work.
    pub counters: Counters,
    /// Memory traffic, if the memory is modelled. Caches are empty when a tile begins, and at every 2^22-th
    /// gather.
    pub traffic: MemoryTraffic,
}

/// Renders tiles and stores them in sinks, all of them at the end. `progress(done, total)` is called with the
/// work done, in tiles, and returns whether to continue. With `caches` the memory is modelled.
///
/// # Errors
/// If the frame has too many gathers, the card image is malformed, the threads cannot be started, or
/// `progress` returns false.
pub fn render_along_curve(
    job: CurveJob,
    caches: Option<&CacheSettings>,
    sinks: &[&dyn TileSink],
    progress: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Result<CurveOutcome, CurveError> {
    let CurveJob { frame, tiles, chips, .. } = job;
    let gathers_per_task = if caches.is_some() { GATHERS_PER_COUNTED_TASK } else { GATHERS_PER_TASK };
    let mut all = Frame::with_room_for(frame, tiles)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(chips).build()?;
    // The rays of a tile count as a tenth of its work, its gathers as the rest.
    let total = tiles.len() as u64;
    let cast = AtomicU64::new(0);
    let go_on = || progress(cast.fetch_add(1, Ordering::Relaxed) / 10, total);
    let gathers_of_tile = rays_of_pixel(frame) * tiles.iter().map(Tile::pixels).max().unwrap_or(1);
    let tiles_per_round = (GATHERS_PER_CAST / gathers_of_tile.max(1)).max(2 * chips as u64) as usize;
    for tiles in tiles.chunks(tiles_per_round) {
        all.add(frame, pool.install(|| cast_tiles(job, caches, tiles, &go_on))?)?;
    }
    pool.install(|| all.waiting.par_sort_unstable_by_key(|waiting| waiting.request.position));
    let (_, lines) = job.image.view();
    let mut done = 0;
    for waiting in all.waiting.chunks(GATHERS_PER_ROUND.max(chips * gathers_per_task)) {
        let parts: Result<Vec<_>, Fault> = pool.install(|| {
            let task = |waiting: &[Waiting]| match caches {
                None => do_gathers(job, EmulatedDram::lent(lines), waiting),
                Some(caches) => do_gathers(job, Measured::new(caches.over(lines)), waiting),
            };
            waiting.par_chunks(gathers_per_task).map(task).collect()
        });
        for Gathered { brought, counters, traffic } in parts? {
            all.counters.add(&counters);
            all.traffic.add(&traffic);
            for (sum, brought) in brought {
                all.sums[sum as usize].add_light(brought);
            }
        }
        done += waiting.len() as u64;
        if !progress(total / 10 + (total - total / 10) * done / all.waiting.len() as u64, total) {
            return Err(CurveError::Stopped);
        }
    }
    complete(job, &all, sinks)?;
    Ok(CurveOutcome { counters: all.counters, traffic: all.traffic })
}

/// Number of gather rays per pixel. It is an estimate with the irradiance cache and with adaptive sampling.
fn rays_of_pixel(frame: &FrameParameters) -> u64 {
    let samples = frame.samples as u64;
    match frame.irradiance_error {
        None => samples * frame.gather_rays as u64,
        Some(_) => samples * u64::from(frame.gather_rays.div_ceil(frame.planned_samples.max(1))),
    }
}

impl Frame {
    fn with_room_for(frame: &FrameParameters, tiles: &[Tile]) -> Result<Self, CurveError> {
        let pixels: u64 = tiles.iter().map(Tile::pixels).sum();
        let gathers = pixels * rays_of_pixel(frame);
        let too_many = || CurveError::TooManyGathers { gathers };
        let sums = pixels * u64::from(sums_of_pixel(frame.layers));
        if gathers > MAX_GATHERS || sums > u32::MAX as u64 {
            return Err(too_many());
        }
        let mut all = Self {
            sums: Vec::new(),
            views: Vec::new(),
            waiting: Vec::new(),
            counters: Counters::ZERO,
            traffic: MemoryTraffic::ZERO,
        };
        all.sums.try_reserve_exact(sums as usize).map_err(|_| too_many())?;
        all.views.try_reserve_exact(pixels as usize).map_err(|_| too_many())?;
        all.waiting.try_reserve_exact(gathers as usize).map_err(|_| too_many())?;
        Ok(all)
    }

    /// Adds the sums and gathers of tiles. Only gathers of glossy lobes beside an irradiance cache, and of
    /// several paths per sample, can exceed the reserved memory.
    fn add(&mut self, frame: &FrameParameters, tiles: Vec<CastTile>) -> Result<(), CurveError> {
        for CastTile { tile, waiting } in tiles {
            let gathers = (self.waiting.len() + waiting.len()) as u64;
            let too_many = || CurveError::TooManyGathers { gathers };
            if gathers > MAX_GATHERS {
                return Err(too_many());
            }
            self.waiting.try_reserve(waiting.len()).map_err(|_| too_many())?;
            let first = self.sums.len() as u32;
            self.sums.extend(tile.sums);
            self.views.extend(tile.views);
            self.counters.add(&tile.counters);
            self.traffic.add(&tile.traffic);
            let sum_of = |pixel: u32| first + Component::Indirect.sum_of(frame, pixel as usize) as u32;
            let waiting = waiting.into_iter();
            self.waiting.extend(waiting.map(|(pixel, request)| Waiting { sum: sum_of(pixel), request }));
        }
        Ok(())
    }
}

fn cast_tiles(
    job: CurveJob,
    caches: Option<&CacheSettings>,
    tiles: &[Tile],
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<CastTile>, CurveError> {
    let cast_one = |chip: &mut EmulatedChip, &tile: &Tile| {
        if !go_on() {
            return Err(CurveError::Stopped);
        }
        let mut outlet = Outlet(Vec::new());
        let tile = render_tile_of(chip, job.image, caches, job.frame, tile, Some(&mut outlet))?;
        Ok(CastTile { tile, waiting: outlet.0 })
    };
    tiles.par_iter().map_init(|| EmulatedKind::Reference.emulated().chip(), cast_one).collect()
}

/// Stores the tiles in sinks.
fn complete(job: CurveJob, all: &Frame, sinks: &[&dyn TileSink]) -> Result<(), CurveError> {
    let (scene, _) = job.image.view();
    let format = SumFormat::new(&scene.header, job.frame);
    let sums_of_pixel = sums_of_pixel(job.frame.layers) as usize;
    let mut pixels = all.views.iter().zip(all.sums.chunks_exact(sums_of_pixel));
    for tile in job.tiles {
        let of_tile = pixels.by_ref().take(tile.pixels() as usize);
        let sums: Vec<PixelSums> = of_tile.map(|(view, light)| view.sums(light)).collect();
        let finished = FinishedTile::of_pixels(*tile, sums, format)
            .ok_or(Fault { code: FaultCode::Tile, detail: tile.id })?;
        sinks.iter().for_each(|sink| sink.put(&finished));
    }
    Ok(())
}

/// Results of some gathers.
struct Gathered {
    /// Light to be added, with the indices of its sums.
    brought: Vec<(u32, Vec3)>,
    counters: Counters,
    traffic: MemoryTraffic,
}

fn do_gathers(
    job: CurveJob,
    mut memory: impl MeasuredMemory,
    waiting: &[Waiting],
) -> Result<Gathered, Fault> {
    let (scene, _) = job.image.view();
    let mut counters = Counters::ZERO;
    let mut context =
        Context { scene: &scene, memory: &mut memory, frame: job.frame, counters: &mut counters };
    let mut candidates = ReferenceCandidates::new();
    let mut brought = Vec::with_capacity(waiting.len());
    for Waiting { sum, request, .. } in waiting {
        brought.push((*sum, gathered(&mut context, request, candidates.view())?));
    }
    Ok(Gathered { brought, counters, traffic: memory.traffic() })
}
