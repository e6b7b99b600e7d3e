//! Performs all gathers (photon searches) of a frame in the order of their positions along one Hilbert curve.
//! The memory traffic in this order is the bound with which the orders of chips are compared.
//!
//! No chip can do this, because the gathers of a frame take gigabytes. Emulated chips pass their gathers to
//! the host, which sorts them, and performs them when all rays are cast (Steinhurst, Coombe, Lastra 2005).
//! Gathers of irradiance records stay on the chips, because their results are needed before the gathers of
//! pixels.

use photoncard_firmware::chip::{Component, PixelView, add_light};
use photoncard_firmware::fixed_point::ColourSum;
use photoncard_firmware::gather::GatherRequest;
use photoncard_firmware::kind::ReferenceCandidates;
use photoncard_firmware::light_groups::GroupedLight;
use photoncard_firmware::render::final_gather::gathered;
use photoncard_firmware::render::{Context, GatherOutlet};
use photoncard_map::pack::CardImage;
use photoncard_picture::sink::FinishedTile;
use photoncard_picture::sums::SumFormat;
use photoncard_render::RenderError;
use photoncard_render::emulator::direct::{RenderedTile, render_tile_of};
use photoncard_render::emulator::memory_model::{CacheSettings, MeasuredMemory, MemoryTraffic};
use photoncard_render::emulator::{EmulatedChip, EmulatedKind, Measured};
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters, PixelSums, Tile};
use rayon::ThreadPool;
use rayon::prelude::*;

/// Maximum number of gathers kept at once. With 32 bytes each they take 4.3 GB.
const MAX_GATHERS: u64 = 1 << 27;
/// Approximate number of gathers for which rays are cast in one round. The host collects the gathers after
/// the round.
const GATHERS_PER_CAST: u64 = 1 << 21;
/// Number of gathers per task. It is large, because each task begins with empty caches, which adds traffic.
const GATHERS_PER_TASK: usize = 1 << 22;

/// A gather that waits for its turn along the curve.
#[derive(Clone, Copy)]
struct Waiting {
    /// Index in [`Frame::sums`] of the first sum of the pixel to which the result is added.
    sums: u32,
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

/// A tile whose rays are cast, and its gathers, which the host is to perform.
struct CastTile {
    tile: RenderedTile,
    /// Gathers with the indices of their pixels in the tile.
    waiting: Vec<(u32, GatherRequest)>,
}

/// Collector of the gathers that a chip passes to the host, with the indices of their pixels in the tile.
struct Outlet(Vec<(u32, GatherRequest)>);

impl GatherOutlet for Outlet {
    fn take(&mut self, pixel: u32, request: GatherRequest) {
        self.0.push((pixel, request));
    }
}

/// A frame whose gathers are to be performed along one Hilbert curve, and the means to render it.
#[derive(Clone, Copy)]
pub struct WholeFrame<'a> {
    /// The card image.
    pub image: &'a CardImage,
    /// The frame's parameters.
    pub frame: &'a FrameParameters,
    /// Tiles of the frame, in the order in which their rays are cast.
    pub tiles: &'a [Tile],
    /// Caches between chip and DRAM. They are empty when a tile begins, and at every 2^22-th gather.
    pub caches: &'a CacheSettings,
    /// Threads, each of which emulates one reference chip.
    pub pool: &'a ThreadPool,
    /// Function that returns whether to stop. It is polled before each tile and between the gathers.
    pub is_stopped: &'a (dyn Fn() -> bool + Sync),
}

/// Pixels, work and memory traffic of a frame.
pub struct FrameOutcome {
    /// Tiles of the picture. Their pixels are the same in every order of gathers.
    pub tiles: Vec<FinishedTile>,
    /// Counts of the chips' work, such as rays and gathers.
    pub counters: Counters,
    /// Memory traffic.
    pub traffic: MemoryTraffic,
}

