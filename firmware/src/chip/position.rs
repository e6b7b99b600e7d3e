//! Progress of a tile: its blocks, and the passes of a block.

use photoncard_shared::message::{FrameParameters, Tile};

use crate::irradiance_cache::Window;

/// A rectangle of a tile's pixels. Coordinates are relative to the tile's upper left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Block {
    pub(super) const EMPTY: Self = Self { x: 0, y: 0, width: 0, height: 0 };

    /// Block with all pixels of a tile.
    pub(super) fn whole(width: u32, height: u32) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    pub(super) fn pixels(&self) -> u32 {
        self.width * self.height
    }

    /// Pixels of the block in the picture.
    pub(super) fn window(&self, tile: &Tile) -> Window {
        let [x0, y0] = [tile.x + self.x, tile.y + self.y];
        Window { x0, x1: x0 + self.width, y0, y1: y0 + self.height }
    }

    /// Column and row, in the tile, of the block's pixel with row-major index `index`.
    pub(super) fn pixel(&self, index: u32) -> [u32; 2] {
        let width = self.width.max(1);
        [self.x + index % width, self.y + index / width]
    }

    /// Halves the block across its longer side; `None` for a block of one pixel.
    pub(super) fn halves(&self) -> Option<[Self; 2]> {
        let Self { x, y, width, height } = *self;
        if self.pixels() < 2 {
            return None;
        }
        Some(if width >= height {
            let half = width / 2;
            [Self { width: half, ..*self }, Self { x: x + half, width: width - half, ..*self }]
        } else {
            let half = height / 2;
            [Self { height: half, ..*self }, Self { y: y + half, height: height - half, ..*self }]
        })
    }
}

/// Passes of a block, in order. [`Pass::ReadKept`] to [`Pass::WaitForRecords`] are for the irradiance cache;
/// if kept records are found, [`Pass::ReadKept`] is the only one of these. In a frame with gather rays but no
/// irradiance cache, [`Pass::CompletePlain`] is skipped. The later passes are only for pixels with gather
/// rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    /// There is no tile.
    Vacant,
    /// The next block has not begun.
    NextBlock,
    /// Search for the irradiance records that an earlier frame has kept.
    ReadKept,
    /// Survey: placement of irradiance records, level by level of the lattice.
    Survey,
    /// Choice of the direction tables of the irradiance records.
    RecordPoints,
    /// Gather rays of the irradiance records, by direction bin.
    RecordRays,
    /// Gathers of the irradiance records wait in the queue.
    WaitForRecords,
    /// Completion of the pixels without gather rays. Pixels with gather rays are found and left for later.
    CompletePlain,
    /// The passes of the pixels with gather rays have not begun.
    NextPixels,
    /// Probes of the pixels with gather rays; skipped without adaptive sampling.
    Probe,
    /// Eye rays of one path of each pixel in a stripe.
    Eye,
    /// Shadow rays and caustic gathers of the stripe's paths with gather rays.
    Direct,
    /// Gather rays of the stripe's paths, by direction bin.
    Rays,
    /// All gather rays of the block's pixels are cast; gathers wait in the queue.
    Wait,
    /// Completion of the pixels with gather rays, when none of their gathers waits any more.
    Complete,
}

/// Progress of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Position {
    pub(super) pass: Pass,
    /// Number of the current sample, counted from the frame's first.
    sample: u32,
    /// Number of the current path in the sample.
    pub(super) path: u32,
    /// Number of the current direction bin.
    pub(super) bin: u32,
    /// Index in the block of the stripe's first pixel. A stripe is a row-major run of pixels whose gather
    /// points are stored together.
    pub(super) first: u32,
    /// Index of the current pixel in the stripe or block, of the current lattice point, or of the current
    /// gather point.
    pub(super) index: u32,
    /// Number of rays of the current gather point that were already cast in the current bin.
    rays: u32,
}

impl Position {
    pub(super) const VACANT: Self = Self::at(Pass::Vacant);

    /// Beginning of a pass, at the first sample.
    pub(super) const fn at(pass: Pass) -> Self {
        Self { pass, sample: 0, path: 0, bin: 0, first: 0, index: 0, rays: 0 }
    }

    /// Number of rays of the current gather point already cast in the current bin.
    pub(super) fn rays_cast(&self) -> u32 {
        self.rays
    }

    /// Advances past `rays` rays of gather point `index` in the current direction bin. If they are the
    /// point's last rays in the bin (`are_last`), advances to the next point.
    pub(super) fn pass_rays(&mut self, index: u32, rays: u32, are_last: bool) {
        [self.index, self.rays] = if are_last { [index + 1, 0] } else { [index, self.rays + rays] };
    }

    /// Advances to the first gather point and the next of `count` bins, cyclically. Returns whether the
    /// previous bin was the last.
    pub(super) fn end_bin(&mut self, count: u32) -> bool {
        self.index = 0;
        next(&mut self.bin, count)
    }

    /// Advances to the next of `count` indices, cyclically. Returns whether the previous index was the last.
    pub(super) fn next_index(&mut self, count: u32) -> bool {
        next(&mut self.index, count)
    }

    /// Number of the current sample among all samples of a pixel.
    pub(super) fn sample_of(&self, frame: &FrameParameters) -> u32 {
        frame.first_sample.wrapping_add(self.sample)
    }

    /// Advances to the first path of the frame's next sample, cyclically. Returns whether the previous sample
    /// was the last.
    pub(super) fn next_sample(&mut self, frame: &FrameParameters) -> bool {
        self.path = 0;
        next(&mut self.sample, frame.samples)
    }
}

fn next(number: &mut u32, count: u32) -> bool {
    *number += 1;
    let was_last = *number >= count;
    if was_last {
        *number = 0;
    }
    was_last
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;

    #[test]
    fn halves_partition_a_block_down_to_one_pixel() {
        let mut waiting = vec![Block { x: 3, y: 5, width: 7, height: 4 }];
        let mut pixels = Vec::new();
        while let Some(block) = waiting.pop() {
            match block.halves() {
                Some(halves) => waiting.extend(halves),
                None => pixels.push(block.pixel(0)),
            }
        }
        pixels.sort_unstable();
        let mut expected: Vec<_> = (3..10).flat_map(|x| (5..9).map(move |y| [x, y])).collect();
        expected.sort_unstable();
        assert_eq!(pixels, expected);
    }
}
