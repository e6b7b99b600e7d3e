//! Scheduler of tiles over cards, and the orders of photon gathers.
//!
//! Tiles wait in one queue. A card with a free credit takes the next one; no card waits for another, and results come
//! in any order. A tile's pixels depend neither on the card that renders it nor on the time.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use photoncard_shared::message::{Drain, Tile};

use crate::film::Window;

/// Order of the photon gathers. It does not change the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GatherOrder {
    /// Pixels along scanlines, the rays of each in the sampler's order.
    Naive,
    /// Pixels along the scanlines of square tiles, the rays of each in the sampler's order.
    Tiled,
    /// Within a tile, the rays of one direction bin for all pixels, then the rays of the next bin.
    DirectionBins,
    /// Rays by direction bins; gathers wait in the chip's queue and are done in the order of a spatial hash of their
    /// positions.
    Hash,
    /// Rays by direction bins; gathers wait in the chip's queue and are done along a Hilbert curve.
    Sort,
    /// All gathers of the frame along one Hilbert curve: for emulated cards alone, which leave them to the host.
    Hilbert,
}

impl GatherOrder {
    /// Policy by which a chip drains its queue of gathers.
    pub fn drain(self) -> Drain {
        match self {
            Self::Naive | Self::Tiled | Self::DirectionBins => Drain::Immediate,
            Self::Hash => Drain::Hash,
            Self::Sort | Self::Hilbert => Drain::Sort,
        }
    }

    /// Returns whether rays are cast by direction bins.
    pub fn has_bins(self) -> bool {
        !matches!(self, Self::Naive | Self::Tiled)
    }
}

/// The tiles of a window, numbered from 0: squares of `side`, or in the naive order rows of up to `side * side` pixels.
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

/// Queue of a picture's tiles with its progress, shared by the threads of all cards.
#[derive(Debug)]
pub struct Scheduler {
    state: Mutex<State>,
    /// Notified when a tile waits again or all are done.
    changed: Condvar,
    total: usize,
}

#[derive(Debug)]
struct State {
    waiting: VecDeque<Tile>,
    done: usize,
}

impl Scheduler {
    /// A scheduler with all tiles waiting.
    pub fn new(tiles: Vec<Tile>) -> Self {
        let total = tiles.len();
        let state = Mutex::new(State { waiting: tiles.into(), done: 0 });
        Self { state, changed: Condvar::new(), total }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // A thread that panicked with the lock held left no tile half moved.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the next tile, for a card with a free credit; `None` if none waits.
    pub fn take(&self) -> Option<Tile> {
        self.lock().waiting.pop_front()
    }

    /// Counts a tile as done.
    pub fn complete(&self) {
        let mut state = self.lock();
        state.done += 1;
        if state.done == self.total {
            self.changed.notify_all();
        }
    }

    /// Puts a tile back at the front of the queue, as it has waited longest.
    pub fn give_back(&self, tile: Tile) {
        self.lock().waiting.push_front(tile);
        self.changed.notify_all();
    }

    /// Returns whether all tiles are done.
    pub fn is_complete(&self) -> bool {
        self.lock().done == self.total
    }

    /// Number of tiles that are done, and of all tiles.
    pub fn progress(&self) -> (usize, usize) {
        (self.lock().done, self.total)
    }

    /// Blocks until a tile waits or all are done, at most for `most`.
    pub fn wait_for_tile(&self, most: Duration) {
        self.wait_while(most, |state| state.waiting.is_empty() && state.done < self.total);
    }

    /// Blocks until all tiles are done, at most for `most`.
    pub fn wait_for_end(&self, most: Duration) {
        self.wait_while(most, |state| state.done < self.total);
    }

    fn wait_while(&self, most: Duration, must_wait: impl Fn(&State) -> bool) {
        let waited = self.changed.wait_timeout_while(self.lock(), most, |state| must_wait(state));
        drop(waited);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

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

    #[test]
    fn waits_end_with_what_they_wait_for() {
        let tile = Tile { id: 0, x: 0, y: 0, width: 1, height: 1 };
        let scheduler = Scheduler::new(vec![tile, tile]);
        let long = Duration::from_secs(60);
        scheduler.wait_for_tile(long);
        let [first, _] = [scheduler.take().unwrap(), scheduler.take().unwrap()];
        scheduler.wait_for_tile(Duration::ZERO);
        let begin = Instant::now();
        std::thread::scope(|scope| {
            scope.spawn(|| scheduler.wait_for_end(long));
            scope.spawn(|| {
                scheduler.wait_for_tile(long);
                assert_eq!(scheduler.take(), Some(first));
                scheduler.complete();
                scheduler.complete();
            });
            scheduler.give_back(first);
        });
        assert!(begin.elapsed() < long && scheduler.is_complete());
    }
}
