//! One chip: the state of a tile, and its stages.
//!
//! A tile is rendered in one block or, if its irradiance records do not fit into the cache, in several smaller ones. A
//! block goes through the stages of `position`; every stage is done for all pixels before the next begins, so that
//! gathers of neighbouring pixels are adjacent. Each call of [`Chip::step`] does a small piece of this work.

mod completion;
mod gathers;
mod light;
mod pixels;
mod position;
mod records;
mod stored_point;

use heapless::Vec;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::{
    Budget, MICRO, REFERENCE, TechniqueMemory, gather_candidates, sums_of_pixel,
};
use photoncard_shared::message::{Fault, FrameParameters, PixelRecord, Tile};

pub use self::completion::Completion;
use self::gathers::Gathers;
pub use self::light::Component;
use self::light::{add_light, sums_of};
use self::position::{Block, Position, Stage};
use self::stored_point::StoredPoint;
use crate::fixed_point::ColourSum;
use crate::gather::GatherQueue;
use crate::importance::DirectionTable;
use crate::irradiance_cache::IrradianceCache;
use crate::memory::{CacheEntry, MemoryPort};
use crate::render::{Context, PixelSample};

/// The chip of [`REFERENCE`].
pub type ReferenceChip = Chip<
    { REFERENCE.tile_pixels as usize },
    { gather_candidates(REFERENCE.neighbors) },
    { REFERENCE.gather_queue as usize },
    { REFERENCE.irradiance_records as usize },
    { REFERENCE.gathered_records as usize },
>;
/// The chip of [`MICRO`].
pub type MicroChip = Chip<
    { MICRO.tile_pixels as usize },
    { gather_candidates(MICRO.neighbors) },
    { MICRO.gather_queue as usize },
    { MICRO.irradiance_records as usize },
    { MICRO.gathered_records as usize },
>;

/// A chip, with buffers for `TILE_PIXELS` pixels, `CANDIDATES` candidates of a gather, `QUEUE` queued gathers, and
/// `RECORDS` irradiance records, of which `GATHERED` are gathered at once.
pub struct Chip<
    const TILE_PIXELS: usize,
    const CANDIDATES: usize,
    const QUEUE: usize,
    const RECORDS: usize,
    const GATHERED: usize,
> {
    /// Origins of gather rays: the surface that each pixel of the tile sees in the current sample, or irradiance
    /// records.
    points: Vec<StoredPoint, TILE_PIXELS>,
    /// Sums of the tile's pixels, in the image's radiance units: [`sums_of_pixel`] for each pixel.
    sums: Vec<ColourSum, TILE_PIXELS>,
    gathers: Gathers<CANDIDATES, QUEUE>,
    cache: IrradianceCache<RECORDS, GATHERED>,
    tile: Tile,
    /// Blocks of the tile that have not begun, the next on top.
    blocks: Vec<Block, MAX_BLOCKS>,
    block: Block,
    position: Position,
    /// State of [`Self::complete`] for the current pixel.
    completion: Completion,
}

/// Capacity of the stack of blocks: enough for all halvings of a tile.
const MAX_BLOCKS: usize = 32;

/// Number of rays and gathers after which a step ends.
const WORK_OF_STEP: u64 = 16;
/// Maximum number of pieces of one step, as some pieces cast no ray.
const PIECES_PER_STEP: u32 = 64;

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The tile is not complete.
    Busy,
    /// The tile's pixels are complete.
    Complete,
}

impl<
    const TILE_PIXELS: usize,
    const CANDIDATES: usize,
    const QUEUE: usize,
    const RECORDS: usize,
    const GATHERED: usize,
> Default for Chip<TILE_PIXELS, CANDIDATES, QUEUE, RECORDS, GATHERED>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<
    const TILE_PIXELS: usize,
    const CANDIDATES: usize,
    const QUEUE: usize,
    const RECORDS: usize,
    const GATHERED: usize,
