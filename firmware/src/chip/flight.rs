//! A tile in flight: its state from the command to its last pixel.

use heapless::Vec;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{FrameParameters, Tile};

use super::finished_pixel::Completion;
use super::position::{Block, Pass, Position};
use crate::irradiance_cache::{IrradianceCache, Window};
use crate::kind::{Buffer, Capacity, ChipKind, Vacant};
use crate::render::PixelSample;

/// Capacity of the stack of blocks: enough for all halvings of a tile.
const MAX_BLOCKS: usize = 32;

/// Number of a pixel without a sum.
const NO_SUM: u16 = u16::MAX;

/// State of a tile in flight. It is rendered in one block or, if its irradiance records do not fit into the cache, in several smaller
/// ones, one after another.
pub(super) struct Flight<K: ChipKind> {
    pub(super) tile: Tile,
    pub(super) counters: Counters,
    /// Blocks that have not begun, the next on top.
    blocks: Vec<Block, MAX_BLOCKS>,
    pub(super) block: Block,
    pub(super) position: Position,
    /// Number of the block's gathers in the queue.
    pub(super) waiting: u32,
    pub(super) cache: IrradianceCache<K::IrradianceRecords>,
    /// True if the records of the block are those of an earlier frame.
    pub(super) is_recalled: bool,
    /// Number of each pixel's sum in [`super::pixel_sums::PixelSums`], or [`NO_SUM`].
    sums: <K::TilePixels as Capacity>::Buffer<u16>,
    /// State of the pixel that is being completed.
    pub(super) completion: Option<Completion>,
}

impl<K: ChipKind> Vacant for Flight<K> {
    const VACANT: Self = Self {
        tile: Tile { id: 0, x: 0, y: 0, width: 0, height: 0 },
        counters: Counters::ZERO,
        blocks: Vec::new(),
        block: Block::EMPTY,
        position: Position::VACANT,
        waiting: 0,
        cache: IrradianceCache::new(),
        is_recalled: false,
        sums: Buffer::EMPTY,
        completion: None,
    };
}

impl<K: ChipKind> Flight<K> {
    /// Begins a tile.
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
        self.completion = None;
    }

    pub(super) fn pass(&self) -> Pass {
        self.position.pass
    }

    /// True if the pixels of the block are being completed, or can be.
    pub(super) fn is_completable(&self) -> bool {
        match self.pass() {
            Pass::Complete => true,
            Pass::Wait => self.waiting == 0,
            _ => false,
        }
    }

    /// Begins the next block.
    pub(super) fn begin_block(&mut self, frame: &FrameParameters) {
        self.block = self.blocks.pop().unwrap_or(Block::EMPTY);
        self.sums.view_mut().clear();
        // Fits: a tile has at most as many pixels.
        let _ = self.sums.view_mut().resize(self.block.pixels() as usize, NO_SUM);
        self.is_recalled = false;
        match allowed_error(frame) {
            None => self.position = Position::at(Pass::Eye),
            Some(_) if frame.keep_records => self.position = Position::at(Pass::Recall),
            Some(_) => self.begin_records(),
        }
    }

    /// True if blocks are left.
    pub(super) fn has_blocks(&self) -> bool {
        !self.blocks.is_empty()
    }

    /// Replaces the block, whose records do not fit into the cache, by its two halves. A block of one pixel always
    /// fits.
    pub(super) fn divide_block(&mut self) {
        let Some([first, second]) = self.block.halves().filter(|_| self.blocks.len() + 2 <= MAX_BLOCKS)
        else {
            // Never reached: the cache has room for one pixel, and the stack of blocks for all halvings of a tile.
            // Every sample would then do its own final gather.
            return self.do_without_records();
        };
        for half in [second, first] {
            let _ = self.blocks.push(half);
        }
        self.position = Position::at(Pass::NextBlock);
    }

    pub(super) fn do_without_records(&mut self) {
        self.cache.forget();
        self.position = Position::at(Pass::Eye);
    }

    pub(super) fn window(&self) -> Window {
        let [x0, y0] = [self.tile.x + self.block.x, self.tile.y + self.block.y];
        Window { x0, x1: x0 + self.block.width, y0, y1: y0 + self.block.height }
    }

    /// Sample `sample` of the frame's, of pixel `index` of the block.
    pub(super) fn sample(&self, frame: &FrameParameters, index: u32, sample: u32) -> PixelSample {
        let [column, row] = self.block.pixel(index);
        let sample = frame.first_sample.wrapping_add(sample);
        PixelSample { x: self.tile.x + column, y: self.tile.y + row, sample }
    }

    /// Index in the tile, row-major, of pixel `index` of the block.
    pub(super) fn index_in_tile(&self, index: u32) -> u32 {
        let [column, row] = self.block.pixel(index);
        row * self.tile.width + column
    }

    /// Number of the sum of pixel `index` of the block; `None` without one.
    pub(super) fn sum(&self, index: u32) -> Option<u16> {
        self.sums.view().get(index as usize).copied().filter(|&number| number != NO_SUM)
    }

    /// Sets the number of the sum of pixel `index` of the block.
    pub(super) fn set_sum(&mut self, index: u32, number: u16) {
        if let Some(sum) = self.sums.view_mut().get_mut(index as usize) {
            *sum = number;
        }
    }
}

/// Error bound of interpolated irradiance; `None` if the frame interpolates none.
pub(super) fn allowed_error(frame: &FrameParameters) -> Option<f32> {
    frame.irradiance_error.filter(|_| frame.gather_rays > 0)
}
