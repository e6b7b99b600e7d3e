//! Measures a point: work and memory traffic of a sample of a picture's tiles.

use photoncard_cards::scheduler::{GatherOrder, tiles};
use photoncard_map::photon_map::{MappedImage, PhotonMapSize};
use photoncard_render::emulator::EmulatedKind;
use photoncard_render::emulator::contents::Contents;
use photoncard_render::emulator::direct::{
    RenderedTile, TileMemory, render_tiles_apart, render_tiles_in_flight,
};
use photoncard_render::emulator::memory_model::{CacheSettings, MemoryTraffic};
use photoncard_render::emulator::reuse::{Reuse, ReuseCounts};
use photoncard_render::{RenderError, RenderSettings};
use photoncard_scene::Scene;
use photoncard_shared::address::{STRUCTURES, Structure};
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{FrameParameters, Tile};
use rayon::ThreadPool;
use serde::{Deserialize, Serialize};

use super::sample::{Chosen, Estimate, Ratio, SampleRate, choose, ratio_of_sums};
use super::whole_frame::WholeFrame;

/// Sums over a chip's reads of some structures (kinds of data) in card memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReadSums {
    /// Number of read requests by the chip.
    pub requests: u64,
    /// Bytes that the chip requested.
    pub raw_bytes: u64,
    /// Bytes that the caches fetched from DRAM.
    pub dram_bytes: u64,
}

/// Work and memory traffic of one tile.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TileMeasurement {
    /// Number of the tile in the picture.
    pub tile: u32,
    /// Weight of the tile: the number of tiles in the picture that it represents, including itself.
    pub stands_for: usize,
    /// Counts of the chip's work, such as rays and gathers.
    pub counters: Counters,
    /// Reads of each structure, in the order of [`Structure::ALL`].
    pub reads: [ReadSums; STRUCTURES],
    /// Bytes written of what waits in card memory.
    pub waiting_written_bytes: u64,
    /// Counts of the nodes, triangles, photons and other data in the lines of memory that the chip read.
    pub contents: Contents,
    /// Reuse of cache lines of each structure, in the order of [`Structure::ALL`], if it was counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reuse: Option<Box<Reuse>>,
}

/// Work and memory traffic of a point.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Measurement {
    /// Measured tiles, in the picture's order. A frame that was rendered as a whole has a single entry for
    /// all tiles.
    pub tiles: Vec<TileMeasurement>,
    /// Number of tiles that were rendered.
    pub rendered: usize,
    /// Size of the photon map in the card image.
    pub map: PhotonMapSize,
}

impl TileMeasurement {
    fn new(tile: u32, stands_for: usize, counters: Counters, traffic: &MemoryTraffic) -> Self {
        let reads = Structure::ALL.map(|structure| {
            let [requested, fetched] = traffic.of(|other| other == structure);
            ReadSums { requests: requested.requests, raw_bytes: requested.bytes, dram_bytes: fetched.bytes }
        });
        let waiting_written_bytes =
            traffic.requested.written_bytes(|structure| structure == Structure::Waiting);
        let contents = traffic.contents;
        Self { tile, stands_for, counters, reads, waiting_written_bytes, contents, reuse: None }
    }

    /// Reuse of cache lines of one structure; `None` if it was not counted.
    pub(crate) fn reuse_of(&self, structure: Structure) -> Option<&ReuseCounts> {
        self.reuse.as_ref().map(|reuse| &reuse[structure as usize])
    }

    /// Reads of the photon map.
    pub fn photon_map(&self) -> ReadSums {
        self.sum(Structure::is_photon_map)
    }

    /// Reads of the scene.
    pub fn scene(&self) -> ReadSums {
        self.sum(Structure::is_scene)
    }

    /// Reads of one structure.
    pub(crate) fn reads_of(&self, structure: Structure) -> ReadSums {
        self.sum(|other| other == structure)
    }

    /// Bytes of photon map and scene fetched from DRAM, and bytes read and written of what waits there.
    pub(crate) fn all_bytes(&self) -> f64 {
        (self.sum(|_| true).dram_bytes + self.waiting_written_bytes) as f64
    }

    fn sum(&self, chosen: impl Fn(Structure) -> bool) -> ReadSums {
        let mut sum = ReadSums::default();
        for (_, reads) in
            Structure::ALL.into_iter().zip(&self.reads).filter(|(structure, _)| chosen(*structure))
        {
            sum.requests += reads.requests;
            sum.raw_bytes += reads.raw_bytes;
            sum.dram_bytes += reads.dram_bytes;
        }
        sum
    }
}

