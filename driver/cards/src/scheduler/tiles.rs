//! Tiles of a picture, and the order of their photon gathers.

use photoncard_picture::choice::choices;
use photoncard_picture::film::Window;
use photoncard_shared::message::{Drain, Tile};

/// Order of photon gathers. It has no effect on the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GatherOrder {
    /// Pixels along scanlines, each with its rays in the sampler's order.
    Naive,
    /// Pixels along the scanlines of square tiles, each with its rays in the sampler's order.
    Tiled,
    /// Within a tile, the rays of all pixels in one direction bin (range of directions), then those in the
    /// next.
    DirectionBins,
    /// Rays by direction bins. Gathers wait in the chip's queue, and are done in the order of a spatial hash
    /// of their positions.
    Hash,
    /// Rays by direction bins. Gathers wait in the chip's queue, and are done in order along a Hilbert curve.
    #[default]
    Sort,
    /// Rays by direction bins. Gathers of many tiles wait in card memory, and are done in order along a
    /// Hilbert curve.
    Buckets,
}

choices!(GatherOrder {
    Naive = "naive": "Pixels along scanlines",
    Tiled = "tiled": "Pixels along the scanlines of a tile",
    DirectionBins = "dirbin": "Rays of one direction bin for all pixels of a tile, then of the next bin",
    Hash = "hash": "By direction bins; gathers wait and are sorted by a spatial hash of their positions",
    Sort = "sort": "By direction bins; gathers wait and are sorted along a Hilbert curve",
    Buckets = "buckets": "As sort, but gathers of many tiles wait in card memory",
});

impl GatherOrder {
    /// Policy by which a chip empties its gather queue.
    pub fn drain(self) -> Drain {
        match self {
            Self::Naive | Self::Tiled | Self::DirectionBins => Drain::Immediate,
            Self::Hash => Drain::Hash,
            Self::Sort => Drain::Sort,
            Self::Buckets => Drain::Buckets,
        }
    }

    /// Returns whether gathers wait in a chip's queue.
    pub fn has_queue(self) -> bool {
        matches!(self, Self::Hash | Self::Sort | Self::Buckets)
    }

    /// Returns whether rays are cast by direction bins.
    pub fn has_bins(self) -> bool {
        !matches!(self, Self::Naive | Self::Tiled)
    }
}

/// Divides a window into tiles of at most `side * side` pixels, numbered from 0. The tiles are rows of pixels
/// in the naive order, otherwise squares.
pub fn tiles(window: Window, side: u32, order: GatherOrder) -> Vec<Tile> {
    let side = side.max(1);
    let (tile_width, tile_height) = match order {
        GatherOrder::Naive => (side.saturating_mul(side), 1),
        _ => (side, side),
    };
    let mut tiles = Vec::new();
    for y in (window.y0..window.y1).step_by(tile_height as usize) {
        for x in (window.x0..window.x1).step_by(tile_width as usize) {
            tiles.push(Tile {
                id: tiles.len() as u32,
                x,
                y,
                width: tile_width.min(window.x1 - x),
                height: tile_height.min(window.y1 - y),
            });
        }
    }
    tiles
}

/// Sorts tiles such that any first `k` of them are spread over the picture, and their render times are
/// typical of it. The key is the fractional part of `number / golden ratio`. The gaps between the first `k`
/// of `n` numbers have at most three lengths, all about `n / k` (three-gap theorem). The tiles must be
/// numbered from 0.
pub fn spread(mut tiles: Vec<Tile>) -> Vec<Tile> {
    /// `2^32` divided by the golden ratio.
    const GOLDEN: u32 = 0x9E37_79B9;
    tiles.sort_by_key(|tile| GOLDEN.wrapping_mul(tile.id));
    tiles
}

/// Sorts tiles by the distance of their centres from a pixel, the nearest first.
pub fn near(mut tiles: Vec<Tile>, [x, y]: [u32; 2]) -> Vec<Tile> {
    // Square of twice the distance along an axis, because the middle may lie between pixels.
    let along = |start: u32, length: u32, at: u32| {
        u128::from((2 * u64::from(start) + u64::from(length)).abs_diff(2 * u64::from(at))).pow(2)
    };
    tiles.sort_by_key(|tile| along(tile.x, tile.width, x) + along(tile.y, tile.height, y));
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_tile_is_the_one_that_contains_the_pixel() {
        let window = Window { x0: 0, x1: 100, y0: 0, y1: 70 };
        let all = tiles(window, 16, GatherOrder::Sort);
        for (x, y) in [(0, 0), (40, 24), (99, 69), (8, 60)] {
            let sorted = near(all.clone(), [x, y]);
            let Tile { x: left, y: top, width, height, .. } = sorted[0];
            assert!((left..left + width).contains(&x) && (top..top + height).contains(&y), "{x} {y}");
            assert_eq!(sorted.len(), all.len());
        }
        assert_eq!(near(all, [u32::MAX; 2]).len(), 35);
    }

    /// Every tile occurs once, and the first `k` tiles have no large gaps between them.
    #[test]
    fn spread_tiles_are_complete_and_evenly_distributed() {
        for count in 1..=150 {
            let all = tiles(Window { x0: 1, x1: 1 + 8 * count, y0: 7, y1: 9 }, 8, GatherOrder::Sort);
            let found = spread(all.clone());
            let mut sorted = found.clone();
            sorted.sort_by_key(|tile| tile.id);
            assert_eq!(sorted, all);
            for first in 1..=found.len() {
                let mut visited: Vec<u32> = found[..first].iter().map(|tile| tile.id).collect();
                visited.extend([0, count]);
                visited.sort_unstable();
                let gap = visited.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
                assert!(gap as usize * first <= 3 * found.len(), "{first} of {count}: {gap}");
            }
        }
        assert_eq!(spread(Vec::new()), []);
    }

    #[test]
    fn tiles_cover_every_pixel_once() {
        let window = Window { x0: 3, x1: 40, y0: 5, y1: 22 };
        for order in [GatherOrder::Naive, GatherOrder::Tiled] {
            for side in [1, 2, 8, 16, 100] {
                let mut covered = vec![0; 40 * 22];
                for tile in tiles(window, side, order) {
                    assert!(tile.pixels() <= (side * side) as u64);
                    for y in tile.y..tile.y + tile.height {
                        for x in tile.x..tile.x + tile.width {
                            covered[(y * 40 + x) as usize] += 1;
                        }
                    }
                }
                for y in 0..22 {
                    for x in 0..40 {
                        let inside = (3..40).contains(&x) && (5..22).contains(&y);
                        assert_eq!(covered[y * 40 + x], usize::from(inside));
                    }
                }
            }
        }
    }
}
