//! How far a tile has come.

use core::ops::Range;

/// A rectangle of a tile's pixels, counted from the tile's corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Block {
    pub(super) const EMPTY: Self = Self { x: 0, y: 0, width: 0, height: 0 };

    /// All pixels of a tile.
    pub(super) fn whole(width: u32, height: u32) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    pub(super) fn pixels(&self) -> u32 {
        self.width * self.height
    }

    /// The column and the row in the tile of the block's pixel `index`, counted in rows.
    pub(super) fn pixel(&self, index: u32) -> [u32; 2] {
        let width = self.width.max(1);
        [self.x + index % width, self.y + index / width]
    }

    /// Its two halves along its longer side; `None` of one pixel.
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

/// The stages of a block, in their order. Those from [`Stage::Survey`] to [`Stage::RecordSums`] are of the irradiance
/// cache and left out without it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Which irradiance records there are, level by level of the lattice.
    Survey,
    /// Where the rays of the next records start, of as many as are gathered at once.
    RecordPoints,
    /// Their gather rays, bin by bin.
    RecordRays,
    /// What has come of them, when no gather waits.
    RecordSums,
    /// What each pixel sees, sample by sample.
    Eye,
    /// What shadow rays bring.
    Direct,
    /// The gather rays, bin by bin.
    Rays,
    /// The block is complete when no gather waits; the next one begins, if there is any.
    Done,
}

/// How far a block has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Position {
    pub(super) stage: Stage,
    pub(super) sample: u32,
    /// The direction bin.
    pub(super) bin: u32,
    /// The pixel of the block, or the gather point of a record.
    pub(super) index: u32,
    /// Rays of the bin that are cast.
    rays: u32,
}

/// Gather rays that one step casts.
const RAYS_PER_STEP: u32 = 64;

impl Position {
    pub(super) const DONE: Self = Self::at(Stage::Done);

    /// The beginning of a stage, of the first sample.
    pub(super) const fn at(stage: Stage) -> Self {
        Self { stage, sample: 0, bin: 0, index: 0, rays: 0 }
    }

    /// The next of the rays of the present bin and index that a step casts, and whether they are the last.
    pub(super) fn next_rays(&mut self, of_bin: Range<u32>) -> (Range<u32>, bool) {
        let first = of_bin.start + self.rays;
        let end = of_bin.end.min(first + RAYS_PER_STEP);
        let is_last = end >= of_bin.end;
        self.rays = if is_last { 0 } else { self.rays + RAYS_PER_STEP };
        (first..end, is_last)
    }

    /// Goes on to the next of `count` indices; at the end of them to the first again. Returns whether it was the last.
    pub(super) fn next_index(&mut self, count: u32) -> bool {
        next(&mut self.index, count)
    }

    /// Goes on to the next of `count` bins and says whether it was the last, as [`Self::next_index`].
    pub(super) fn next_bin(&mut self, count: u32) -> bool {
        next(&mut self.bin, count)
    }

    /// Goes on to the next of `count` samples and says whether it was the last, as [`Self::next_index`].
    pub(super) fn next_sample(&mut self, count: u32) -> bool {
        next(&mut self.sample, count)
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
    fn steps_cast_all_rays_of_a_bin_and_none_twice() {
        for of_bin in [5..5, 0..1, 7..71, 3..500, 0..64, 0..16_384] {
            let mut position = Position::at(Stage::Rays);
            let mut cast = Vec::new();
            loop {
                let (rays, is_last) = position.next_rays(of_bin.clone());
                assert!(rays.len() <= RAYS_PER_STEP as usize);
                cast.extend(rays);
                if is_last {
                    break;
                }
            }
            assert!(cast.into_iter().eq(of_bin));
        }
    }

    #[test]
    fn halves_make_up_the_whole_down_to_one_pixel() {
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