impl Measurement {
    /// Estimates the sum of `count` over all tiles of the picture from the measured tiles.
    pub fn total(&self, count: impl Fn(&TileMeasurement) -> f64) -> Estimate {
        let sample: Vec<_> = self.tiles.iter().map(|tile| (count(tile), tile.stands_for)).collect();
        Estimate::of_total(&sample)
    }

    /// Ratio of the sums of two counts over all tiles of the picture.
    pub(crate) fn ratio(
        &self,
        numerator: impl Fn(&TileMeasurement) -> f64,
        denominator: impl Fn(&TileMeasurement) -> f64,
    ) -> Ratio {
        let both = |tile: &TileMeasurement| (numerator(tile), denominator(tile), tile.stands_for);
        ratio_of_sums(&self.tiles.iter().map(both).collect::<Vec<_>>())
    }

    /// Ratio of the sum of `count` over all tiles of the picture to that of `other`. If both have the same
    /// tiles, the interval is that of their residuals.
    pub(crate) fn over(&self, other: &Self, count: impl Fn(&TileMeasurement) -> f64) -> Ratio {
        let place = |tile: &TileMeasurement| (tile.tile, tile.stands_for);
        if !self.tiles.iter().map(place).eq(other.tiles.iter().map(place)) {
            return Ratio::new(self.total(&count), other.total(&count), 0.0);
        }
        let pairs = self.tiles.iter().zip(&other.tiles);
        let both: Vec<_> =
            pairs.map(|(first, second)| (count(first), count(second), first.stands_for)).collect();
        ratio_of_sums(&both)
    }

    /// Number of gathers, which are searches of the photon map.
    pub fn gathers(&self) -> Estimate {
        self.total(|tile| tile.counters.gathers as f64)
    }

    /// Bytes of the photon map that chips requested.
    pub fn raw_bytes(&self) -> Estimate {
        self.total(|tile| tile.photon_map().raw_bytes as f64)
    }

    /// Bytes of the photon map fetched from DRAM.
    pub fn photon_map_bytes(&self) -> Estimate {
        self.total(|tile| tile.photon_map().dram_bytes as f64)
    }

    /// Bytes of the scene fetched from DRAM.
    pub(crate) fn scene_bytes(&self) -> Estimate {
        self.total(|tile| tile.scene().dram_bytes as f64)
    }

    /// Bytes of photon map and scene fetched from DRAM, and bytes read and written of what waits there.
    pub fn dram_bytes(&self) -> Estimate {
        self.total(TileMeasurement::all_bytes)
    }
}

/// Bench of emulated chips: a scene, its card image, and threads that emulate the chips.
pub(crate) struct Bench<'a> {
    pub(crate) scene: &'a Scene,
    /// Card image of the scene, with its photon map.
    pub(crate) mapped: &'a MappedImage,
    /// Threads, each of which emulates one chip. Their stacks must have room for a whole chip, which is built
    /// there.
    pub(crate) pool: &'a ThreadPool,
    /// Function that returns whether to stop. It is polled before each tile.
    pub(crate) is_stopped: &'a (dyn Fn() -> bool + Sync),
}

