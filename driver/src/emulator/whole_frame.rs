//! All gathers of a frame along one Hilbert curve: the bound that the orders of a chip are compared with.
//!
//! No chip can do it: the gathers of a frame are gigabytes. The emulated chips hand theirs to the host, which sorts them
//! and has them done when all rays are cast (Steinhurst, Coombe, Lastra 2005). Irradiance records are needed before the
//! pixels and stay on the chips.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use photoncard_firmware::chip::{Completion, Component, ReferenceChip};
use photoncard_firmware::fixed_point::ColourSum;
use photoncard_firmware::gather::GatherRequest;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::photon::CandidateBuffer;
use photoncard_firmware::render::final_gather::gathered;
use photoncard_firmware::render::{Context, GatherOutlet};
use photoncard_shared::budget::{REFERENCE, gather_candidates, sums_of_pixel};
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FrameParameters, Tile};
use rayon::prelude::*;

use super::THREAD_STACK;
use super::direct::{RenderedTile, render_tile};
use super::memory_model::{CacheSettings, MeasuredMemory, MemoryTraffic};
use crate::film::{Film, FilmError};
use crate::pack::CardImage;

/// The most gathers that are kept at once, 32 bytes each: 4.3 GB.
const MOST_GATHERS: u64 = 1 << 27;
/// Gathers of the tiles that are cast before the host takes them over, about.
const GATHERS_PER_CAST: u64 = 1 << 21;
/// Gathers that one task does.
const GATHERS_PER_TASK: usize = 4096;
/// The same where memory is modelled: empty caches at the beginning of each hardly count.
const GATHERS_PER_COUNTED_TASK: usize = 1 << 22;
/// Gathers that are done before the host looks around.
const GATHERS_PER_ROUND: usize = 256 * GATHERS_PER_TASK;

/// Why a frame was not rendered.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// It might have more gathers than can be kept.
    #[error(
        "the frame may have {gathers} gathers, and at most {MOST_GATHERS} are kept at once, as memory allows"
    )]
    TooManyGathers {
        /// Rays over pixels and samples.
        gathers: u64,
    },
    /// The image is not sound.
    #[error("the card image is not sound: {0}")]
    Image(Fault),
    /// The system has no threads.
    #[error("the chips could not be started: {0}")]
    Start(#[from] rayon::ThreadPoolBuildError),
    /// A tile is not in the film.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// It was stopped.
    #[error("stopped before the picture was complete")]
    Stopped,
}

impl From<Fault> for FrameError {
    fn from(fault: Fault) -> Self {
        Self::Image(fault)
    }
}

/// A gather on its way along the curve.
#[derive(Clone, Copy)]
struct Waiting {
    /// Index in the frame's sums.
    sum: u32,
    request: GatherRequest,
}

/// The sums of a frame's pixels, tile after tile, one or some a pixel, and the gathers that are still to be added.
struct Frame {
    sums: Vec<ColourSum>,
    waiting: Vec<Waiting>,
    counters: Counters,
    traffic: MemoryTraffic,
}

/// What one tile leaves to the host.
struct CastTile {
    tile: RenderedTile,
    waiting: Vec<GatherRequest>,
}

/// Takes the gathers of a chip.
struct Outlet(Vec<GatherRequest>);

impl GatherOutlet for Outlet {
    fn take(&mut self, request: GatherRequest) {
        self.0.push(request);
    }
}

/// A frame along the curve: what to render, and on what.
#[derive(Clone, Copy)]
pub struct CurveJob<'a> {
    /// The card image.
    pub image: &'a CardImage,
    /// The frame's parameters.
    pub frame: &'a FrameParameters,
    /// The tiles whose rays are cast, one after the other.
    pub tiles: &'a [Tile],
    /// Emulated reference chips.
    pub chips: usize,
}

/// What a frame took.
pub struct CurveOutcome {
    /// What was counted.
    pub counters: Counters,
    /// What was read, if the memory is modelled: caches are empty when a tile begins, and at every 2^22-th gather.
    pub traffic: MemoryTraffic,
}