> Chip<TILE_PIXELS, CANDIDATES, QUEUE, RECORDS, GATHERED>
{
    /// On-chip memory that each technique adds to the chip.
    pub const TECHNIQUES: TechniqueMemory = TechniqueMemory {
        reordering: size_of::<GatherQueue<QUEUE>>(),
        irradiance_cache: size_of::<IrradianceCache<RECORDS, GATHERED>>(),
        importance_sampling: TILE_PIXELS * size_of::<DirectionTable>(),
    };

    /// A chip without a tile.
    pub const fn new() -> Self {
        Self {
            points: Vec::new(),
            sums: Vec::new(),
            gathers: Gathers::new(),
            cache: IrradianceCache::new(),
            tile: Tile { id: 0, x: 0, y: 0, width: 0, height: 0 },
            blocks: Vec::new(),
            block: Block::EMPTY,
            position: Position::DONE,
            completion: Completion::NOTHING,
        }
    }

    /// Maximum number of pixels of a tile of a frame.
    pub fn tile_pixels(&self, frame: &FrameParameters) -> u64 {
        TILE_PIXELS as u64 / u64::from(sums_of_pixel(frame.layers))
    }

    /// Begins a tile of a frame. Returns false if the tile has no pixels or more than [`Self::tile_pixels`].
    #[must_use]
    pub fn begin(&mut self, memory: &mut impl MemoryPort, frame: &FrameParameters, tile: Tile) -> bool {
        memory.begin_tile();
        self.tile = tile;
        self.position = Position::DONE;
        self.completion = Completion::NOTHING;
        self.points.clear();
        self.sums.clear();
        self.gathers.clear();
        self.blocks.clear();
        if tile.pixels() == 0 || tile.pixels() > self.tile_pixels(frame) {
            return false;
        }
        let pixels = tile.pixels() as usize;
        self.points.resize(pixels, StoredPoint::NOTHING).is_ok()
            && self.sums.resize(pixels * sums_of_pixel(frame.layers) as usize, ColourSum::ZERO).is_ok()
            && self.blocks.push(Block::whole(tile.width, tile.height)).is_ok()
    }

    /// Does the next pieces of the tile, about 16 rays and gathers: a card polls its link after each step, which must
    /// be short enough for a prompt reply and long enough to make the cost of polling negligible.
    ///
    /// # Errors
    /// If the image is not sound.
    pub fn step<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<Progress, Fault> {
        let done = context.counters.rays_and_gathers();
        for _ in 0..PIECES_PER_STEP {
            if self.piece(context)? == Progress::Complete {
                return Ok(Progress::Complete);
            }
            if context.counters.rays_and_gathers().wrapping_sub(done) >= WORK_OF_STEP {
                break;
            }
        }
        Ok(Progress::Busy)
    }

    /// Does the next piece of the tile: one stage of one pixel or record; in the stages of gather rays, rays of one
    /// direction bin of it; in the survey, one cell of the lattice or one ray; or some of the queued gathers.
    #[inline(always)]
    fn piece<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<Progress, Fault> {
        let stage = self.position.stage;
        let must_be_empty = matches!(stage, Stage::Done | Stage::RecordSums);
        let must_drain = self.gathers.is_full(context.frame) || must_be_empty && !self.gathers.is_empty();
        if self.gathers.is_draining() || must_drain {
            self.drain(context)?;
            return Ok(Progress::Busy);
        }
        match stage {
            Stage::Survey => self.survey(context)?,
            Stage::RecordPoints => self.choose_record_point(context)?,
            Stage::RecordRays => self.cast_for_record(context)?,
            Stage::RecordSums => self.end_records(context),
            Stage::Eye => self.look(context)?,
            Stage::Direct => self.light_directly(context)?,
            Stage::Rays => self.cast_for_pixel(context)?,
            Stage::Done => return Ok(self.next_block(context)),
        }
        Ok(Progress::Busy)
    }

    /// Begins the next block; the tile is complete if there is none.
    fn next_block<M>(&mut self, context: &Context<M>) -> Progress {
        let Some(block) = self.blocks.pop() else { return Progress::Complete };
        self.block = block;
        match allowed_error(context.frame) {
            None => self.position = Position::at(Stage::Eye),
            Some(_) => self.begin_records(),
        }
        Progress::Busy
    }

    /// Index in the tile of the current pixel, and its current sample.
    fn present(&self) -> (usize, PixelSample) {
        let [column, row] = self.block.pixel(self.position.index);
        let at = PixelSample { x: self.tile.x + column, y: self.tile.y + row, sample: self.position.sample };
        ((row * self.tile.width + column) as usize, at)
    }

    /// Does some of the queued gathers, and adds their radiance to records or pixels.
    fn drain<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let Self { sums, gathers, cache, position, .. } = self;
        let frame = context.frame;
        if matches!(position.stage, Stage::RecordRays | Stage::RecordSums) {
            return gathers.drain(context, &mut |request, brought| {
                cache.add(request.target, request.cell, brought);
            });
        }
        gathers.drain(context, &mut |request, brought| {
            add_light(sums, frame, request.target, Component::Indirect, brought);
        })
    }

    /// Sums of the complete tile's pixels, row-major, in the image's radiance units: one for each pixel, or
    /// [`photoncard_shared::budget::SUMS_WITH_LAYERS`] in a frame with layers.
    pub fn sums(&self) -> &[ColourSum] {
        &self.sums
    }

    /// Computes the record of pixel `index`, row-major, of the complete tile, some samples at a call: `None` until the
    /// last sample. To be called for one pixel until its record is returned.
    ///
    /// # Errors
    /// If the image is not sound.
    pub fn complete<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        index: usize,
    ) -> Result<Option<PixelRecord>, Fault> {
        let width = self.tile.width.max(1);
        let [x, y] = [self.tile.x + index as u32 % width, self.tile.y + index as u32 / width];
        if !self.completion.step(context, x, y)? {
            return Ok(None);
        }
        let completion = core::mem::replace(&mut self.completion, Completion::NOTHING);
        // The sums of an index past the last pixel are empty: no light.
        Ok(Some(completion.pixel(context, sums_of(&self.sums, context.frame, index))))
    }
}

/// Error bound of interpolated irradiance; `None` if the frame interpolates none.
fn allowed_error(frame: &FrameParameters) -> Option<f32> {
    frame.irradiance_error.filter(|_| frame.gather_rays > 0)
}

/// On-chip memory of a card, bytes: its state of `card_bytes`, and the budget's caches with their tags and stack.
pub const fn sram_bytes(budget: &Budget, card_bytes: usize) -> usize {
    card_bytes + cache_bytes(budget) + tag_bytes(budget) + budget.stack_bytes as usize
}

const fn cache_bytes(budget: &Budget) -> usize {
    budget.photon_cache_bytes as usize + budget.scene_cache_bytes as usize
}

/// On-chip memory of the tags of a budget's caches, bytes.
pub const fn tag_bytes(budget: &Budget) -> usize {
    cache_bytes(budget) / LINE_BYTES * size_of::<CacheEntry>()
}
