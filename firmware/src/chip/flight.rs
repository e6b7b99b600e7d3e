//! State of a tile in flight, from its command to its last pixel.

use core::ops::Range;

use heapless::Vec;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FrameParameters, Invariant, Tile};

use super::adaptive::{self, Paths};
use super::finished_pixel::{Completion, FurtherSums};
use super::position::{Block, Pass, Position};
use crate::gather::{GatherTarget, PointIndex};
use crate::irradiance_cache::{IrradianceCache, Window};
use crate::kind::{Buffer, Capacity, ChipKind, Vacant};
use crate::memory::{MemoryPort, WordReader, WordWriter};
use crate::render::PixelSample;
use crate::slot::Slot;

/// Capacity of the stack of blocks, sufficient for all halvings of a tile.
pub(super) const MAX_BLOCKS: usize = 32;

/// Value in [`Flight::sums`] of a pixel that, as far as is known, has no gather rays.
const PLAIN: u16 = u16::MAX;
/// Value in [`Flight::sums`] of a pixel that has gather rays, but no sum yet.
const UNSUMMED: u16 = PLAIN - 1;

/// State of a tile in flight. A tile begins as one block. A block whose irradiance records do not fit into
/// the cache is halved into blocks that are rendered one after another.
pub(super) struct Flight<K: ChipKind> {
    pub(super) tile: Tile,
    pub(super) counters: Counters,
    /// Blocks that have not begun; the next one is on top.
    blocks: Vec<Block, MAX_BLOCKS>,
    pub(super) block: Block,
    pub(super) position: Position,
    /// Number of queued gathers that belong to the block.
    pub(super) waiting: u32,
    /// Number of the block in its round; `None` in a frame without rounds.
    pub(super) block_number: Option<usize>,
    /// Number of the tile among those whose blocks wait; 0 in a frame without rounds.
    pub(super) tile_number: usize,
    pub(super) cache: IrradianceCache<K::IrradianceRecords>,
    /// For each pixel of the block, its number among the tile's pixels in [`super::pixel_sums::PixelSums`];
    /// or [`PLAIN`] or [`UNSUMMED`].
    sums: <K::TilePixels as Capacity>::Buffer<u16>,
    /// Number of paths per sample, by pixel of the block.
    paths: <K::TilePixels as Capacity>::Buffer<Paths>,
    /// State of the pixel that is being completed, or whose probes are traced.
    pub(super) completion: Slot<Completion>,
    /// Sums of the pixel that is being completed that only some frames ask for. They are not part of
    /// [`Completion`], which is moved for each path.
    pub(super) further: FurtherSums,
}

impl<K: ChipKind> Vacant for Flight<K> {
    const VACANT: Self = Self {
        tile: Tile { id: 0, x: 0, y: 0, width: 0, height: 0 },
        counters: Counters::ZERO,
        blocks: Vec::new(),
        block: Block::EMPTY,
        position: Position::VACANT,
        waiting: 0,
        block_number: None,
        tile_number: 0,
        cache: IrradianceCache::new(),
        sums: Buffer::EMPTY,
        paths: Buffer::EMPTY,
        completion: Slot::Empty,
        further: FurtherSums::NONE,
    };
}

impl<K: ChipKind> Flight<K> {
    /// On-chip memory of the buffers for pixels and irradiance records, bytes.
    pub(super) const BUFFER_BYTES: usize = size_of::<IrradianceCache<K::IrradianceRecords>>()
        + size_of::<<K::TilePixels as Capacity>::Buffer<u16>>()
        + size_of::<<K::TilePixels as Capacity>::Buffer<Paths>>();

    /// Sets the capacities for pixels and for irradiance records, if the types leave them open.
    pub(super) fn reserve(&mut self, pixels: usize, records: usize) {
        self.sums.reserve(pixels);
        self.paths.reserve(pixels);
        self.cache.reserve(records);
    }

    pub(super) fn begin(&mut self, tile: Tile) {
        self.vacate();
        self.tile = tile;
        self.counters = Counters::ZERO;
        self.position = Position::at(Pass::NextBlock);
        // Always fits: the stack is empty.
        let _ = self.blocks.push(Block::whole(tile.width, tile.height));
    }

