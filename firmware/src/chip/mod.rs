//! One chip: the state of a tile, and its passes.
//!
//! A tile is rendered in one block or, if its irradiance records do not fit into the cache, in several smaller ones. A
//! block goes through the passes of `position`; every pass is done for all pixels before the next begins, so that
//! gathers of neighbouring pixels are adjacent. Each call of [`Chip::step`] does a small piece of this work.

mod completion;
mod gathers;
mod light;
mod pixels;
mod position;
mod records;
mod stored_point;

use heapless::Vec;
use photoncard_shared::budget::sums_of_pixel;
use photoncard_shared::message::{Fault, FrameParameters, PixelRecord, Tile};

pub use self::completion::Completion;
use self::gathers::Gathers;
pub use self::light::{Component, light_of};
use self::light::{add_light, sums_of};
use self::position::{Block, Pass, Position};
use self::stored_point::StoredPoint;
use crate::fixed_point::ColourSum;
use crate::gather::GatherQueue;
use crate::importance::DirectionTable;
use crate::irradiance_cache::IrradianceCache;
use crate::kind::{self, Buffer, Capacity, ChipKind, Micro, Reference, TechniqueMemory};
use crate::memory::MemoryPort;
use crate::render::{Context, PixelSample};

/// The chip of the budget [`REFERENCE`](crate::kind::REFERENCE).
pub type ReferenceChip = Chip<Reference>;
/// The chip of the budget [`MICRO`](crate::kind::MICRO).
pub type MicroChip = Chip<Micro>;

/// A chip of one kind, which gives the capacities of all its buffers.
pub struct Chip<K: ChipKind> {
    /// Origins of gather rays: the surface that each pixel of the tile sees in the current sample, or irradiance
    /// records.
    points: <K::TilePixels as Capacity>::Buffer<StoredPoint>,
    /// Sums of the tile's pixels, in the image's radiance units: [`sums_of_pixel`] for each pixel.
    sums: <K::TilePixels as Capacity>::Buffer<ColourSum>,
    gathers: Gathers<K::Candidates, K::GatherQueue>,
    cache: IrradianceCache<K::IrradianceRecords, K::GatheredRecords>,
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

impl<K: ChipKind> Default for Chip<K> {
    fn default() -> Self {
        Self::new()
    }
}

impl<K: ChipKind> Chip<K> {
    /// On-chip memory that each technique adds to the chip.
    pub const TECHNIQUES: TechniqueMemory = TechniqueMemory {
        reordering: size_of::<GatherQueue<K::GatherQueue>>(),
        irradiance_cache: size_of::<IrradianceCache<K::IrradianceRecords, K::GatheredRecords>>(),
        importance_sampling: K::TilePixels::ENTRIES * size_of::<DirectionTable>(),
    };

    /// A chip without a tile.
    pub const fn new() -> Self {
        const { kind::check::<K>() };
        Self {
            points: Buffer::EMPTY,
            sums: Buffer::EMPTY,
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
        K::TilePixels::ENTRIES as u64 / u64::from(sums_of_pixel(frame.layers))
    }

    /// Begins a tile of a frame. Returns false if the tile has no pixels or more than [`Self::tile_pixels`].
    #[must_use]
    pub fn begin(&mut self, memory: &mut impl MemoryPort, frame: &FrameParameters, tile: Tile) -> bool {
        memory.begin_tile();
        self.tile = tile;
        self.position = Position::DONE;
        self.completion = Completion::NOTHING;
        self.points.view_mut().clear();
        self.sums.view_mut().clear();
        self.gathers.clear();
        self.blocks.clear();
        if tile.pixels() == 0 || tile.pixels() > self.tile_pixels(frame) {
            return false;
        }
        let pixels = tile.pixels() as usize;
        self.points.view_mut().resize(pixels, StoredPoint::NOTHING).is_ok()
            && self
                .sums
                .view_mut()
                .resize(pixels * sums_of_pixel(frame.layers) as usize, ColourSum::ZERO)
                .is_ok()
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

    /// Does the next piece of the tile: one pass of one pixel or record; in the passes of gather rays, rays of one
    /// direction bin of it; in the survey, one cell of the lattice or one ray; or some of the queued gathers.
    #[inline(always)]
    fn piece<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<Progress, Fault> {
        let pass = self.position.pass;
        let must_be_empty = matches!(pass, Pass::Done | Pass::RecordSums);
        let must_drain = self.gathers.is_full(context.frame) || must_be_empty && !self.gathers.is_empty();
        if self.gathers.is_draining() || must_drain {
            self.drain(context)?;
            return Ok(Progress::Busy);
        }
        match pass {
            Pass::Survey => self.survey(context)?,
            Pass::RecordPoints => self.choose_record_point(context)?,
            Pass::RecordRays => self.cast_for_record(context)?,
            Pass::RecordSums => self.end_records(context),
            Pass::Eye => self.look(context)?,
            Pass::Direct => self.light_directly(context)?,
            Pass::Rays => self.cast_for_pixel(context)?,
            Pass::Done => return Ok(self.next_block(context)),
        }
        Ok(Progress::Busy)
    }

    /// Begins the next block; the tile is complete if there is none.
    fn next_block<M>(&mut self, context: &Context<M>) -> Progress {
        let Some(block) = self.blocks.pop() else { return Progress::Complete };
        self.block = block;
        match allowed_error(context.frame) {
            None => self.position = Position::at(Pass::Eye),
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
        if matches!(position.pass, Pass::RecordRays | Pass::RecordSums) {
            return gathers.drain(context, &mut |request, brought| {
                cache.add(request.target, request.cell, brought);
            });
        }
        gathers.drain(context, &mut |request, brought| {
            add_light(sums.view_mut(), frame, request.target, Component::Indirect, brought);
        })
    }

    /// Sums of the complete tile's pixels, row-major, in the image's radiance units: one for each pixel, or
    /// [`photoncard_shared::budget::SUMS_WITH_LAYERS`] in a frame with layers.
    pub fn sums(&self) -> &[ColourSum] {
        self.sums.view()
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
        Ok(Some(completion.pixel(context, sums_of(self.sums.view(), context.frame, index))))
    }
}

/// Error bound of interpolated irradiance; `None` if the frame interpolates none.
fn allowed_error(frame: &FrameParameters) -> Option<f32> {
    frame.irradiance_error.filter(|_| frame.gather_rays > 0)
}