impl Bench<'_> {
    /// Returns the parameters of a frame with `settings`.
    ///
    /// # Errors
    /// If the settings' camera is not possible in the scene.
    pub(crate) fn frame(&self, settings: &RenderSettings) -> Result<FrameParameters, RenderError> {
        let camera = settings.camera(self.scene)?;
        Ok(settings.frame(&camera, &self.mapped.gathers))
    }

    /// Renders `tiles` on chips of the kind `chip`. If `model` is given, the memory is modelled with its
    /// caches, which are empty when a tile begins.
    ///
    /// # Errors
    /// If the card image is malformed, or the bench is stopped.
    pub(crate) fn render(
        &self,
        chip: EmulatedKind,
        frame: &FrameParameters,
        tiles: &[Tile],
        model: Option<TileMemory>,
    ) -> Result<Vec<RenderedTile>, RenderError> {
        let image = &self.mapped.image;
        let work = || render_tiles_apart(chip, image, frame, tiles, model, self.is_stopped);
        Ok(self.pool.install(work)?)
    }

    /// Measures the work and memory traffic of a frame, from a sample of its tiles. If a chip has several
    /// tiles in flight in a gather queue, one chip renders all tiles.
    ///
    /// # Errors
    /// If the scene has no camera with the name in the settings, the card image is malformed, or the bench is
    /// stopped.
    pub(crate) fn traffic(
        &self,
        settings: &RenderSettings,
        chip: EmulatedKind,
        model: TileMemory,
        sample: SampleRate,
        least_tiles: usize,
    ) -> Result<Measurement, RenderError> {
        let frame = self.frame(settings)?;
        let all = all_tiles(settings, chip);
        if is_on_one_chip(settings, chip) {
            return self.in_flight(chip, &frame, &all, model);
        }
        let chosen = choose(&all, sample.count(all.len(), least_tiles));
        let tiles: Vec<Tile> = chosen.iter().map(|chosen| chosen.tile).collect();
        let rendered = self.render(chip, &frame, &tiles, Some(model))?;
        let measured = chosen.iter().zip(&rendered).map(|(Chosen { tile, stands_for }, rendered)| {
            let reuse = rendered.reuse.clone();
            let measured = TileMeasurement::new(tile.id, *stands_for, rendered.counters, &rendered.traffic);
            TileMeasurement { reuse, ..measured }
        });
        Ok(Measurement {
            tiles: measured.collect(),
            rendered: tiles.len(),
            map: PhotonMapSize::of(&self.mapped.image),
        })
    }

    /// Measures all tiles on one chip, in the picture's order and with as many in flight as the frame allows.
    /// The result is one sum, because a tile's reads depend on the other tiles in flight.
    fn in_flight(
        &self,
        chip: EmulatedKind,
        frame: &FrameParameters,
        tiles: &[Tile],
        model: TileMemory,
    ) -> Result<Measurement, RenderError> {
        let mut counters = Counters::ZERO;
        let mut stopped = (self.is_stopped)();
        let mut take = |_: &Tile, tile: RenderedTile| {
            counters.add(&tile.counters);
            stopped = (self.is_stopped)();
            !stopped
        };
        let image = &self.mapped.image;
        let render = || render_tiles_in_flight(chip, image, frame, tiles, model, &mut take);
        let (traffic, reuse) = self.pool.install(render).map_err(RenderError::Image)?;
        if stopped {
            return Err(RenderError::Stopped);
        }
        let measured = TileMeasurement::new(0, 1, counters, &traffic);
        Ok(Measurement {
            tiles: vec![TileMeasurement { reuse, ..measured }],
            rendered: tiles.len(),
            map: PhotonMapSize::of(&self.mapped.image),
        })
    }

    /// Measures the work and memory traffic of a frame whose gathers are done along one Hilbert curve, on
    /// reference chips.
    ///
    /// # Errors
    /// As [`Self::traffic`], and if the frame has too many gathers.
    pub(crate) fn along_curve(
        &self,
        settings: &RenderSettings,
        caches: &CacheSettings,
    ) -> Result<Measurement, RenderError> {
        let frame = &self.frame(settings)?;
        let tiles = &all_tiles(settings, EmulatedKind::Reference);
        let &Self { mapped: MappedImage { image, .. }, pool, is_stopped, .. } = self;
        let outcome = WholeFrame { image, frame, tiles, caches, pool, is_stopped }.render()?;
        Ok(Measurement {
            tiles: vec![TileMeasurement::new(0, 1, outcome.counters, &outcome.traffic)],
            rendered: tiles.len(),
            map: PhotonMapSize::of(image),
        })
    }
}

/// Returns whether one chip of the kind `chip` renders a whole frame with `settings`, because gathers of
/// several tiles wait at once, in its queue or in card memory.
pub(crate) fn is_on_one_chip(settings: &RenderSettings, chip: EmulatedKind) -> bool {
    let order = settings.schedule.order;
    let in_flight = settings.schedule.in_flight.unwrap_or(u32::MAX).min(chip.budget().in_flight);
    order == GatherOrder::Buckets || (order.has_queue() && in_flight > 1)
}

/// Returns all tiles of a picture that chips of the kind `chip` render with `settings`.
fn all_tiles(settings: &RenderSettings, chip: EmulatedKind) -> Vec<Tile> {
    tiles(settings.window(), settings.tile_side(&[chip.budget()]), settings.schedule.order)
}