    /// Drops the tile.
    pub(super) fn vacate(&mut self) {
        self.position = Position::VACANT;
        self.blocks.clear();
        self.waiting = 0;
        self.block_number = None;
        self.tile_number = 0;
        self.completion = Slot::Empty;
    }

    /// Goes on with a tile whose remaining blocks are `blocks`.
    pub(super) fn resume(
        &mut self,
        tile: Tile,
        counters: Counters,
        number: usize,
        blocks: Vec<Block, MAX_BLOCKS>,
    ) {
        self.vacate();
        self.tile = tile;
        self.counters = counters;
        self.tile_number = number;
        self.blocks = blocks;
        self.position = Position::at(Pass::NextBlock);
    }

    /// Window of the next block; an empty one if all have begun.
    pub(super) fn window_of_next_block(&self) -> Window {
        self.blocks.last().unwrap_or(&Block::EMPTY).window(&self.tile)
    }

    /// Removes the blocks that have not begun.
    pub(super) fn take_blocks(&mut self) -> Vec<Block, MAX_BLOCKS> {
        core::mem::take(&mut self.blocks)
    }

    /// Target of the gathers of a point of the block. `flight` is the number of the tile in flight.
    #[inline(always)]
    pub(super) fn target(&self, flight: usize, point: PointIndex) -> GatherTarget {
        match self.block_number {
            None => GatherTarget::new(flight, point),
            Some(block) => GatherTarget::of_block(block, point),
        }
    }

    pub(super) fn pass(&self) -> Pass {
        self.position.pass
    }

    /// Returns true if pixels of the block are being completed, or can be completed because no gather of the
    /// block waits.
    pub(super) fn is_completable(&self) -> bool {
        match self.pass() {
            Pass::CompletePlain | Pass::Complete => true,
            Pass::WaitForRecords | Pass::Wait => self.waiting == 0,
            _ => false,
        }
    }

    pub(super) fn begin_block(&mut self, frame: &FrameParameters) -> Result<(), Fault> {
        let block = self.blocks.pop().ok_or(Invariant::Block.fault())?;
        self.set_block(block)?;
        match allowed_error(frame) {
            None if frame.gather_rays == 0 => self.position = Position::at(Pass::CompletePlain),
            None => self.do_without_records()?,
            Some(_) if frame.keep_records => self.position = Position::at(Pass::ReadKept),
            Some(_) => self.begin_records(frame)?,
        }
        Ok(())
    }

    /// Sets the block, whose pixels have no gather rays and one path per sample.
    pub(super) fn set_block(&mut self, block: Block) -> Result<(), Fault> {
        self.block = block;
        self.set_all_sums(PLAIN)?;
        self.paths.clear();
        let has_room = self.paths.resize(self.block.pixels() as usize, Paths::ONE);
        has_room.then_some(()).ok_or(Invariant::Pixels.fault())
    }

    /// Writes the numbers of sums and of paths of all pixels of the block.
    pub(super) fn save_pixels<M: MemoryPort>(&self, words: &mut WordWriter<M>) -> Result<(), Fault> {
        words.packed::<16>(self.sums.values().iter().map(|&number| number.into()))?;
        words.packed::<8>(self.paths.values().iter().map(|&paths| paths.number().into()))
    }

    /// Reads what [`Self::save_pixels`] has written of a block with as many pixels.
    pub(super) fn restore_pixels<M: MemoryPort>(&mut self, words: &mut WordReader<M>) -> Result<(), Fault> {
        let pixels = self.block.pixels() as usize;
        words.packed::<16>(pixels, |pixel, number| self.set_sum(pixel as u32, number as u16))?;
        words.packed::<8>(pixels, |pixel, paths| self.set_paths(pixel as u32, Paths::of_number(paths as u8)))
    }

    /// Returns true if blocks of the tile have not begun.
    pub(super) fn has_blocks(&self) -> bool {
        !self.blocks.is_empty()
    }