impl WholeFrame<'_> {
    /// Renders the frame.
    ///
    /// # Errors
    /// If the frame has too many gathers, the card image is malformed, or the work is stopped.
    pub fn render(&self) -> Result<FrameOutcome, RenderError> {
        let &Self { frame, tiles, pool, .. } = self;
        let mut all = Frame::with_room_for(frame, tiles)?;
        let gathers_of_tile = rays_of_pixel(frame) * tiles.iter().map(Tile::pixels).max().unwrap_or(1);
        let of_pixel = frame.form().sums_of_light() as usize;
        let chips = pool.current_num_threads();
        let tiles_per_round = (GATHERS_PER_CAST / gathers_of_tile.max(1)).max(2 * chips as u64) as usize;
        for tiles in tiles.chunks(tiles_per_round) {
            all.add(frame, pool.install(|| self.cast(tiles))?)?;
        }
        pool.install(|| all.waiting.par_sort_unstable_by_key(|waiting| waiting.request.position));
        for waiting in all.waiting.chunks(chips * GATHERS_PER_TASK) {
            if (self.is_stopped)() {
                return Err(RenderError::Stopped);
            }
            let tasks = || waiting.par_chunks(GATHERS_PER_TASK).map(|waiting| self.gather(waiting)).collect();
            let parts: Result<Vec<_>, Fault> = pool.install(tasks);
            for Gathered { brought, counters, traffic } in parts.map_err(RenderError::Image)? {
                all.counters.add(&counters);
                all.traffic.add(&traffic);
                for (first, brought) in brought {
                    let sums = &mut all.sums[first as usize..][..of_pixel];
                    add_light(frame, sums, Component::Indirect, &brought);
                }
            }
        }
        let tiles = self.finished(&all).map_err(RenderError::Image)?;
        Ok(FrameOutcome { tiles, counters: all.counters, traffic: all.traffic })
    }

    /// Casts the rays of `tiles`, and collects their gathers.
    fn cast(&self, tiles: &[Tile]) -> Result<Vec<CastTile>, RenderError> {
        let &Self { image, frame, caches, .. } = self;
        let cast_one = |chip: &mut EmulatedChip, &tile: &Tile| {
            if (self.is_stopped)() {
                return Err(RenderError::Stopped);
            }
            let mut outlet = Outlet(Vec::new());
            let tile = render_tile_of(chip, image, Some(caches.into()), frame, tile, Some(&mut outlet));
            Ok(CastTile { tile: tile.map_err(RenderError::Image)?, waiting: outlet.0 })
        };
        tiles.par_iter().map_init(|| EmulatedKind::Reference.emulated().chip(), cast_one).collect()
    }

    /// Does gathers one after another, with caches that are empty at first.
    fn gather(&self, waiting: &[Waiting]) -> Result<Gathered, Fault> {
        let (scene, lines) = self.image.view();
        let mut memory = Measured::new(self.caches.over(lines));
        let mut counters = Counters::ZERO;
        let mut context =
            Context { scene: &scene, memory: &mut memory, frame: self.frame, counters: &mut counters };
        let mut candidates = ReferenceCandidates::new();
        let mut brought = Vec::with_capacity(waiting.len());
        for Waiting { sums, request, .. } in waiting {
            brought.push((*sums, gathered(&mut context, request, candidates.view())?));
        }
        Ok(Gathered { brought, counters, traffic: memory.traffic() })
    }

    /// Finished tiles from the sums of a frame.
    fn finished(&self, all: &Frame) -> Result<Vec<FinishedTile>, Fault> {
        let (scene, _) = self.image.view();
        let format = SumFormat::new(&scene.header, self.frame);
        let form = self.frame.form();
        let sums_of_pixel = form.sums_of_light() as usize;
        let mut pixels = all.views.iter().zip(all.sums.chunks_exact(sums_of_pixel));
        let finish = |tile: &Tile| {
            let of_tile = pixels.by_ref().take(tile.pixels() as usize);
            let sums: Vec<PixelSums> = of_tile.map(|(view, light)| view.sums(form, light)).collect();
            FinishedTile::of_pixels(*tile, sums, format)
                .ok_or(Fault { code: FaultCode::Tile, detail: tile.id })
        };
        self.tiles.iter().map(finish).collect()
    }
}

/// Number of gather rays per pixel. With the irradiance cache or adaptive sampling the number is an estimate.
fn rays_of_pixel(frame: &FrameParameters) -> u64 {
    let samples = frame.samples as u64;
    match frame.irradiance_error {
        None => samples * frame.gather_rays as u64,
        Some(_) => samples * u64::from(frame.gather_rays.div_ceil(frame.planned_samples.max(1))),
    }
}

/// Error of a frame that may have more gathers than can be kept.
fn too_many(gathers: u64) -> RenderError {
    RenderError::Setting {
        field: "schedule.order",
        value: "hilbert".into(),
        reason: format!(
            "the frame may have {gathers} gathers, and at most {MAX_GATHERS} are kept at once, as memory allows"
        ),
        remedy: "render a part with `picture.crop`, fewer `integrator.samples` or `integrator.gather_rays`, or use `schedule.order` sort".into(),
    }
}

impl Frame {
    fn with_room_for(frame: &FrameParameters, tiles: &[Tile]) -> Result<Self, RenderError> {
        let pixels: u64 = tiles.iter().map(Tile::pixels).sum();
        let gathers = pixels * rays_of_pixel(frame);
        let sums = pixels * u64::from(frame.form().sums_of_light());
        if gathers > MAX_GATHERS || sums > u32::MAX as u64 {
            return Err(too_many(gathers));
        }
        let mut all = Self {
            sums: Vec::new(),
            views: Vec::new(),
            waiting: Vec::new(),
            counters: Counters::ZERO,
            traffic: MemoryTraffic::ZERO,
        };
        all.sums.try_reserve_exact(sums as usize).map_err(|_| too_many(gathers))?;
        all.views.try_reserve_exact(pixels as usize).map_err(|_| too_many(gathers))?;
        all.waiting.try_reserve_exact(gathers as usize).map_err(|_| too_many(gathers))?;
        Ok(all)
    }

    /// Adds the sums and gathers of tiles. There can be more gathers than memory is reserved for only if
    /// glossy lobes are gathered beside an irradiance cache, or if samples have several paths.
    fn add(&mut self, frame: &FrameParameters, tiles: Vec<CastTile>) -> Result<(), RenderError> {
        for CastTile { tile, waiting } in tiles {
            let gathers = (self.waiting.len() + waiting.len()) as u64;
            if gathers > MAX_GATHERS {
                return Err(too_many(gathers));
            }
            self.waiting.try_reserve(waiting.len()).map_err(|_| too_many(gathers))?;
            let first = self.sums.len() as u32;
            self.sums.extend(tile.sums);
            self.views.extend(tile.views);
            self.counters.add(&tile.counters);
            self.traffic.add(&tile.traffic);
            let of_pixel = frame.form().sums_of_light();
            let waiting = waiting.into_iter();
            self.waiting
                .extend(waiting.map(|(pixel, request)| Waiting { sums: first + pixel * of_pixel, request }));
        }
        Ok(())
    }
}

/// Results of some gathers.
struct Gathered {
    /// Light of each gather, with the index in [`Frame::sums`] of the first sum of its pixel.
    brought: Vec<(u32, GroupedLight)>,
    counters: Counters,
    traffic: MemoryTraffic,
}