/// Renders tiles into a film. `progress` is told how many tiles' worth of the work is done, of how many, and says whether
/// to go on. With `caches` memory is modelled.
///
/// # Errors
/// If the frame has too many gathers, the image is not sound, or `progress` says no.
pub fn render_along_curve(
    job: CurveJob,
    caches: Option<&CacheSettings>,
    film: &mut Film,
    progress: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Result<CurveOutcome, FrameError> {
    match caches {
        None => render_with(job, GATHERS_PER_TASK, &|memory| memory, film, progress),
        Some(caches) => {
            render_with(job, GATHERS_PER_COUNTED_TASK, &|memory| caches.over(memory), film, progress)
        }
    }
}

fn render_with<'a, M: MeasuredMemory>(
    job: CurveJob<'a>,
    gathers_per_task: usize,
    model: &(impl Fn(Lines<'a>) -> M + Sync),
    film: &mut Film,
    progress: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Result<CurveOutcome, FrameError> {
    let CurveJob { frame, tiles, chips, .. } = job;
    let mut all = Frame::with_room_for(frame, tiles)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(chips).stack_size(THREAD_STACK).build()?;
    // Casting a tile counts as a tenth of it, doing its gathers as the rest.
    let total = tiles.len() as u64;
    let cast = AtomicU64::new(0);
    let go_on = || progress(cast.fetch_add(1, Ordering::Relaxed) / 10, total);
    let gathers_of_tile = rays_of_pixel(frame) * tiles.iter().map(Tile::pixels).max().unwrap_or(1);
    let tiles_per_round = (GATHERS_PER_CAST / gathers_of_tile.max(1)).max(2 * chips as u64) as usize;
    for tiles in tiles.chunks(tiles_per_round) {
        all.add(frame, pool.install(|| cast_tiles(job, model, tiles, &go_on))?)?;
    }
    pool.install(|| all.waiting.par_sort_unstable_by_key(|waiting| waiting.request.place));
    let mut done = 0;
    for waiting in all.waiting.chunks(GATHERS_PER_ROUND.max(chips * gathers_per_task)) {
        let parts: Result<Vec<_>, Fault> = pool.install(|| {
            let task = |waiting: &[Waiting]| do_gathers(job, model, waiting);
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
            return Err(FrameError::Stopped);
        }
    }
    complete(job, model, &mut all, film)?;
    Ok(CurveOutcome { counters: all.counters, traffic: all.traffic })
}

/// The gather rays of one pixel; with the irradiance cache about.
fn rays_of_pixel(frame: &FrameParameters) -> u64 {
    let samples = frame.samples as u64;
    match frame.irradiance_error {
        None => samples * frame.gather_rays as u64,
        Some(_) => samples * (frame.gather_rays as u64).div_ceil(samples.max(1)),
    }
}

impl Frame {
    fn with_room_for(frame: &FrameParameters, tiles: &[Tile]) -> Result<Self, FrameError> {
        let pixels: u64 = tiles.iter().map(Tile::pixels).sum();
        let gathers = pixels * rays_of_pixel(frame);
        let too_many = || FrameError::TooManyGathers { gathers };
        let sums = pixels * u64::from(sums_of_pixel(frame.layers));
        if gathers > MOST_GATHERS || sums > u32::MAX as u64 {
            return Err(too_many());
        }
        let mut all = Self {
            sums: Vec::new(),
            waiting: Vec::new(),
            counters: Counters::ZERO,
            traffic: MemoryTraffic::ZERO,
        };
        all.sums.try_reserve_exact(sums as usize).map_err(|_| too_many())?;
        all.waiting.try_reserve_exact(gathers as usize).map_err(|_| too_many())?;
        Ok(all)
    }

    /// Takes over what tiles leave. Only lobes beside an irradiance cache can be more than there was room made for.
    fn add(&mut self, frame: &FrameParameters, tiles: Vec<CastTile>) -> Result<(), FrameError> {
        for CastTile { tile, waiting } in tiles {
            let gathers = (self.waiting.len() + waiting.len()) as u64;
            let too_many = || FrameError::TooManyGathers { gathers };
            if gathers > MOST_GATHERS {
                return Err(too_many());
            }
            self.waiting.try_reserve(waiting.len()).map_err(|_| too_many())?;
            let first = self.sums.len() as u32;
            self.sums.extend(tile.sums);
            self.counters.add(&tile.counters);
            self.traffic.add(&tile.traffic);
            let sum_of = |request: &GatherRequest| {
                first + Component::Indirect.sum_of(frame, request.target.into()) as u32
            };
            self.waiting
                .extend(waiting.into_iter().map(|request| Waiting { sum: sum_of(&request), request }));
        }
        Ok(())
    }
}

fn cast_tiles<'a, M: MeasuredMemory>(
    job: CurveJob<'a>,
    model: &(impl Fn(Lines<'a>) -> M + Sync),
    tiles: &[Tile],
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<CastTile>, FrameError> {
    let new_chip = || Box::new(ReferenceChip::new());
    let cast_one = |chip: &mut Box<ReferenceChip>, &tile: &Tile| {
        if !go_on() {
            return Err(FrameError::Stopped);
        }
        let mut outlet = Outlet(Vec::new());
        let (scene, memory) = job.image.view();
        let tile = render_tile(chip, &scene, model(memory), job.frame, tile, Some(&mut outlet))?;
        Ok(CastTile { tile, waiting: outlet.0 })
    };
    tiles.par_iter().map_init(new_chip, cast_one).collect()
}

/// Completes the pixels and writes them.
fn complete<'a, M: MeasuredMemory>(
    job: CurveJob<'a>,
    model: &impl Fn(Lines<'a>) -> M,
    all: &mut Frame,
    film: &mut Film,
) -> Result<(), FrameError> {
    let (scene, memory) = job.image.view();
    let mut memory = model(memory);
    let counters = &mut all.counters;
    let mut context =
        Context { scene: &scene, memory: &mut memory, frame: job.frame, counters, outlet: None };
    let places = job.tiles.iter().flat_map(|tile| {
        (0..tile.height).flat_map(move |y| (0..tile.width).map(move |x| (tile.x + x, tile.y + y)))
    });
    let sums_of_pixel = sums_of_pixel(job.frame.layers) as usize;
    for (sums, (x, y)) in all.sums.chunks_exact(sums_of_pixel).zip(places) {
        let mut completion = Completion::NOTHING;
        while !completion.step(&mut context, x, y)? {}
        film.write_record(x, y, &completion.pixel(&context, sums))?;
    }
    all.traffic.add(&memory.traffic());
    Ok(())
}

/// What came of some gathers.
struct Gathered {
    /// Index of the sum, and what is added there.
    brought: Vec<(u32, Vec3)>,
    counters: Counters,
    traffic: MemoryTraffic,
}

fn do_gathers<'a, M: MeasuredMemory>(
    job: CurveJob<'a>,
    model: &impl Fn(Lines<'a>) -> M,
    waiting: &[Waiting],
) -> Result<Gathered, Fault> {
    let (scene, memory) = job.image.view();
    let mut memory = model(memory);
    let mut counters = Counters::ZERO;
    let mut context = Context {
        scene: &scene,
        memory: &mut memory,
        frame: job.frame,
        counters: &mut counters,
        outlet: None,
    };
    let mut candidates = CandidateBuffer::<{ gather_candidates(REFERENCE.neighbors) }>::new();
    let mut brought = Vec::with_capacity(waiting.len());
    for Waiting { sum, request, .. } in waiting {
        brought.push((*sum, gathered(&mut context, request, candidates.view())?));
    }
    Ok(Gathered { brought, counters, traffic: memory.traffic() })
}