    /// Replaces the block by its two halves, because its records do not fit into the cache. The records of a
    /// block of one pixel always fit.
    pub(super) fn divide_block(&mut self) -> Result<(), Fault> {
        let [first, second] = self.block.halves().ok_or(Invariant::Halves.fault())?;
        for half in [second, first] {
            self.blocks.push(half).map_err(|_| Invariant::Halves.fault())?;
        }
        self.position = Position::at(Pass::NextBlock);
        Ok(())
    }

    /// Skips the irradiance records of the block: all its pixels get gather rays.
    pub(super) fn do_without_records(&mut self) -> Result<(), Fault> {
        self.cache.forget();
        self.set_all_sums(UNSUMMED)?;
        self.position = Position::at(Pass::NextPixels);
        Ok(())
    }

    fn set_all_sums(&mut self, sum: u16) -> Result<(), Fault> {
        self.sums.clear();
        let has_room = self.sums.resize(self.block.pixels() as usize, sum);
        has_room.then_some(()).ok_or(Invariant::Pixels.fault())
    }

    pub(super) fn window(&self) -> Window {
        self.block.window(&self.tile)
    }

    /// Identifies path `path` of sample `sample` of the block's pixel `index`.
    pub(super) fn path(&self, index: u32, sample: u32, path: u32) -> PixelSample {
        let [column, row] = self.block.pixel(index);
        let sample = self.paths(index).index(sample, path);
        PixelSample { x: self.tile.x + column, y: self.tile.y + row, sample }
    }

    /// Current path of the block's pixel `index`, and the path's weight in the pixel's sum.
    pub(super) fn present_path(&self, frame: &FrameParameters, index: u32) -> (PixelSample, f32) {
        let sample = self.position.sample_of(frame);
        (self.path(index, sample, self.position.path), self.paths(index).weight(frame, sample))
    }

    /// Number of paths per sample of the block's pixel `index`.
    pub(super) fn paths(&self, index: u32) -> Paths {
        self.paths.values().get(index as usize).copied().unwrap_or(Paths::ONE)
    }

    /// Sets the number of paths per sample of the block's pixel `index`.
    pub(super) fn set_paths(&mut self, index: u32, paths: Paths) -> Result<(), Fault> {
        let of_pixel = self.paths.values_mut().get_mut(index as usize);
        *of_pixel.ok_or(Invariant::Pixels.fault())? = paths;
        Ok(())
    }

    /// Begins the passes of the pixels with gather rays.
    pub(super) fn begin_pixels(&mut self, frame: &FrameParameters) {
        self.position = Position::at(if adaptive::needs_probes(frame) { Pass::Probe } else { Pass::Eye });
    }

    /// Row-major index of the block's pixel `index` in the tile.
    pub(super) fn index_in_tile(&self, index: u32) -> u32 {
        let [column, row] = self.block.pixel(index);
        row * self.tile.width + column
    }

    /// Number of the block's pixel `index` among the tile's pixels with sums; `None` if the pixel has no sum.
    pub(super) fn sum(&self, index: u32) -> Option<u16> {
        self.sums.values().get(index as usize).copied().filter(|&number| number < UNSUMMED)
    }

    /// Index of the first pixel with gather rays among `pixels` of the block; `None` if there is none.
    pub(super) fn first_with_rays(&self, pixels: Range<u32>) -> Option<u32> {
        let states = self.sums.values().get(pixels.start as usize..pixels.end as usize)?;
        let index = states.iter().position(|&state| state != PLAIN)?;
        Some(pixels.start + index as u32)
    }

    /// Marks the block's pixel `index` as one with gather rays.
    pub(super) fn give_rays(&mut self, index: u32) -> Result<(), Fault> {
        self.set_sum(index, UNSUMMED)
    }

    /// Sets the number of the block's pixel `index` among the tile's pixels with sums.
    pub(super) fn set_sum(&mut self, index: u32, number: u16) -> Result<(), Fault> {
        let sum = self.sums.values_mut().get_mut(index as usize);
        *sum.ok_or(Invariant::Pixels.fault())? = number;
        Ok(())
    }
}

/// Relative error bound of interpolated irradiance; `None` in a frame without irradiance cache or gather
/// rays.
pub(super) fn allowed_error(frame: &FrameParameters) -> Option<f32> {
    frame.irradiance_error.filter(|_| frame.gather_rays > 0)
}
